"""Joint conventions: how the parameters of a joint place its axis and its link."""

import abc
import enum

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import as_real
from ._se3 import rotation_from_rpy, rotation_x, rotation_z, transform


class JointKind(enum.Enum):
    """What a joint does along or about its axis."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"


class JointFrames(eqx.Module):
    """Placement of joints, whatever convention it came from.

    Link i follows link i - 1 by before[i] · motion(axis[i], q[i]) · after[i].

    Attributes:
        before: shape (joints, 4, 4), constant transform in front of each motion [m].
        axis: shape (joints, 3), unit vectors in the frame behind `before`.
        after: shape (joints, 4, 4), constant transform behind each motion [m].
    """

    before: Float[Array, "joints 4 4"]
    axis: Float[Array, "joints 3"]
    after: Float[Array, "joints 4 4"]


class AbstractJoints(eqx.Module):
    """Parameters of the joints of a serial chain."""

    @abc.abstractmethod
    def frames(self) -> JointFrames:
        """Axes and constant transforms that the parameters describe."""

    @abc.abstractmethod
    def number(self) -> int:
        """Number of joints."""


class FrameJoints(AbstractJoints):
    """Joints given by the frame that each has in its predecessor.

    Attributes:
        rotation: shape (joints, 3, 3), orientation of each joint frame.
        position: shape (joints, 3), its origin [m].
        axis: shape (joints, 3), unit axis in the joint frame.
    """

    rotation: Float[Array, "joints 3 3"] = eqx.field(converter=as_real)
    position: Float[Array, "joints 3"] = eqx.field(converter=as_real)
    axis: Float[Array, "joints 3"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        _check_axes(self.axis)
        if is_concrete(self.rotation):
            rotation = np.asarray(self.rotation)
            square = np.swapaxes(rotation, -1, -2) @ rotation
            check_values(
                "`rotation` must hold orthogonal matrices",
                rotation,
                np.abs(square - np.eye(3)) < 1e-6,
            )

    def frames(self) -> JointFrames:
        before = transform(self.rotation, self.position)
        return JointFrames(before, self.axis, _identities(self.number(), before.dtype))

    def number(self) -> int:
        return self.axis.shape[0]


class RPYJoints(AbstractJoints):
    """Joints given by position and roll-pitch-yaw angles, as in a URDF.

    Attributes:
        position: shape (joints, 3) [m].
        rpy: shape (joints, 3), angles about x, y, z [rad].
        axis: shape (joints, 3), unit axis in the joint frame.

    References:
        [KinModell] (3-11).
    """

    position: Float[Array, "joints 3"] = eqx.field(converter=as_real)
    rpy: Float[Array, "joints 3"] = eqx.field(converter=as_real)
    axis: Float[Array, "joints 3"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        _check_axes(self.axis)

    def frames(self) -> JointFrames:
        before = transform(jax.vmap(rotation_from_rpy)(self.rpy), self.position)
        return JointFrames(before, self.axis, _identities(self.number(), before.dtype))

    def number(self) -> int:
        return self.axis.shape[0]


class DHJoints(AbstractJoints):
    r"""Standard (distal) Denavit-Hartenberg joints.

    $A_i = R_z(\theta_i)\,T_z(d_i)\,T_x(a_i)\,R_x(\alpha_i)$; the joint variable adds to
    $\theta_i$ (revolute) or $d_i$ (prismatic).

    Attributes:
        theta: shape (joints,), offset angles about z [rad].
        d: shape (joints,), offsets along z [m].
        a: shape (joints,), lengths along x [m].
        alpha: shape (joints,), twists about x [rad].

    References:
        [KinModell] table 3-2.
    """

    theta: Float[Array, " joints"] = eqx.field(converter=as_real)
    d: Float[Array, " joints"] = eqx.field(converter=as_real)
    a: Float[Array, " joints"] = eqx.field(converter=as_real)
    alpha: Float[Array, " joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)

    def frames(self) -> JointFrames:
        zero = jnp.zeros_like(self.d)
        before = transform(
            jax.vmap(rotation_z)(self.theta), jnp.zeros((*zero.shape, 3), zero.dtype)
        )
        after = transform(
            jax.vmap(rotation_x)(self.alpha),
            jnp.stack([self.a, zero, self.d], axis=-1),
        )
        axis = jnp.broadcast_to(
            jnp.array([0.0, 0.0, 1.0], zero.dtype), (*zero.shape, 3)
        )
        return JointFrames(before, axis, after)

    def number(self) -> int:
        return self.d.shape[0]


def _identities(number: int, dtype) -> Float[Array, "joints 4 4"]:
    return jax.device_put(np.tile(np.eye(4, dtype=dtype), (number, 1, 1)))


def _check_axes(axis) -> None:
    if is_concrete(axis):
        norm = np.linalg.norm(np.asarray(axis), axis=-1)
        check_values("`axis` must hold unit vectors", axis, np.abs(norm - 1) < 1e-6)
