"""Readings of an instrument at several poses, and their residuals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, as_real
from ._chain import SerialChain
from ._instruments import AbstractInstrument


Whitening = Float[Array, "poses channels channels"]


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
        encoders = self.joint_deviation
        if encoders is None:
            return None

        def factor(q):
            reading = self.instrument.predict(chain, q)
            slope = jax.jacfwd(lambda x: self.instrument.residual(chain, x, reading))(q)
            spread = slope * encoders[None]
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


def _check_finite(name: str, array) -> None:
    if is_concrete(array):
        finite = np.isfinite(np.asarray(array)).reshape(array.shape[0], -1).all(axis=1)
        if not finite.all():
            raise ValueError(
                f"`{name}` must be finite: leave out the poses "
                f"{np.flatnonzero(~finite).tolist()}, which hold NaN or infinity"
            )
