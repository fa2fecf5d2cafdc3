"""What a measuring system reads at the poses of an arm, and how precisely."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, Transform, as_real
from ._chain import SerialChain, forward_kinematics
from ._exponential import rotation_from_vector
from ._se3 import rotation_error, transform


Channels = Float[Array, " channels"]
Whitening = Float[Array, "poses channels channels"]


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


class Measurements(eqx.Module):
    """Readings of one instrument at some poses.

    Attributes:
        instrument: what was read.
        q: joint coordinates that the encoders showed [rad] or [m], shape
            (poses, joints).
        readings: shape (poses, ...), one reading of the instrument per pose.
        joint_deviation: standard deviations of the encoders [rad] or [m], shape
            (joints,); exact unless given.
    """

    instrument: AbstractInstrument
    q: Float[Array, "poses joints"] = eqx.field(converter=lambda x: _default(x))
    readings: Float[Array, "poses ..."] = eqx.field(converter=lambda x: _default(x))
    joint_deviation: PerJoint | None = eqx.field(
        converter=lambda x: None if x is None else _default(x), default=None
    )

    def __check_init__(self):
        check_fields(self)
        expected = (self.q.shape[0], *self.instrument.shape())
        if self.readings.shape != expected:
            raise ValueError(
                "`readings` must hold one reading of the instrument per pose, shape "
                f"{expected}, but have the shape {self.readings.shape}"
            )
        for name, array in (("q", self.q), ("readings", self.readings)):
            _check_finite(name, array)
        if self.joint_deviation is not None:
            if self.joint_deviation.shape != self.q.shape[1:]:
                raise ValueError(
                    "`joint_deviation` must have one entry per joint, shape "
                    f"{self.q.shape[1:]}, but has {self.joint_deviation.shape}"
                )
            check_values(
                "`joint_deviation` must not be negative",
                self.joint_deviation,
                self.joint_deviation >= 0,
            )

    @staticmethod
    def simulated(
        instrument: AbstractInstrument,
        chain: SerialChain,
        q: Float[Array, "poses joints"],
        key: Array | None = None,
        joint_deviation: PerJoint | None = None,
    ) -> "Measurements":
        """Readings of a known arm, with normal errors if there is a key.

        Args:
            instrument: what is read.
            chain: the true arm.
            q: joint coordinates that the encoders show, shape (poses, joints).
            key: of the errors; none without a key.
            joint_deviation: of the encoders [rad] or [m]; the arm stands beside `q` by
                errors of that size.
        """
        true = q = _default(q)
        if key is not None:
            key, joint_key = jax.random.split(key)
            if joint_deviation is not None:
                noise = jax.random.normal(joint_key, q.shape, q.dtype)
                true = q + noise * joint_deviation[None]
        readings = jax.vmap(lambda x: instrument.predict(chain, x))(true)
        if key is not None:
            shape = jax.eval_shape(instrument.residual, chain, q[0], readings[0]).shape
            noise = jax.random.normal(key, (q.shape[0], *shape), q.dtype)
            readings = jax.vmap(instrument.disturbed)(readings, noise)
        return Measurements(instrument, q, readings, joint_deviation)

    def whitening(
        self, chain: SerialChain
    ) -> Float[Array, "poses channels channels"] | None:
        r"""Matrices that make the residuals of each pose uncorrelated, of variance one.

        Encoder noise adds $J_q S_q J_q^T$ to the covariance of a residual; without it
        there is nothing to do.

        References:
            [KinModell] (3-137): propagation of random errors.
        """
        if self.joint_deviation is None:
            return None

        def factor(q):
            reading = self.instrument.predict(chain, q)
            slope = jax.jacfwd(lambda x: self.instrument.residual(chain, x, reading))(q)
            spread = slope * self.joint_deviation[None]
            identity = jnp.eye(slope.shape[0], dtype=slope.dtype)
            return _inverse_root(identity + spread @ spread.T)

        return jax.vmap(factor)(self.q)

    def residuals(
        self,
        chain: SerialChain,
        offset: PerJoint | None = None,
        whitening: Whitening | None = None,
    ) -> Float[Array, " rows"]:
        """Weighted residuals of all poses behind one another.

        Args:
            chain: the arm.
            offset: added to what the encoders show [rad] or [m].
            whitening: matrices of `whitening`.
        """
        q = self.q if offset is None else self.q + offset[None]
        rows = jax.vmap(lambda x, y: self.instrument.residual(chain, x, y))(
            q, self.readings
        )
        if whitening is not None:
            rows = jnp.einsum("kij,kj->ki", whitening, rows)
        return rows.reshape(-1)


def _inverse_root(matrix: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """W with W S W^T = I of a positive definite S: Cholesky's elimination beside I.

    Small and in plain operations, because the whitenings of several instruments do not
    wait for one another, and batched LAPACK calls then block each other on a processor.
    """
    number = matrix.shape[0]

    def eliminate(k, both):
        row = both[k] / jnp.sqrt(both[k, k])
        below = jnp.where(
            jnp.arange(number) > k, both[:, k] / jnp.sqrt(both[k, k]), 0.0
        )
        return (both - below[:, None] * row[None]).at[k].set(row)

    both = jnp.concatenate([matrix, jnp.eye(number, dtype=matrix.dtype)], axis=1)
    return jax.lax.fori_loop(0, number, eliminate, both)[:, number:]


def _default(value) -> Array:
    """Recordings in single precision are computed with in the default one."""
    return jnp.asarray(as_real(value), jax.dtypes.canonicalize_dtype(jnp.float64))


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


def _check_finite(name: str, array) -> None:
    if is_concrete(array):
        finite = np.isfinite(np.asarray(array)).reshape(array.shape[0], -1).all(axis=1)
        if not finite.all():
            raise ValueError(
                f"`{name}` must be finite: leave out the poses "
                f"{np.flatnonzero(~finite).tolist()}, which hold NaN or infinity"
            )
