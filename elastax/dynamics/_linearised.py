r"""Accelerations of joints and structure, and their derivatives by the state.

The tangent of a solution of $M\,a = f - h$ needs no tangent of the mass matrix: with the
inverse dynamics $r(x, a) = M a + h$ it is $M\,\delta a = \delta f - \partial_x r\,
\delta x$. For the state $\partial_x r$ is known in closed form. Behind a joint that
turns everything turns with it, as if what is in front moved the other way: with screws
$S_k$, twists $V_k$ and accelerations $A_k$ in the base frame,

$u_k = V_k \times S_k$, $w_k = A_k \times S_k + V_k \times u_k$,
$B = V \times^* I - I\,V\times + (\cdot) \times^* I V$ for every body,
$\partial F / \partial s_k = S_k \times^* F + I w_k + B u_k$,
$\partial F / \partial \dot s_k = 2 I u_k + B S_k$,

summed over the bodies behind the joint. Twenty tangents then cost twenty products with
small matrices instead of twenty recursions. `forces_by_screws` and autodiff say the same.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel, moving_jvp
from .._taylor import cross, skew
from ..kinematics import moving_frames
from ._robot import ElasticRobot
from ._screws import (
    BodyTerms,
    about_origin,
    body_terms,
    chain_motion,
    composites,
    forces_by_screws,
    joint_screws,
    mass_matrix,
    multibody,
    sum_behind,
    wrenches,
)


Square = Float[Array, "coordinates coordinates"]
Coordinates = Float[Array, " coordinates"]


class LinearisedBodies(NamedTuple):
    """Accelerations of (q, eta) and what small changes do to them.

    Attributes:
        acceleration: a [rad/s^2], shape (coordinates,).
        mobility: inverse of the mass matrix [1/(kg m^2)].
        stiffness: derivative of the inverse dynamics by the coordinates at fixed
            accelerations [N m/rad].
        damping: its derivative by the velocities [N m s/rad].
    """

    acceleration: Coordinates
    mobility: Square
    stiffness: Square
    damping: Square


def _motion_cross(a, b):
    """Rate of the screw b that is carried along by the twist a."""
    velocity = cross(a[:, 3:], b[:, :3]) + cross(a[:, :3], b[:, 3:])
    return jnp.concatenate([velocity, cross(a[:, 3:], b[:, 3:])], axis=1)


def _force_cross(a, f):
    """Rate of the wrench f that is carried along by the twist a."""
    force = cross(a[:, 3:], f[:, :3])
    moment = cross(a[:, 3:], f[:, 3:]) + cross(a[:, :3], f[:, :3])
    return jnp.concatenate([force, moment], axis=1)


def _gyroscopic(terms: BodyTerms):
    r"""Momentum p and matrix N of $B u = 2\,(u_\omega \times p,\; N u_\omega)$.

    $N = (v^T h)\,1 - v h^T - \tilde\omega\,\Sigma$ with the first moment h and the second
    moment $\Sigma$ about the base origin: what is left of B by the Jacobi identity.
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


