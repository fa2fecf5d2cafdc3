r"""Accelerations of joints and structure, and their tangents.

The tangent of a solution of $M\,a = f - h$ needs no tangent of the mass matrix: with
the inverse dynamics $r(x, a) = M a + h$ it is $M\,\delta a = \delta f - \delta r$. By
the state r is differentiated in closed form, with fewer operations than the recursion's
derivative has, most of them common to all tangents: what is behind a joint turns as a
whole, as if what is in front moved the other way. With screws $S_k$, twists $V_k$ and
accelerations $A_k$ (gravity included) in the base frame, and the wrench $F_k$ on all
bodies behind a joint,

$u_k = V_k \times S_k$, $w_k = A_k \times S_k + V_k \times u_k$,
$U_j = \sum_{k \le j} (u_k\,\delta s_k + S_k\,\delta\dot s_k)$,
$W_j = \sum_{k \le j} (w_k\,\delta s_k + 2 u_k\,\delta\dot s_k)$,
$\delta\tau_j = S_j^T (\sum_{b \ge j} (I_b W_b + B_b U_b) +
\sum_{k \ge j} S_k \times^* F_k\,\delta s_k)$,

where $B = V \times^* I - I\,V\times + (\cdot) \times^* I V$ of a body. The derivation
is ours; peers differentiate the recursion in link frames instead. By the parameters of
the robot autodiff differentiates r.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from .._taylor import cross, skew
from ..kinematics import moving_frames
from ._robot import ElasticRobot
from ._screws import (
    BodyTerms,
    about_origin,
    body_terms,
    chain_motion,
    forces_by_screws,
    joint_screws,
    multibody,
    sum_behind,
    wrenches,
)


Coordinates = Float[Array, " coordinates"]


def _motion_cross(a, b):
    """Rates of the screws b that are carried along by the twists a."""
    velocity = cross(a[:, 3:], b[:, :3]) + cross(a[:, :3], b[:, 3:])
    return jnp.concatenate([velocity, cross(a[:, 3:], b[:, 3:])], axis=1)


def _force_cross(a, f):
    """Rates of the wrenches f that are carried along by the twists a."""
    force = cross(a[:, 3:], f[:, :3])
    moment = cross(a[:, 3:], f[:, 3:]) + cross(a[:, :3], f[:, :3])
    return jnp.concatenate([force, moment], axis=1)


def _gyroscopic(terms: BodyTerms):
    r"""Momentum p and matrix N of $B u = 2\,(u_\omega \times p,\; N u_\omega)$.

    $N = (v^T h)\,1 - v h^T - \tilde\omega\,\Sigma$ with the first moment h and the
    second moment $\Sigma$ about the base origin: what Jacobi's identity leaves of B.
    """
    first, inertia = about_origin(terms)
    v, w = terms.twist[:, :3], terms.twist[:, 3:]
    identity = jnp.eye(3, dtype=v.dtype)[None]
    half = 0.5 * jnp.einsum("kaa->k", inertia)
    second = half[:, None, None] * identity - inertia
    along = jnp.einsum("ka,ka->k", v, first)[:, None, None] * identity
    matrix = along - jnp.einsum("ka,kb->kab", v, first)
    matrix = matrix - jnp.einsum("kab,kbc->kac", skew(w), second)
    return terms.mass[:, None] * terms.velocity, matrix


def force_tangents(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    acceleration: Coordinates,
) -> Callable[[Coordinates, Coordinates], Coordinates]:
    """Tangents of `forces_by_screws` by the state, at fixed accelerations.

    Args:
        robot: the robot.
        q, eta, qd, etad: state of joints and structure [rad], [rad/s].
        acceleration: of (q, eta) [rad/s^2].

    Returns:
        Function of small changes of (q, eta) and of their velocities to the change of
        the generalised forces [N m].
    """
    coupling = robot.coupling()
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    screws = joint_screws(robot, frames)
    sd = robot.joint_coordinates(qd, etad)
    twist, spatial = chain_motion(robot, screws, sd, coupling @ acceleration)
    terms = body_terms(robot, frames, twist)
    wrench = sum_behind(robot, wrenches(robot, terms, spatial))
    first, inertia = about_origin(terms)
    momentum, matrix = _gyroscopic(terms)
    turned = _force_cross(screws, wrench)
    u = _motion_cross(twist, screws)
    w = _motion_cross(spatial, screws) + _motion_cross(twist, u)
    index = np.array(robot.all_bodies().joint, int)
    sums = jnp.asarray(np.tri(robot.chain.number), screws.dtype)
    mass = terms.mass[:, None]

    def tangent(angles: Coordinates, speeds: Coordinates) -> Coordinates:
        ds, dsd = (coupling @ angles)[:, None], (coupling @ speeds)[:, None]
        turn = (sums @ (u[:, 3:] * ds + screws[:, 3:] * dsd))[index]
        push = (sums @ (w * ds + 2.0 * u * dsd))[index]
        a, alpha = push[:, :3], push[:, 3:]
        force = mass * a + cross(alpha, first) + 2.0 * cross(turn, momentum)
        moment = cross(first, a) + jnp.einsum("kab,kb->ka", inertia, alpha)
        moment = moment + 2.0 * jnp.einsum("kab,kb->ka", matrix, turn)
        change = sum_behind(robot, jnp.concatenate([force, moment], axis=1))
        # from the last joint on, so that the sums have common beginnings
        change = change + (sums @ (turned * ds)[::-1])[::-1]
        return coupling.T @ jnp.einsum("ka,ka->k", screws, change)

    return tangent


@kernel
def _accelerations(robot, q, eta, qd, etad, force, rotors):
    factor, rest = _balance(robot, q, eta, qd, etad, force, rotors)
    return jax.scipy.linalg.cho_solve(factor, rest)


def _balance(robot, q, eta, qd, etad, force, rotors):
    """Factorised mass matrix and the forces that it has to turn into accelerations."""
    mass, bias = multibody(robot, q, eta, qd, etad)
    if rotors is not None:
        mass = mass + jnp.diag(jnp.pad(rotors, (0, len(mass) - len(rotors))))
    return jax.scipy.linalg.cho_factor(mass), force - bias


@eqx.filter_custom_jvp
def _differentiable(robot, q, eta, qd, etad, force, rotors):
    return _accelerations(robot, q, eta, qd, etad, force, rotors)


@_differentiable.def_jvp
def _tangent(primals, tangents):
    """Tangents are `None` where nothing moves."""
    robot, q, eta, qd, etad, force, rotors = primals
    state = q, eta, qd, etad
    robot_rate, *rates, force_rate, rotor_rate = tangents
    n = robot.axes
    factor, rest = _balance(robot, *state, force, rotors)
    acceleration = jax.scipy.linalg.cho_solve(factor, rest)
    missing: Any = jnp.zeros_like(force) if force_rate is None else force_rate
    if rotor_rate is not None:
        missing = missing.at[:n].add(-rotor_rate * acceleration[:n])
    if any(rate is not None for rate in rates):
        rates = [jnp.zeros_like(x) if r is None else r for x, r in zip(state, rates)]
        missing = missing - _force_change(robot, state, acceleration, rates)
    if jax.tree.leaves(robot_rate):
        still, moving = eqx.partition(
            robot, jax.tree.map(lambda r: r is None, robot_rate, is_leaf=_is_none)
        )
        a = acceleration[:n], acceleration[n:]
        forces = lambda r: forces_by_screws(eqx.combine(r, still), *state, *a)
        missing = missing - jax.jvp(forces, (moving,), (robot_rate,))[1]
    return acceleration, jax.scipy.linalg.cho_solve(factor, missing)


def _force_change(robot, state, acceleration, rates):
    """Change of the forces at fixed accelerations."""
    if robot.modal_links:  # no closed form for the flexible bodies
        n = robot.axes
        a = acceleration[:n], acceleration[n:]
        forces = lambda q, eta, qd, etad: forces_by_screws(robot, q, eta, qd, etad, *a)
        return jax.jvp(forces, tuple(state), tuple(rates))[1]
    angles, speeds = jnp.concatenate(rates[:2]), jnp.concatenate(rates[2:])
    q, eta, qd, etad = state
    return force_tangents(robot, q, eta, qd, etad, acceleration)(angles, speeds)


def _is_none(x) -> bool:
    return x is None


def body_accelerations(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    force: Coordinates,
    rotors: PerJoint | None = None,
) -> Coordinates:
    """Accelerations of (q, eta) under given forces [rad/s^2].

    Args:
        robot: the robot.
        q, eta, qd, etad: state of joints and structure [rad], [rad/s].
        force: generalised forces besides those of the bodies [N m].
        rotors: inertias that move with the axes [kg m^2], shape (axes,).

    References:
        [Reiner2010] (2.38).
    """
    return _differentiable(robot, q, eta, qd, etad, force, rotors)
