r"""First-order response of a spring and damper to a given torque.

Deformations of the structure and torsions of the gears obey the same scalar equation,

$d\,\dot x + k(x) = f(t)$,

[Reiner2010] (3.78), (3.79) and, with $x = \varphi_{rel}$ and $f = -\hat\tau_{a,e}$,
(3.93a) in the relative angle of footnote 18. It is stable and stiff; the text names its
eigenvalue $-c/d$. Since the derivatives of f are known at every sample, a step needs no
evaluation in between: with p derivatives of f, the Hermite-Obreschkoff formula of the
Pade approximant [p/p+1] of the exponential is L-stable and of order 2 p + 1.
"""

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Scalar
from .._taylor import Series, compose


Channels = Float[Array, " channels"]

_NEWTON_STEPS = 4  # the spring is nearly linear over a sample


def response(
    spring: Callable, damping: Channels, x: Channels, forcing: Series
) -> Series:
    """The response x together with its derivatives, one order more than the forcing.

    Args:
        spring: law k(x) [N m], elementwise.
        damping: d > 0 [N m s/rad], shape (channels,).
        x: value now [rad], shape (channels,).
        forcing: f and its derivatives, order p.

    Returns:
        Series of order p + 1.
    """
    terms = [x]
    for k in range(forcing.order + 1):
        elastic = compose(spring, Series(jnp.stack(terms)))
        balance = forcing.coefficients[k] - elastic.coefficients[k]
        terms.append(balance / (damping * (k + 1)))
    return Series(jnp.stack(terms))


def advance(
    spring: Callable,
    damping: Channels,
    x: Channels,
    before: Series,
    after: Series,
    dt: Scalar | float,
) -> Channels:
    """The response one sample later.

    Args:
        spring, damping: as for `response`.
        x: value at the start of the sample [rad].
        before: forcing at its start, order p.
        after: forcing at its end, order p.
        dt: length of the sample [s]; zero returns `x`.

    Returns:
        Value at the end; local error of order 2 p + 2 in dt.
    """
    order = before.order + 1
    explicit, implicit = pade(order - 1, order)
    known = combine(explicit, response(spring, damping, x, before), dt)

    def residual(y):
        return combine(implicit, response(spring, damping, y, after), -dt) - known

    def newton(y):
        value, slope = jax.jvp(residual, (y,), (jnp.ones_like(y),))
        return y - value / slope

    y = x
    for _ in range(_NEWTON_STEPS):
        y = newton(y)
    return y


def pade(numerator: int, denominator: int) -> tuple[list[float], list[float]]:
    """Coefficients of the Pade approximant of the exponential, of z and of -z."""

    def coefficients(degree):
        total = numerator + denominator
        return [
            math.factorial(total - i)
            * math.factorial(degree)
            / (math.factorial(total) * math.factorial(i) * math.factorial(degree - i))
            for i in range(degree + 1)
        ]

    return coefficients(numerator), coefficients(denominator)


def combine(weights: list[float], series: Series, dt: Scalar | float):
    """Sum of the derivatives of a series with the weights of one step `dt`."""
    derivatives = series.derivatives()
    return sum(
        (w * dt**i * derivatives[i] for i, w in enumerate(weights) if i > 0),
        weights[0] * derivatives[0],
    )
