"""Observability indices: how well the poses of an experiment determine parameters.

All are functions of the singular values of the weighted Jacobian of the readings by the
parameters, whose columns are brought to one unit by a characteristic length. Larger is
better.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar, as_real
from ._instruments import AbstractInstrument
from ._parameters import ChainParameters


SingularValues = Float[Array, " parameters"]


class AbstractObservability(eqx.Module):
    """Observability index of an experiment."""

    @abc.abstractmethod
    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        """Index from the singular values, in any order, and the number of poses."""


class ProductIndex(AbstractObservability):
    r"""O1, the volume of the ellipsoid: $(\sigma_1\cdots\sigma_L)^{1/L}/\sqrt m$.

    For a given number m of poses the one that D-optimal experiments maximise.

    References:
        [Borm1991]; O1 of [Sun2008].
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        singular = jnp.any(singular_values <= 0)
        # a safe operand where a value is zero and so is the product
        safe = jnp.where(singular, 1.0, singular_values)
        mean = jnp.exp(jnp.mean(jnp.log(safe)))
        return jnp.where(singular, 0.0, mean / np.sqrt(poses))


class InverseConditionIndex(AbstractObservability):
    r"""O2, the shape of the ellipsoid: $\sigma_{min}/\sigma_{max}$.

    References:
        [Driels1990]; O2 of [Sun2008].
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        return _ratio(jnp.min(singular_values), jnp.max(singular_values))


class SmallestSingularValueIndex(AbstractObservability):
    r"""O3, the worst direction: $\sigma_{min}$ (E-optimality).

    References:
        [Nahvi1994]; O3 of [Sun2008].
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        return jnp.min(singular_values)


class NoiseAmplificationIndex(AbstractObservability):
    r"""O4, errors of readings and model alike: $\sigma_{min}^2/\sigma_{max}$.

    References:
        [Nahvi1996]; O4 of [Sun2008].
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        least = jnp.min(singular_values)
        return least * _ratio(least, jnp.max(singular_values))


class ReciprocalSumIndex(AbstractObservability):
    r"""O5, all directions: $1/(1/\sigma_1 + \cdots + 1/\sigma_L)$.

    References:
        O5 of [Sun2008], which derives it from A-optimality.
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        return _reciprocal_sum(singular_values)


class MeanVarianceIndex(AbstractObservability):
    r"""A-optimality itself: $(\sum_i 1/\sigma_i^2)^{-1/2}$.

    One over the root of the sum of all variances, in the scaled unit.
    """

    def index(self, singular_values: SingularValues, poses: int) -> Scalar:
        return jnp.sqrt(_reciprocal_sum(singular_values**2))


def reading_jacobian(
    parameters: ChainParameters,
    instrument: AbstractInstrument,
    q: PerJoint,
    characteristic_length: Scalar | float = 1.0,
) -> Float[Array, "channels parameters"]:
    """Derivative of the weighted reading at one pose by the scaled parameters.

    Args:
        parameters: that are sought, at their nominal values.
        instrument: what is read.
        q: joint coordinates [rad] or [m], shape (joints,).
        characteristic_length: the length that counts as much as 1 rad [m].

    Returns:
        Standard deviations of the reading per scaled parameter, shape (channels,
        parameters).
    """
    reading = instrument.predict(parameters.chain, q)
    zero = jnp.zeros((parameters.number,), q.dtype)
    residual = lambda x: instrument.residual(parameters.moved(x), q, reading)
    length = as_real(characteristic_length)
    is_length = np.array([unit == "m" for unit in parameters.units])
    scale = jnp.where(is_length, length, jnp.ones_like(length))
    return -jax.jacfwd(residual)(zero) * scale[None]


def observability(
    index: AbstractObservability,
    parameters: ChainParameters,
    instrument: AbstractInstrument,
    q: Float[Array, "poses joints"],
    characteristic_length: Scalar | float = 1.0,
) -> Scalar:
    """Observability index of an experiment.

    Args:
        index: which one.
        parameters: that are sought.
        instrument: what is read at each pose.
        q: joint coordinates [rad] or [m], shape (poses, joints).
        characteristic_length: the length that counts as much as 1 rad [m].

    Raises:
        ValueError: fewer readings than parameters.
    """
    jacobian = lambda x: reading_jacobian(
        parameters, instrument, x, characteristic_length
    )
    channels, number = jax.eval_shape(jacobian, q[0]).shape
    readings = q.shape[0] * channels
    if readings < number:
        raise ValueError(
            f"{number} parameters need as many readings at least, but {q.shape[0]} "
            f"poses give {readings}"
        )
    matrix = jax.vmap(jacobian)(q).reshape(readings, number)
    return index.index(jnp.linalg.svd(matrix, compute_uv=False), q.shape[0])


def _ratio(least: Scalar, largest: Scalar) -> Scalar:
    # zero over zero is the worst there is, not undefined
    safe = jnp.where(largest > 0, largest, 1.0)
    return jnp.where(largest > 0, least / safe, 0.0)


def _reciprocal_sum(values: SingularValues) -> Scalar:
    singular = jnp.any(values <= 0)
    # a safe operand where a value is zero and so is the result
    safe = jnp.where(singular, 1.0, values)
    return jnp.where(singular, 0.0, 1.0 / jnp.sum(1.0 / safe))