@kernel
def linearised_bodies(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    force: Coordinates,
    rotors: PerJoint | None = None,
) -> LinearisedBodies:
    """Accelerations under given forces, with the matrices of their tangents.

    Args:
        robot: the robot.
        q, eta, qd, etad: state of joints and structure [rad], [rad/s].
        force: generalised forces besides those of the bodies [N m].
        rotors: inertias that move with the axes [kg m^2], shape (axes,).
    """
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    screws = joint_screws(robot, frames)
    coupling = robot.coupling()
    sd = robot.joint_coordinates(qd, etad)
    twist, bias = chain_motion(robot, screws, sd, jnp.zeros_like(sd))
    terms = body_terms(robot, frames, twist)
    inertia = composites(robot, terms)
    momenta = inertia.times(screws)
    mass = _with_rotors(mass_matrix(robot, screws, momenta), rotors)
    wrench = sum_behind(robot, wrenches(robot, terms, bias))
    rest = force - coupling.T @ jnp.einsum("ka,ka->k", screws, wrench)
    mobility = _solve(mass, jnp.eye(mass.shape[0], dtype=mass.dtype))
    solution = _solve(mass, rest)

    _, acceleration = chain_motion(robot, screws, sd, coupling @ solution)
    wrench = sum_behind(robot, wrenches(robot, terms, acceleration))
    momentum, matrix = _gyroscopic(terms)
    total = sum_behind(
        robot, jnp.concatenate([momentum, matrix.reshape(-1, 9)], axis=1)
    )
    momentum, matrix = total[:, :3], total[:, 3:].reshape(-1, 3, 3)

    def gyroscopic(screw):
        turn = screw[:, 3:]
        spin = jnp.einsum("kab,kb->ka", matrix, turn)
        return 2.0 * jnp.concatenate([cross(turn, momentum), spin], axis=1)

    u = _motion_cross(twist, screws)
    w = _motion_cross(acceleration, screws) + _motion_cross(twist, u)
    by_angle = _force_cross(screws, wrench) + inertia.times(w) + gyroscopic(u)
    by_speed = 2.0 * inertia.times(u) + gyroscopic(screws)
    # B^T S, a moment only
    turned = 2.0 * (
        cross(momentum, screws[:, :3])
        + jnp.einsum("kba,kb->ka", matrix, screws[:, 3:])
    )
    dtype = screws.dtype
    ahead = jnp.asarray(np.triu(np.ones((len(screws), len(screws)))), dtype)
    behind = 1.0 - ahead

    def matrix_of(here, from_front_momenta, from_front_turned):
        # rows: joints whose torque changes; columns: joints that move
        upper = screws @ here.T
        lower = momenta @ from_front_momenta.T + turned @ from_front_turned.T
        return coupling.T @ (ahead * upper + behind * lower) @ coupling

    return LinearisedBodies(
        solution,
        mobility,
        matrix_of(by_angle, w, u[:, 3:]),
        matrix_of(by_speed, 2.0 * u, screws[:, 3:]),
    )


def _solve(mass, right):
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(mass), right)


def _with_rotors(mass, rotors):
    if rotors is None:
        return mass
    return mass + jnp.diag(jnp.pad(rotors, (0, len(mass) - len(rotors))))


@kernel
def _accelerations(robot, q, eta, qd, etad, force, rotors):
    mass, bias = multibody(robot, q, eta, qd, etad)
    return _solve(_with_rotors(mass, rotors), force - bias)


@eqx.filter_custom_jvp
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
    """
    return _accelerations(robot, q, eta, qd, etad, force, rotors)


@body_accelerations.def_jvp
def _body_accelerations_jvp(primals, tangents):
    robot, *state, force, rotors = primals
    robot_rate, *rates, force_rate, rotor_rate = tangents
    found = linearised_bodies(robot, *state, force, rotors)
    angle_rate, speed_rate = _joined(state[:2], rates[:2]), _joined(state[2:], rates[2:])
    missing: Any = jnp.zeros_like(force) if force_rate is None else force_rate
    if angle_rate is not None:
        missing = missing - found.stiffness @ angle_rate
    if speed_rate is not None:
        missing = missing - found.damping @ speed_rate
    n = robot.axes
    if rotor_rate is not None:
        missing = missing.at[:n].add(-rotor_rate * found.acceleration[:n])
    if jax.tree.leaves(robot_rate):
        a = found.acceleration[:n], found.acceleration[n:]
        forces = lambda r: forces_by_screws(r, *state, *a)
        missing = missing - moving_jvp(forces, (robot,), (robot_rate,))[1]
    return found.acceleration, found.mobility @ missing


def _joined(values, rates):
    """Tangents of two vectors as one, `None` if neither moves."""
    if all(rate is None for rate in rates):
        return None
    return jnp.concatenate(
        [jnp.zeros_like(x) if r is None else r for x, r in zip(values, rates)]
    )
