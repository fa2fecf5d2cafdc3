r"""Recursive Newton-Euler equations of the chain, in the frames of its links.

Outwards the angular velocity $\omega$, its rate and the acceleration of the origin of
every link (minus gravity), inwards force and moment on it,

$\omega_k = E_k^T \omega_{k-1} + z_k \dot s_k$,
$\dot\omega_k = E_k^T \dot\omega_{k-1} + z_k \ddot s_k + (E_k^T \omega_{k-1}) \times z_k
\dot s_k$,
$a_k = E_k^T (a_{k-1} + \dot\omega_{k-1} \times p_k + \omega_{k-1} \times (\omega_{k-1}
\times p_k))$,

for turning joints, [Reiner2010] (2.27) and (2.31), with E_k and p_k the step from link
k-1 to link k; a sliding joint adds to the acceleration instead. A point r of a link has
the acceleration $a + W r$ with $W = \tilde{\dot\omega} + \tilde\omega\tilde\omega$,
one matrix for the next origin and for all mass of the link, which counts as one body:
its mass, first and second moment about the origin. It runs on arrays and on `Series`,
which gives the time derivatives of the torques along a motion. `multibody` holds the
same equations as sums of screws.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from .._taylor import LEVI_CIVITA, concatenate, cross, leading, product, skew
from ..kinematics import JointKind, joint_steps
from ._modal_links import link_forces
from ._robot import ElasticRobot


def _sum(*terms: Any) -> Any:
    """Sum of what is there; `None` stands for zero."""
    there = [term for term in terms if term is not None]
    return sum(there[1:], there[0]) if there else None


def _turned(step, x):
    """Components of x behind the step."""
    return None if x is None else product("ba,b->a", step, x)


def _crossed(a, b):
    return None if a is None or b is None else cross(a, b)


def _link_moments(robot: ElasticRobot):
    r"""Mass, first and second moment about the origin of every link with bodies.

    The second moment $\int r r^T dm = \tfrac12 tr(I) 1 - I$ of the inertia I.
    """
    bodies = robot.all_bodies()
    first = bodies.mass[:, None] * bodies.com
    half = 0.5 * jnp.einsum("kaa->k", bodies.inertia)
    about_com = half[:, None, None] * jnp.eye(3)[None] - bodies.inertia
    second = about_com + jnp.einsum("ka,kb->kab", bodies.com, first)
    links = {}
    for joint in sorted(set(bodies.joint)):
        here = np.flatnonzero(np.array(bodies.joint) == joint)
        links[joint] = tuple(
            jnp.sum(x[here], axis=0) for x in (bodies.mass, first, second)
        )
    return links


def _spreading(w, wd):
    """Matrix W by which the acceleration differs over a link, `None` for zero."""
    if w is None:
        return None
    square = product("a,b->ab", w, w)
    identity = jnp.eye(3, dtype=leading(w).dtype)
    total = product(",ab->ab", product("a,a->", w, w), identity)
    return skew(wd) + square - total


def _inertial(link, spreading, a):
    r"""Force and moment about the origin that move a link, [Reiner2010] (2.29).

    $\int (a + W r)\,dm$ and $\int r \times (a + W r)\,dm$.
    """
    mass, first, second = link
    force, moment = product(",a->a", mass, a), cross(first, a)
    if spreading is None:
        return force, moment
    turning = product("kl,lj->kj", spreading, second)
    tensor = jnp.asarray(LEVI_CIVITA, leading(a).dtype)
    return (
        force + product("ab,b->a", spreading, first),
        moment + product("ijk,kj->i", tensor, turning),
    )


def generalised_forces(robot: ElasticRobot, q, eta, qd, etad, qdd, etadd):
    """Forces that the motion of the bodies in gravity asks for, of arrays or series.

    Args:
        robot: the robot; springs, friction and drive trains play no part.
        q, qd, qdd: joint angles and their derivatives, shape (axes,).
        eta, etad, etadd: elastic coordinates and theirs, shape (elastic,).

    Returns:
        Generalised forces of the coordinates (q, eta), shape (axes + elastic,).

    References:
        [Reiner2010] (2.27), (2.29), (2.31); in (2.31) the acceleration of the centre of
        mass is the absolute one, not the component derivative of the velocity.
    """
    coordinates = robot.joint_coordinates
    step, offset, axis = joint_steps(robot.chain, coordinates(q, eta))
    sd, sdd = coordinates(qd, etad), coordinates(qdd, etadd)
    links = _link_moments(robot)
    rotary = [kind is JointKind.REVOLUTE for kind in robot.chain.kinds]

    w, wd, a, spreading = None, None, -robot.gravity, None
    separate = any(link.body.detail.separates_gravity for link in robot.modal_links)
    weight = robot.gravity if separate else None
    wrenches: list[Any] = []
    modal: list[Any] = []
    for k in range(robot.chain.number):
        lever = None
        if spreading is not None:
            lever = product("ab,b->a", spreading, offset[k])
        a = _turned(step[k], _sum(a, lever))
        weight = _turned(step[k], weight)
        w, wd = _turned(step[k], w), _turned(step[k], wd)
        speed = product(",a->a", sd[k], axis[k])
        rate = _sum(product(",a->a", sdd[k], axis[k]), _crossed(w, speed))
        if rotary[k]:
            w, wd = _sum(w, speed), _sum(wd, rate)
        else:
            a = _sum(a, rate, _crossed(w, speed))
        spreading = _spreading(w, wd)
        link = links.get(k)
        wrenches.append((None, None) if link is None else _inertial(link, spreading, a))
        for flexible in robot.modal_links:
            if flexible.joint != k:
                continue
            turn, rate = (jnp.zeros((3,)) if x is None else x for x in (w, wd))
            acting = link_forces(flexible, a, turn, rate, (eta, etad, etadd), weight)
            wrenches[k] = (
                _sum(wrenches[k][0], acting.force),
                _sum(wrenches[k][1], acting.moment),
            )
            place = flexible.rows(robot.axes, robot.elastic, robot.gravity.dtype)
            modal.append(product("kn,k->n", place, acting.modal))

    forces: list[Any] = []
    force = moment = None
    for k in reversed(range(robot.chain.number)):
        force = _sum(force, wrenches[k][0])
        moment = _sum(moment, wrenches[k][1])
        acting = moment if rotary[k] else force
        if acting is None:  # no body behind this joint
            acting = product(",a->a", sdd[k], jnp.zeros_like(axis[k]))
        forces.append(product("a,a->", axis[k], acting)[None])
        if force is not None:
            force = product("ab,b->a", step[k], force)
            moment = product("ab,b->a", step[k], moment)
            moment = moment + cross(offset[k], force)
    joints = product("jn,j->n", robot.coupling(), concatenate(forces[::-1]))
    return _sum(joints, *modal)
