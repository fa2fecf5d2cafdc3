r"""Recursive Newton-Euler equations of the chain, in the frames of its links.

Outwards the angular velocity $\omega$, its rate and the acceleration of the origin of
every link (minus gravity), inwards force and moment on it,

$\omega_k = E_k^T \omega_{k-1} + z_k \dot s_k$,
$\dot\omega_k = E_k^T \dot\omega_{k-1} + z_k \ddot s_k + (E_k^T \omega_{k-1}) \times z_k
\dot s_k$,
$a_k = E_k^T (a_{k-1} + \dot\omega_{k-1} \times p_k + \omega_{k-1} \times (\omega_{k-1}
\times p_k))$,

for turning joints, [Reiner2010] (2.27) and (2.31), with E_k and p_k the step from link
k-1 to link k; a sliding joint adds to the acceleration instead. The bodies of a link
count as one: its mass, first moment and inertia about the origin. It runs on arrays and
on `Series`, which gives the time derivatives of the torques along a motion.
`multibody` holds the same equations as sums of screws.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from .._taylor import concatenate, cross, product
from ..kinematics import JointKind, joint_steps
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


def _link_inertia(robot: ElasticRobot):
    """Mass, first moment and inertia about the origin of every link with bodies."""
    bodies = robot.all_bodies()
    first = bodies.mass[:, None] * bodies.com
    square = jnp.einsum("ka,kb->kab", bodies.com, first)
    trace = jnp.einsum("kaa->k", square)
    about = bodies.inertia + trace[:, None, None] * jnp.eye(3)[None] - square
    links = {}
    for joint in sorted(set(bodies.joint)):
        here = np.flatnonzero(np.array(bodies.joint) == joint)
        links[joint] = tuple(
            jnp.sum(x[here], axis=0) for x in (bodies.mass, first, about)
        )
    return links


def _inertial(link, w, wd, a):
    """Force and moment about the origin that move a link, [Reiner2010] (2.29)."""
    mass, first, inertia = link
    force = _sum(
        product(",a->a", mass, a),
        _crossed(wd, first),
        _crossed(w, _crossed(w, first)),
    )
    spin = None if w is None else product("ab,b->a", inertia, w)
    turning = None if wd is None else product("ab,b->a", inertia, wd)
    return force, _sum(turning, _crossed(w, spin), cross(first, a))


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
    links = _link_inertia(robot)
    rotary = [kind is JointKind.REVOLUTE for kind in robot.chain.kinds]

    w, wd, a = None, None, -robot.gravity
    wrenches: list[Any] = []
    for k in range(robot.chain.number):
        lever = _sum(_crossed(wd, offset[k]), _crossed(w, _crossed(w, offset[k])))
        a = _turned(step[k], _sum(a, lever))
        w, wd = _turned(step[k], w), _turned(step[k], wd)
        speed = product(",a->a", sd[k], axis[k])
        rate = _sum(product(",a->a", sdd[k], axis[k]), _crossed(w, speed))
        if rotary[k]:
            w, wd = _sum(w, speed), _sum(wd, rate)
        else:
            a = _sum(a, rate, _crossed(w, speed))
        wrenches.append(_inertial(links[k], w, wd, a) if k in links else (None, None))

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
    return product("jn,j->n", robot.coupling(), concatenate(forces[::-1]))
