"""Rigid bodies attached to the links of a chain."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import Transform, as_real


class RigidBodies(eqx.Module):
    """Masses, centres of mass and inertia tensors of rigid bodies.

    Attributes:
        mass: [kg], shape (bodies,).
        com: centres of mass in the frame behind the joint's motion [m], (bodies, 3).
        inertia: about the centre of mass, in the axes of that frame [kg m^2],
            (bodies, 3, 3).
        joint: index of the joint that carries each body.
        names: for messages.
    """

    mass: Float[Array, " bodies"] = eqx.field(converter=as_real)
    com: Float[Array, "bodies 3"] = eqx.field(converter=as_real)
    inertia: Float[Array, "bodies 3 3"] = eqx.field(converter=as_real)
    joint: tuple[int, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        if len(self.joint) != self.mass.shape[0]:
            raise ValueError(
                "`joint` must name the carrying joint of every body: there are "
                f"{self.mass.shape[0]} bodies, but {len(self.joint)} joints"
            )
        check_values("`mass` must not be negative [kg]", self.mass, self.mass >= 0)
        if is_concrete(self.mass, self.inertia):
            _check_inertia(self)

    @property
    def number(self) -> int:
        """Number of bodies."""
        return len(self.joint)

    def joined(self, other: "RigidBodies") -> "RigidBodies":
        """These bodies and those of `other`."""
        return RigidBodies(
            jnp.concatenate([self.mass, other.mass]),
            jnp.concatenate([self.com, other.com]),
            jnp.concatenate([self.inertia, other.inertia]),
            self.joint + other.joint,
            self.names + other.names,
        )

    def moved(self, pose: Transform) -> "RigidBodies":
        """Bodies given in a frame that has `pose` in the frame of their link."""
        frame, com, inertia = _at_hand(pose, self.com, self.inertia)
        rotation, position = frame[:3, :3], frame[:3, 3]
        einsum = np.einsum if is_concrete(frame, com, inertia) else jnp.einsum
        return RigidBodies(
            self.mass,
            einsum("ab,kb->ka", rotation, com) + position[None],
            einsum("ab,kbc,dc->kad", rotation, inertia, rotation),
            self.joint,
            self.names,
        )

    def attached(self, placement) -> "RigidBodies":
        """Bodies on the links of another chain.

        Args:
            placement: for each joint of the old chain, the joint of the new one that
                carries it now and the pose of the old link's frame in the new one's.
                Bodies whose joint is carried by none (-1) rest on the ground and go.
        """
        joints, poses = placement
        keep = [k for k, joint in enumerate(self.joint) if joints[joint] >= 0]
        index = np.array(keep, int)
        mass, com, inertia, poses = _at_hand(self.mass, self.com, self.inertia, poses)
        pose = poses[np.array([self.joint[k] for k in keep], int)]
        rotation, position = pose[:, :3, :3], pose[:, :3, 3]
        einsum = np.einsum if is_concrete(pose, com, inertia) else jnp.einsum
        return RigidBodies(
            mass[index],
            einsum("kab,kb->ka", rotation, com[index]) + position,
            einsum("kab,kbc,kdc->kad", rotation, inertia[index], rotation),
            tuple(joints[self.joint[k]] for k in keep),
            tuple(self.names[k] for k in keep),
        )


def _at_hand(*arrays):
    """Arrays of NumPy where the numbers are there: JAX takes 20 ms an operation."""
    return (np.asarray(x) if is_concrete(x) else x for x in arrays)


def no_bodies() -> RigidBodies:
    """No body at all."""
    zero = np.zeros
    return RigidBodies(zero((0,)), zero((0, 3)), zero((0, 3, 3)), (), ())


def _check_inertia(bodies: RigidBodies) -> None:
    with jax.ensure_compile_time_eval():
        mass, tensor = np.asarray(bodies.mass), np.asarray(bodies.inertia)
    for name, m, inertia in zip(bodies.names, mass, tensor):
        if m == 0 and not inertia.any():
            continue
        if not np.allclose(inertia, inertia.T, rtol=0, atol=1e-9 * abs(inertia).max()):
            raise ValueError(
                f"the inertia of `{name}` must be symmetric, but is {inertia}"
            )
        moments = np.linalg.eigvalsh(inertia)
        if m > 0 and name == "payload" and not inertia.any():
            raise ValueError(
                f"`payload` has a mass of {m:g} kg but no inertia: give its inertia "
                "tensor about the centre of mass [kg m^2]"
            )
        if moments[0] < -1e-9 * max(moments[-1], 1e-12):
            raise ValueError(
                f"the inertia of `{name}` must not have negative principal moments, "
                f"but has {moments} kg m^2"
            )
