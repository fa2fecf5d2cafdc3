"""What a measuring system reads at a pose of an arm, and how precisely."""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Transform, as_real
from ._chain import SerialChain, forward_kinematics
from ._exponential import rotation_from_vector
from ._se3 import rotation_error, transform


Channels = Float[Array, " channels"]


class AbstractInstrument(eqx.Module):
    """A measuring system: what it reads at one pose, and with which deviations."""

    @abc.abstractmethod
    def shape(self) -> tuple[int, ...]:
        """Shape of one reading."""

    @abc.abstractmethod
    def predict(self, chain: SerialChain, q: PerJoint) -> Float[Array, "..."]:
        """Reading without noise."""

    @abc.abstractmethod
    def residual(
        self, chain: SerialChain, q: PerJoint, reading: Float[Array, "..."]
    ) -> Channels:
        """Reading minus prediction, each channel over its standard deviation [-]."""

    @abc.abstractmethod
    def disturbed(
        self, reading: Float[Array, "..."], noise: Channels
    ) -> Float[Array, "..."]:
        """Reading with errors of `noise` standard deviations, for simulations."""


class PoseInstrument(AbstractInstrument):
    """Reads the tool's position and orientation, like a tracker with a 6D probe.

    Attributes:
        position: standard deviations along x, y, z of the base frame [m].
        rotation: about these axes [rad]; one number stands for all three.
    """

    position: Float[Array, "3"] = eqx.field(converter=lambda x: _three(x))
    rotation: Float[Array, "3"] = eqx.field(converter=lambda x: _three(x))

    def __check_init__(self):
        check_fields(self)
        _check_positive("position", self.position)
        _check_positive("rotation", self.rotation)

    def shape(self) -> tuple[int, ...]:
        return (4, 4)

    def predict(self, chain: SerialChain, q: PerJoint) -> Transform:
        return forward_kinematics(chain, q)

    def residual(
        self, chain: SerialChain, q: PerJoint, reading: Transform
    ) -> Float[Array, "6"]:
        pose = forward_kinematics(chain, q)
        shift = (reading[:3, 3] - pose[:3, 3]) / self.position
        turn = rotation_error(reading[:3, :3], pose[:3, :3]) / self.rotation
        return jnp.concatenate([shift, turn])

    def disturbed(self, reading: Transform, noise: Float[Array, "6"]) -> Transform:
        turn = rotation_from_vector(noise[3:] * self.rotation)
        shift = reading[:3, 3] + noise[:3] * self.position
        return transform(turn @ reading[:3, :3], shift)


class PointInstrument(AbstractInstrument):
    """Reads the positions of points on the tool, like a tracker with reflectors.

    Attributes:
        deviation: standard deviations [m]: one number, one per axis of the base frame
            or shape (points, 3).
        points: in the tool frame [m], shape (points, 3); the origin unless given.
    """

    deviation: Float[Array, "..."] = eqx.field(converter=as_real)
    points: Float[Array, "points 3"] = eqx.field(
        converter=as_real, default_factory=lambda: np.zeros((1, 3))
    )

    def __check_init__(self):
        check_fields(self)
        _check_broadcast("deviation", self.deviation, self.points.shape)
        _check_positive("deviation", self.deviation)

    def shape(self) -> tuple[int, ...]:
        return tuple(self.points.shape)

    def predict(self, chain: SerialChain, q: PerJoint) -> Float[Array, "points 3"]:
        pose = forward_kinematics(chain, q)
        return self.points @ pose[:3, :3].T + pose[None, :3, 3]

    def residual(
        self, chain: SerialChain, q: PerJoint, reading: Float[Array, "points 3"]
    ) -> Channels:
        error = reading - self.predict(chain, q)
        return (error / jnp.broadcast_to(self.deviation, error.shape)).reshape(-1)

    def disturbed(
        self, reading: Float[Array, "points 3"], noise: Channels
    ) -> Float[Array, "points 3"]:
        deviation = jnp.broadcast_to(self.deviation, reading.shape)
        return reading + noise.reshape(reading.shape) * deviation


class DistanceInstrument(AbstractInstrument):
    """Reads distances from fixed points to a point on the tool: ball bar, wires, laser.

    Attributes:
        deviation: standard deviations [m]: one number or shape (anchors,).
        anchors: fixed points in the base frame [m], shape (anchors, 3).
        point: in the tool frame [m], shape (3,); the origin unless given.
    """

    deviation: Float[Array, "..."] = eqx.field(converter=as_real)
    anchors: Float[Array, "anchors 3"] = eqx.field(converter=as_real)
    point: Float[Array, "3"] = eqx.field(
        converter=as_real, default_factory=lambda: np.zeros(3)
    )

    def __check_init__(self):
        check_fields(self)
        _check_broadcast("deviation", self.deviation, self.anchors.shape[:1])
        _check_positive("deviation", self.deviation)

    def shape(self) -> tuple[int, ...]:
        return tuple(self.anchors.shape[:1])

    def predict(self, chain: SerialChain, q: PerJoint) -> Float[Array, " anchors"]:
        pose = forward_kinematics(chain, q)
        tip = pose[:3, :3] @ self.point + pose[:3, 3]
        square = jnp.sum((tip[None] - self.anchors) ** 2, axis=-1)
        # a safe operand at an anchor itself, where the distance has no slope
        away = square > 0
        return jnp.where(away, jnp.sqrt(jnp.where(away, square, 1.0)), 0.0)

    def residual(
        self, chain: SerialChain, q: PerJoint, reading: Float[Array, " anchors"]
    ) -> Channels:
        error = reading - self.predict(chain, q)
        return error / jnp.broadcast_to(self.deviation, error.shape)

    def disturbed(
        self, reading: Float[Array, " anchors"], noise: Channels
    ) -> Float[Array, " anchors"]:
        return reading + noise * jnp.broadcast_to(self.deviation, reading.shape)


def _three(value) -> Float[Array, "3"]:
    value = as_real(value)
    return jnp.broadcast_to(value, (3,)) if value.ndim == 0 else value


def _check_positive(name: str, value) -> None:
    check_values(f"`{name}` must be positive", value, value > 0)


def _check_broadcast(name: str, value, shape: tuple[int, ...]) -> None:
    try:
        fits = np.broadcast_shapes(value.shape, shape) == tuple(shape)
    except ValueError:
        fits = False
    if not fits:
        raise ValueError(
            f"`{name}` must be one number or have the shape {tuple(shape)}, but has "
            f"{value.shape}"
        )
