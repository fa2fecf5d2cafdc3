r"""Flexible bodies among the links of a robot.

The reference frame R of a modal body is the frame behind the motion of its joint; its
modal coordinates are some of the robot's elastic coordinates. What is attached to one
of its nodes follows by joints of the chain, which take the node's displacement and
rotation as their coordinates.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._taylor import concatenate, cross, product
from ..structure import ModalBody, inertial_forces
from ._bodies import RigidBodies, no_bodies


class ModalLink(eqx.Module):
    """A flexible body on a joint of the chain.

    Attributes:
        body: in eigenmodes, or in other modes with diagonal stiffness and damping.
        joint: index of the joint that carries its reference frame.
        first: index of its first modal coordinate among the elastic ones.
    """

    body: ModalBody
    joint: int = eqx.field(static=True)
    first: int = eqx.field(static=True)

    def of(self, eta: Any) -> Any:
        """The modal coordinates of this body among the elastic ones."""
        return eta[self.first : self.first + self.body.modes]

    def rows(self, axes: int, elastic: int, dtype) -> Float[Array, "modes coordinates"]:
        """Ones where a coordinate (q, eta) of the robot is one of the body."""
        number = axes + elastic
        rows = np.eye(number)[axes + self.first :][: self.body.modes]
        return jnp.asarray(rows, dtype)


def undeformed_bodies(links: tuple[ModalLink, ...]) -> RigidBodies:
    """The bodies with their modes held at zero."""
    bodies = no_bodies()
    for link in links:
        body = link.body
        com = body.first_moment / body.mass
        square = jnp.sum(com**2) * jnp.eye(3, dtype=com.dtype) - jnp.outer(com, com)
        bodies = bodies.joined(
            RigidBodies(
                body.mass[None],
                com[None],
                (body.J_0 - body.mass * square)[None],
                (link.joint,),
                (body.name,),
            )
        )
    return bodies


def link_forces(link: ModalLink, a, omega, domega, coordinates, gravity):
    """Forces of `inertial_forces` in the frame of the link, of arrays or series.

    Args:
        link: the flexible body.
        a: acceleration of the link's origin minus gravity, in the axes of the link.
        omega, domega: angular velocity and its rate.
        coordinates: elastic coordinates of the robot and their two derivatives.
        gravity: gravity vector in the axes of the link, or `None` if not needed.
    """
    eta, etad, etadd = (link.of(x) for x in coordinates)
    return inertial_forces(link.body, a, omega, domega, eta, etad, etadd, gravity)


class BaseForces(NamedTuple):
    """What moves the flexible bodies, in the base frame.

    Attributes:
        wrench: forces and moments about the base origin, shape (links, 6).
        modal: of all coordinates (q, eta), shape (coordinates,).
    """

    wrench: Any
    modal: Any


def base_forces(robot, frames, twist, acceleration, eta, etad, etadd) -> BaseForces:
    """Forces that move the flexible bodies, of arrays or series.

    Args:
        robot: the robot.
        frames: of its joints, after their motion.
        twist, acceleration: of all links, with minus gravity, shape (joints, 6).
        eta, etad, etadd: elastic coordinates and their derivatives.
    """
    rows, total = [], None
    for link in robot.modal_links:
        k = link.joint
        R, p = frames.rotation[k], frames.position[k]
        into = lambda x, R=R: product("ab,a->b", R, x)
        out = lambda x, R=R: product("ab,b->a", R, x)
        v, w = twist[k, :3], twist[k, 3:]
        spatial, alpha = acceleration[k, :3], acceleration[k, 3:]
        a = spatial + cross(alpha, p) + cross(w, v + cross(w, p))
        gravity = None
        if link.body.detail.separates_gravity:
            gravity = into(robot.gravity)
        forces = link_forces(
            link, into(a), into(w), into(alpha), (eta, etad, etadd), gravity
        )
        force = out(forces.force)
        moment = out(forces.moment) + cross(p, force)
        rows.append(concatenate([force, moment])[None])
        place = link.rows(robot.axes, robot.elastic, robot.gravity.dtype)
        modal = product("kn,k->n", place, forces.modal)
        total = modal if total is None else total + modal
    return BaseForces(concatenate(rows), total)


def base_moments(robot, frames, eta):
    """Mass, first moment and inertia of the deformed bodies about the base origin.

    Returns:
        Shape (links, 13): mass, first moment, inertia by rows.
    """
    rows = []
    for link in robot.modal_links:
        body, k = link.body, link.joint
        R, p = frames.rotation[k], frames.position[k]
        local = R @ body.first_moment_at(link.of(eta))
        inertia = R @ body.inertia_at(link.of(eta)) @ R.T
        first = body.mass * p + local
        # about another origin: p x (v x p) of the mass and both mixed terms
        outer = jnp.outer(p, local) + jnp.outer(local, p) + body.mass * jnp.outer(p, p)
        trace = 2.0 * jnp.sum(p * local) + body.mass * jnp.sum(p * p)
        inertia = inertia + trace * jnp.eye(3, dtype=p.dtype) - outer
        rows.append(jnp.concatenate([body.mass[None], first, inertia.reshape(-1)]))
    return jnp.stack(rows)


def modal_mass(robot, frames, screws, eta):
    """What the modes add to the mass matrix of (q, eta): coupling and modal mass."""
    total: Any = 0.0
    coupling = robot.coupling()
    for link in robot.modal_links:
        body, k = link.body, link.joint
        place = link.rows(robot.axes, robot.elastic, robot.gravity.dtype)
        total = total + place.T @ body.M_e @ place
        if body.detail.coupling is None:
            continue
        R, p = frames.rotation[k], frames.position[k]
        C_t, C_r = body.coupling_at(link.of(eta), body.detail.coupling)
        force = C_t @ R.T
        moment = C_r @ R.T + cross(jnp.tile(p[None], (body.modes, 1)), force)
        momentum = jnp.concatenate([force, moment], axis=1)
        # only joints up to the one that carries the body move it
        moved = screws[: k + 1] @ momentum.T
        mixed = coupling[: k + 1].T @ moved @ place
        total = total + mixed + mixed.T
    return total


def modal_energy(robot, rotation, position, turning, velocity, eta, etad):
    r"""Kinetic energy of the flexible bodies, $\tfrac12 z^T M(\eta) z$ [J].

    Args:
        robot: the robot.
        rotation, position: of the frames of all links.
        turning, velocity: their time derivatives.
        eta, etad: elastic coordinates and velocities.
    """
    total = jnp.zeros((), robot.gravity.dtype)
    for link in robot.modal_links:
        k = link.joint
        spin = rotation[k].T @ turning[k]
        omega = jnp.stack([spin[2, 1], spin[0, 2], spin[1, 0]])
        z = jnp.concatenate([rotation[k].T @ velocity[k], omega, link.of(etad)])
        total = total + 0.5 * z @ link.body.mass_matrix(link.of(eta)) @ z
    return total


def modal_weight(robot, rotation, position, eta):
    """Potential energy of the flexible bodies in gravity [J]."""
    total = jnp.zeros((), robot.gravity.dtype)
    for link in robot.modal_links:
        k = link.joint
        first = rotation[k] @ link.body.first_moment_at(link.of(eta))
        first = first + link.body.mass * position[k]
        total = total - jnp.sum(robot.gravity * first)
    return total
