r"""Newton-Euler equations as sums of screws: mass matrix, bias, motion of the links.

Every joint is a screw $S_k = (p_k \times z_k,\; z_k)$ in the base frame, referred to
the base origin. In one common frame the recursions of (2.27) to (2.31) are plain sums
over the joints in front of a link or the bodies behind a joint,

$V_k = \sum_{i \le k} S_i \dot s_i$,
$A_k = \sum_{i \le k} (S_i \ddot s_i + V_i \times S_i \dot s_i) - (g, 0)$,
$\tau_k = S_k^T \sum_{b \ge k} F_b$,

on arrays and on `Series`. The inverse dynamics is the recursion of `_recursion`.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from .._taylor import concatenate, cross, leading, product
from ..kinematics import JointKind, MovingFrames, moving_frames
from ._modal_links import base_forces, base_moments, modal_mass
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


def _carriers(robot: ElasticRobot) -> tuple[int, ...]:
    """Joints of the rigid bodies and of the flexible ones."""
    flexible = tuple(link.joint for link in robot.modal_links)
    return robot.all_bodies().joint + flexible


@kernel
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
    modal = None
    if robot.modal_links:
        flexible = base_forces(robot, frames, twist, acceleration, eta, etad, etadd)
        wrench = concatenate([wrench, flexible.wrench])
        modal = flexible.modal
    behind = jnp.asarray(_behind(robot, _carriers(robot)), leading(screws).dtype)
    forces = product("ka,ka->k", screws, product("jk,ka->ja", behind, wrench))
    joints = product("jn,j->n", robot.coupling(), forces)
    return joints if modal is None else joints + modal


class BodyTerms(NamedTuple):
    """Bodies in the base frame, all leading axes (bodies,).

    Attributes:
        mass: [kg].
        com: centres of mass [m], (bodies, 3).
        tensor: inertia about the centre of mass [kg m^2], (bodies, 3, 3).
        twist: of the carrying link, velocity at the base origin above rotation.
        velocity: of the centre of mass [m/s], (bodies, 3).
    """

    mass: Any
    com: Any
    tensor: Any
    twist: Any
    velocity: Any


def body_terms(robot: ElasticRobot, frames: MovingFrames, twist) -> BodyTerms:
    """Bodies at one state of the robot."""
    bodies = robot.all_bodies()
    index = np.array(bodies.joint, int)
    rotation = leading(frames.rotation)[index]
    com = leading(frames.position)[index] + jnp.einsum(
        "kab,kb->ka", rotation, bodies.com
    )
    tensor = jnp.einsum("kab,kbc,kdc->kad", rotation, bodies.inertia, rotation)
    v, w = twist[index, :3], twist[index, 3:]
    return BodyTerms(bodies.mass, com, tensor, twist[index], v + cross(w, com))


def wrenches(robot: ElasticRobot, terms: BodyTerms, acceleration):
    """Force and moment about the base origin that move each body, (bodies, 6).

    References:
        [Reiner2010] (2.29).
    """
    index = np.array(robot.all_bodies().joint, int)
    a, alpha = acceleration[index, :3], acceleration[index, 3:]
    w = terms.twist[:, 3:]
    a_com = a + cross(alpha, terms.com) + cross(w, terms.velocity)
    force = a_com * terms.mass[:, None]
    moment = (
        jnp.einsum("kab,kb->ka", terms.tensor, alpha)
        + cross(w, jnp.einsum("kab,kb->ka", terms.tensor, w))
        + cross(terms.com, force)
    )
    return jnp.concatenate([force, moment], axis=1)


def sum_behind(robot: ElasticRobot, values):
    """Sums of the bodies' values over the bodies behind every joint, (joints, ...).

    The flexible bodies follow the rigid ones where there are values of them.
    """
    # outer bodies first, so that the sums have common beginnings
    carriers = _carriers(robot)[: values.shape[0]]
    order = np.argsort(carriers, kind="stable")[::-1]
    joints = tuple(carriers[k] for k in order)
    behind = jnp.asarray(_behind(robot, joints), values.dtype)
    return behind @ values[order]


class Composites(NamedTuple):
    """All bodies behind each joint as one, about the base origin, (joints, ...).

    Attributes:
        mass: [kg], (joints, 1).
        first: first moments of mass [kg m], (joints, 3).
        inertia: about the base origin [kg m^2], (joints, 3, 3).
    """

    mass: Any
    first: Any
    inertia: Any

    def times(self, screws):
        """Momenta of the composite bodies that move by `screws`, (joints, 6)."""
        v, w = screws[:, :3], screws[:, 3:]
        return jnp.concatenate(
            [
                self.mass * v + cross(w, self.first),
                cross(self.first, v) + jnp.einsum("kab,kb->ka", self.inertia, w),
            ],
            axis=1,
        )


def about_origin(terms: BodyTerms):
    """First moments and inertia of the bodies about the base origin."""
    first = terms.mass[:, None] * terms.com
    square = jnp.einsum("ka,kb->kab", terms.com, first)
    trace = jnp.einsum("kaa->k", square)
    identity = jnp.eye(3, dtype=first.dtype)[None]
    return first, terms.tensor + trace[:, None, None] * identity - square


def composites(
    robot: ElasticRobot, terms: BodyTerms, frames: MovingFrames, eta: PerElastic
) -> Composites:
    """Bodies behind each joint as one."""
    first, inertia = about_origin(terms)
    rows = jnp.concatenate([terms.mass[:, None], first, inertia.reshape(-1, 9)], axis=1)
    if robot.modal_links:
        rows = jnp.concatenate([rows, base_moments(robot, frames, eta)])
    total = sum_behind(robot, rows)
    return Composites(total[:, :1], total[:, 1:4], total[:, 4:].reshape(-1, 3, 3))


def mass_matrix(robot: ElasticRobot, screws, momenta):
    """Mass matrix of the coordinates from screws and the momenta of composites."""
    upper = jnp.triu(screws @ momenta.T)  # joint i in front of joint j
    full = upper + jnp.triu(upper, 1).T
    coupling = robot.coupling()
    return coupling.T @ full @ coupling


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
    terms = body_terms(robot, frames, twist)
    wrench = wrenches(robot, terms, acceleration)
    momenta = composites(robot, terms, frames, eta).times(screws)
    mass = mass_matrix(robot, screws, momenta)
    if not robot.modal_links:
        wrench = sum_behind(robot, wrench)
        return mass, robot.coupling().T @ jnp.einsum("ka,ka->k", screws, wrench)
    still = jnp.zeros_like(etad)
    flexible = base_forces(robot, frames, twist, acceleration, eta, etad, still)
    wrench = sum_behind(robot, jnp.concatenate([wrench, flexible.wrench]))
    bias = robot.coupling().T @ jnp.einsum("ka,ka->k", screws, wrench)
    return mass + modal_mass(robot, frames, screws, eta), bias + flexible.modal
