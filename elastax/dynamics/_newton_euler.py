r"""Newton-Euler equations of the whole chain: inverse dynamics, mass matrix and bias.

The mass matrix and the motion of the tool come from sums of screws.

Every joint is a screw $S_k = (p_k \times z_k,\; z_k)$ in the base frame, referred to
the base origin. In one common frame the recursions of (2.27) to (2.31) are plain sums
over the joints in front of a link or the bodies behind a joint,

$V_k = \sum_{i \le k} S_i \dot s_i$,
$A_k = \sum_{i \le k} (S_i \ddot s_i + V_i \times S_i \dot s_i) - (g, 0)$,
$\tau_k = S_k^T \sum_{b \ge k} F_b$,

on arrays and on `Series`. The inverse dynamics is the recursion of `_recursion`.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from .._taylor import Series, concatenate, cross, leading, product
from ..kinematics import JointKind, MovingFrames, moving_frames
from ._forces import applied_forces
from ._recursion import generalised_forces
from ._robot import ElasticRobot


def joint_screws(robot: ElasticRobot, frames: MovingFrames):
    """Screws of the joints, moment above axis, shape (joints, 6)."""
    dtype = leading(frames.axis).dtype
    rotary = np.array([kind is JointKind.REVOLUTE for kind in robot.chain.kinds])
    if rotary.all():
        moment = cross(frames.position, frames.axis)
        return concatenate([moment, frames.axis], axis=1)
    turning = product("ka,k->ka", frames.axis, jnp.asarray(rotary, dtype))
    sliding = product("ka,k->ka", frames.axis, jnp.asarray(~rotary, dtype))
    moment = cross(frames.position, turning) + sliding
    return concatenate([moment, turning], axis=1)


def chain_motion(robot: ElasticRobot, screws, sd, sdd):
    """Twist and spatial acceleration of every link, shape (joints, 6) each.

    The acceleration contains minus the gravity vector.
    """
    dtype = leading(screws).dtype
    sums = jnp.asarray(np.tri(robot.chain.number), dtype)
    moving = product("ka,k->ka", screws, sd)
    twist = product("jk,ka->ja", sums, moving)
    v, w = twist[:, :3], twist[:, 3:]
    dv, dw = moving[:, :3], moving[:, 3:]
    bracket = concatenate([cross(w, dv) + cross(v, dw), cross(w, dw)], axis=1)
    acceleration = product(
        "jk,ka->ja", sums, product("ka,k->ka", screws, sdd) + bracket
    )
    lift = jnp.concatenate([-robot.gravity, jnp.zeros((3,), dtype)])
    return twist, acceleration + jnp.tile(lift[None], (robot.chain.number, 1))


def _behind(robot: ElasticRobot, joint: tuple[int, ...]) -> np.ndarray:
    """Ones where a body (column) hangs behind a joint (row)."""
    joints = np.arange(robot.chain.number)
    return (np.array(joint, int)[None, :] >= joints[:, None]).astype(float)


def forces_by_screws(robot: ElasticRobot, q, eta, qd, etad, qdd, etadd):
    """`generalised_forces` in the terms of `multibody`, as a sum of screws.

    Equal to the recursion for every robot. Only for frames that are not orthogonal, as
    a difference quotient of a rotation's elements makes them, do the two differ; this
    one then still equals mass matrix times acceleration plus bias.
    """
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    screws = joint_screws(robot, frames)
    twist, acceleration = chain_motion(
        robot,
        screws,
        robot.joint_coordinates(qd, etad),
        robot.joint_coordinates(qdd, etadd),
    )
    bodies = robot.all_bodies()
    index = np.array(bodies.joint, int)
    rotation = frames.rotation[index]
    com = frames.position[index] + product("kab,kb->ka", rotation, bodies.com)
    v, w = twist[index, :3], twist[index, 3:]
    a, alpha = acceleration[index, :3], acceleration[index, 3:]

    a_com = a + cross(alpha, com) + cross(w, v + cross(w, com))
    force = product("ka,k->ka", a_com, bodies.mass)
    w_body = product("kab,ka->kb", rotation, w)
    alpha_body = product("kab,ka->kb", rotation, alpha)
    spin = product("kb,kab->ka", w_body, bodies.inertia)
    moment_body = product("kb,kab->ka", alpha_body, bodies.inertia) + cross(
        w_body, spin
    )
    moment = product("kab,kb->ka", rotation, moment_body) + cross(com, force)

    wrench = concatenate([force, moment], axis=1)
    behind = jnp.asarray(_behind(robot, bodies.joint), leading(screws).dtype)
    forces = product("ka,ka->k", screws, product("jk,ka->ja", behind, wrench))
    return product("jn,j->n", robot.coupling(), forces)


@kernel
def inverse_dynamics(
    robot: ElasticRobot,
    q: PerJoint | Series,
    qd: PerJoint | Series,
    qdd: PerJoint | Series,
    eta: PerElastic | Series | None = None,
    etad: PerElastic | Series | None = None,
    etadd: PerElastic | Series | None = None,
) -> tuple[Any, Any]:
    r"""Torques that the links need for a given motion, behind the gears.

    $\hat\tau_a = M_{aa}\ddot q + M_{ae}\ddot\eta + h_a$ with the gear's spring and
    damper left out of $h_a$ (motor angle equal to joint angle), and $\hat\tau_e$ alike
    for the elastic coordinates, which would have to act on the structure from outside:
    zero in free motion.

    Args:
        robot: the robot.
        q, qd, qdd: joint angles [rad], velocities, accelerations, shape (axes,).
        eta, etad, etadd: elastic coordinates and derivatives, shape (elastic,); zero
            unless given. All may be `Series` as well.

    Returns:
        Torques at the joints (axes,) [N m], positive where they drive the links, and at
        the elastic coordinates (elastic,).

    References:
        [Reiner2010] (2.31), (3.91) with the errata; for a rigid robot the textbook
        inverse dynamics with friction behind the gears and counterbalance.
    """
    zero = _zeros_like(q, robot.elastic)
    eta = zero if eta is None else eta
    etad = zero if etad is None else etad
    etadd = zero if etadd is None else etadd
    total = generalised_forces(robot, q, eta, qd, etad, qdd, etadd)
    joint, structure = applied_forces(robot, q, eta, qd, etad)
    n = robot.axes
    return total[:n] + joint, total[n:] + structure


def _zeros_like(q: Any, size: int) -> Any:
    if isinstance(q, Series):
        return Series(jnp.zeros((q.order + 1, size), leading(q).dtype))
    return jnp.zeros((size,), q.dtype)


@kernel
def multibody(
    robot: ElasticRobot, q: PerJoint, eta: PerElastic, qd: PerJoint, etad: PerElastic
) -> tuple[Float[Array, "coordinates coordinates"], Float[Array, " coordinates"]]:
    """Mass matrix and bias forces of the bodies, coordinates (q, eta).

    The mass matrix comes from composite bodies: the inertia of all bodies behind a
    joint about the base origin, moved by that joint's screw.

    Args:
        robot: the robot.
        q, qd: joint angles [rad] and velocities, shape (axes,).
        eta, etad: elastic coordinates and velocities, shape (elastic,).

    Returns:
        Mass matrix [kg m^2] and bias forces [N m] (gravity, Coriolis, centrifugal).
    """
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    screws = joint_screws(robot, frames)
    sd = robot.joint_coordinates(qd, etad)
    twist, acceleration = chain_motion(robot, screws, sd, jnp.zeros_like(sd))
    bodies = robot.all_bodies()
    index = np.array(bodies.joint, int)
    rotation = leading(frames.rotation)[index]
    com = leading(frames.position)[index] + jnp.einsum(
        "kab,kb->ka", rotation, bodies.com
    )
    tensor = jnp.einsum("kab,kbc,kdc->kad", rotation, bodies.inertia, rotation)
    v, w = twist[index, :3], twist[index, 3:]
    a, alpha = acceleration[index, :3], acceleration[index, 3:]

    a_com = a + cross(alpha, com) + cross(w, v + cross(w, com))
    force = a_com * bodies.mass[:, None]
    moment = (
        jnp.einsum("kab,kb->ka", tensor, alpha)
        + cross(w, jnp.einsum("kab,kb->ka", tensor, w))
        + cross(com, force)
    )
    behind = jnp.asarray(_behind(robot, bodies.joint), screws.dtype)
    wrench = behind @ jnp.concatenate([force, moment], axis=1)

    # composite mass, first moment and inertia about the base origin
    first = bodies.mass[:, None] * com
    square = jnp.einsum("ka,kb->kab", com, first)
    trace = jnp.einsum("kaa->k", square)
    about_origin = tensor + trace[:, None, None] * jnp.eye(3)[None] - square
    composite = behind @ jnp.concatenate(
        [bodies.mass[:, None], first, about_origin.reshape(-1, 9)], axis=1
    )
    m, h, inertia = composite[:, :1], composite[:, 1:4], composite[:, 4:]
    s_v, s_w = screws[:, :3], screws[:, 3:]
    momentum = jnp.concatenate(
        [
            m * s_v + cross(s_w, h),
            cross(h, s_v) + jnp.einsum("kab,kb->ka", inertia.reshape(-1, 3, 3), s_w),
        ],
        axis=1,
    )
    upper = jnp.triu(screws @ momentum.T)  # joint i in front of joint j
    full = upper + jnp.triu(upper, 1).T
    coupling = robot.coupling()
    bias = coupling.T @ jnp.einsum("ka,ka->k", screws, wrench)
    return coupling.T @ full @ coupling, bias
