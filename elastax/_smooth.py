"""Smooth switches whose derivatives keep their digits and never overflow."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


@jax.custom_jvp
def logistic(x: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""$1/(1 + e^{-x})$; its derivatives keep their digits where it is near one."""
    decay = jnp.exp(-jnp.abs(x))
    return jnp.where(x >= 0, jnp.ones_like(x), decay) / (1.0 + decay)


@jax.custom_jvp
def _logistic_slope(x):
    decay = jnp.exp(-jnp.abs(x))
    return decay / (1.0 + decay) ** 2


@logistic.defjvp
def _logistic_jvp(primals, tangents):
    (x,), (change,) = primals, tangents
    return logistic(x), _logistic_slope(x) * change


@_logistic_slope.defjvp
def _logistic_slope_jvp(primals, tangents):
    (x,), (change,) = primals, tangents
    slope = _logistic_slope(x)
    return slope, slope * (1.0 - 2.0 * logistic(x)) * change


@jax.custom_jvp
def softplus(x: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""$\ln(1 + e^x)$."""
    return jnp.maximum(x, 0.0) + jnp.log1p(jnp.exp(-jnp.abs(x)))


@softplus.defjvp
def _softplus_jvp(primals, tangents):
    (x,), (change,) = primals, tangents
    return softplus(x), logistic(x) * change


def smooth_maximum(
    a: Float[Array, "..."], b: Float[Array, "..."], sharpness: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""$\frac1\psi\ln(e^{\psi a} + e^{\psi b})$, above the maximum by up to
    $\ln 2/\psi$.

    Args:
        a, b: values of any unit.
        sharpness: $\psi > 0$, in one over that unit.

    References:
        [Reiner2010] (2.17a).
    """
    return b + softplus(sharpness * (a - b)) / sharpness


def smooth_minimum(
    a: Float[Array, "..."], b: Float[Array, "..."], sharpness: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""$-\frac1\psi\ln(e^{-\psi a} + e^{-\psi b})$, below the minimum by up to
    $\ln 2/\psi$.

    References:
        [Reiner2010] (2.17b).
    """
    return b - softplus(sharpness * (b - a)) / sharpness
