r"""Damping and limits that keep corrections bounded near singular poses.

All laws are smooth and act on every element by itself, so that `compose` applies them
to a quantity together with its time derivatives.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


class AbstractDamping(eqx.Module):
    """Damping of a least-squares inverse from the smallest singular value."""

    @abc.abstractmethod
    def __call__(self, smallest: Float[Array, "..."]) -> Float[Array, "..."]:
        """Damping at the smallest singular value, in the same unit."""


class ConstantDamping(AbstractDamping):
    """The same damping everywhere.

    Attributes:
        value: damping > 0, in the unit of the scaled Jacobian's singular values.
    """

    value: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`value` must be positive", self.value, self.value > 0)

    def __call__(self, smallest: Float[Array, "..."]) -> Float[Array, "..."]:
        return jnp.broadcast_to(self.value, jnp.shape(smallest))


class SigmoidDamping(AbstractDamping):
    r"""Damping that falls from a maximum at singular poses to a minimum elsewhere.

    $\lambda(\sigma) = \hat\lambda
    - (\hat\lambda-\check\lambda)/(1 + e^{-s_\sigma(\sigma-\sigma_{mid})})$.

    Attributes:
        minimum: $\check\lambda > 0$, in the unit of the scaled Jacobian's singular
            values.
        maximum: $\hat\lambda > \check\lambda$, same unit.
        steepness: $s_\sigma > 0$, one over that unit.
        midpoint: $\sigma_{mid}$, same unit.

    References:
        [Reiner2010] (3.66).
    """

    minimum: Scalar = eqx.field(converter=as_real)
    maximum: Scalar = eqx.field(converter=as_real)
    steepness: Scalar = eqx.field(converter=as_real)
    midpoint: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`minimum` must be positive", self.minimum, self.minimum > 0)
        check_values(
            "`maximum` must exceed `minimum`",
            self.maximum,
            self.maximum > self.minimum,
        )
        check_values("`steepness` must be positive", self.steepness, self.steepness > 0)

    @staticmethod
    def from_limits(
        minimum: Scalar | float,
        maximum: Scalar | float,
        lower: Scalar | float,
        upper: Scalar | float,
        *,
        lower_factor: Scalar | float = 0.9,
        upper_factor: Scalar | float = 1.1,
    ) -> "SigmoidDamping":
        r"""Law with given values near the maximum and near the minimum.

        $\lambda(\sigma_1) = k_1\hat\lambda$ and $\lambda(\sigma_2) = k_2\check\lambda$.

        Args:
            minimum: $\check\lambda$.
            maximum: $\hat\lambda$.
            lower: $\sigma_1$, singular value at which the damping starts to fall.
            upper: $\sigma_2$, singular value at which it has fallen.
            lower_factor: $k_1$, 0.9 in the text.
            upper_factor: $k_2$, 1.1 in the text.

        Raises:
            ValueError: one of the conditions (3.67c) does not hold.

        References:
            [Reiner2010] (3.67); the closed form replaces its system of equations.
        """
        minimum, maximum, lower, upper, k1, k2 = map(
            as_real, (minimum, maximum, lower, upper, lower_factor, upper_factor)
        )
        check_values("`minimum` must be positive", minimum, minimum > 0)
        check_values("`lower_factor` must be in (0, 1)", k1, (k1 > 0) & (k1 < 1))
        check_values("`upper_factor` must exceed 1", k2, k2 > 1)
        check_values("`upper` must exceed `lower`", upper, upper > lower)
        check_values(
            "`upper_factor` times `minimum` must be less than `lower_factor` times "
            "`maximum`",
            k2 * minimum,
            k2 * minimum < k1 * maximum,
        )
        # exponents at both limits
        first = jnp.log((1 - k1) * maximum / (k1 * maximum - minimum))
        second = jnp.log((maximum - k2 * minimum) / ((k2 - 1) * minimum))
        steepness = (second - first) / (upper - lower)
        midpoint = (lower * second - upper * first) / (second - first)
        return SigmoidDamping(minimum, maximum, steepness, midpoint)

    def __call__(self, smallest: Float[Array, "..."]) -> Float[Array, "..."]:
        # the mirrored sigmoid neither overflows nor cancels near the minimum
        fallen = jax.nn.sigmoid(-self.steepness * (smallest - self.midpoint))
        return self.minimum + (self.maximum - self.minimum) * fallen


class CorrectionLimiter(eqx.Module):
    """`limit` with given limits, for every joint.

    Attributes:
        lower: smallest correction [rad], one for all joints or shape (joints,).
        upper: largest correction [rad], same shape.
        steepness: s > 0 [1/rad].
    """

    lower: Float[Array, "*joints"] = eqx.field(converter=as_real)
    upper: Float[Array, "*joints"] = eqx.field(converter=as_real)
    steepness: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`upper` must exceed `lower`", self.upper, self.upper > self.lower)
        check_values("`steepness` must be positive", self.steepness, self.steepness > 0)

    def __call__(self, correction: Float[Array, "..."]) -> Float[Array, "..."]:
        """The limited correction [rad]."""
        return limit(correction, self.lower, self.upper, self.steepness)


def limit(correction, lower, upper, steepness):
    r"""Smooth, strictly increasing limiter with values between `lower` and `upper`.

    $\varphi^* = \hat\varphi + g(\varphi-\hat\varphi) - g(\varphi-\check\varphi)$,
    $g(x) = x(\tfrac12 - \tfrac1\pi\arctan sx)$. At a limit the value is short of it by
    about $1/(\pi s)$. The text lacks a $\Delta$ in (3.71a) and a bracket in (3.71c); as
    printed, zero becomes -1 for the limits (-1, 2).

    Args:
        correction: values to limit, any shape [rad].
        lower: smallest value [rad]; `lower` and `upper` broadcast with `correction`.
        upper: largest value [rad].
        steepness: s > 0 [1/rad].

    Returns:
        Limited values [rad], of the shape of `correction`.

    References:
        [Reiner2010] (3.71).
    """
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    # the law is odd about the middle; on the positive side nothing cancels
    sign = jnp.where(correction < middle, -1.0, 1.0)
    x = sign * (correction - middle)
    # x and x - half are not both large and of different sign
    inside = half + _remainder(x - half, steepness) - _remainder(x + half, steepness)
    return middle + sign * inside


def _remainder(x, steepness):
    r"""$g(x) = x(\tfrac12 - \arctan(sx)/\pi)$, without cancellation for large x."""
    return x * jnp.arctan2(jnp.ones_like(x), steepness * x) / np.pi


def attenuate(correction, lever, steepness):
    r"""Correction that vanishes together with the lever it acts on.

    $\varphi^* = \varphi\,(1 - e^{-s\,l^2})$; for $\varphi = \Delta r/l$ it is bounded
    by $0.6382\sqrt{s}\,|\Delta r|$.

    Args:
        correction: values to attenuate [rad].
        lever: length l of the lever [m].
        steepness: s > 0 [1/m^2].

    References:
        [Reiner2010] (3.59).
    """
    return -correction * jnp.expm1(-steepness * lever**2)
