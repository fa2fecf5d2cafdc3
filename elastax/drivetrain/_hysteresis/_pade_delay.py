"""A short delay as a rational transfer function."""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._checks import check_fields, check_values
from ..._custom_types import Scalar, as_real


class PadeDelay(eqx.Module):
    r"""Pade approximant $[n-1/n]$ of $e^{-T_t s}$ with n states.

    $$G = \frac{1 + \sum_{i=1}^{n-1} b_i (T_t s)^i}{1 + \sum_{i=1}^{n} a_i (T_t s)^i},
      \quad a_i = \binom ni \frac1{(2n-1)\cdots(2n-i)},\quad
      b_i = (-1)^i \binom{n-1}i \frac1{(2n-1)\cdots(2n-i)}$$

    The output is a sum of states alone, so that a loop around it has no algebraic part.
    In states: $T_t\dot w_k = w_{k+1}$, $T_t a_n \dot w_{n-1} = u - w_0 - \sum a_k w_k$,
    $y = w_0 + \sum b_k w_k$. At rest all of them but $w_0 = u$ are zero.

    Attributes:
        delay: $T_t > 0$ [s].
        order: $n \ge 1$, the degree of the denominator; the text calls the degrees of
            numerator and denominator the other way round.

    Raises:
        ValueError: the delay or the order is not positive.

    References:
        [Reiner2010] (2.18).
    """

    delay: Scalar = eqx.field(converter=as_real)
    order: int = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        check_values("`delay` must be positive [s]", self.delay, self.delay > 0)
        if self.order < 1:
            raise ValueError(f"`order` must be at least 1, but is {self.order}")

    def coefficients(self) -> tuple[list[float], list[float]]:
        """$a_1 \\dots a_n$ and $b_1 \\dots b_{n-1}$."""
        n = self.order
        falling = [math.perm(2 * n - 1, i) for i in range(n + 1)]
        a = [math.comb(n, i) / falling[i] for i in range(1, n + 1)]
        b = [(-1) ** i * math.comb(n - 1, i) / falling[i] for i in range(1, n)]
        return a, b

    def rest(self, value: Float[Array, "..."]) -> Float[Array, "order ..."]:
        """States at rest at a constant value."""
        zero = jnp.zeros_like(value)[None]
        return jnp.concatenate([value[None], *[zero] * (self.order - 1)])

    def output(self, states: Float[Array, "order ..."]) -> Float[Array, "..."]:
        """The delayed value."""
        _, b = self.coefficients()
        return sum((c * w for c, w in zip(b, states[1:])), states[0])

    def rates(
        self, states: Float[Array, "order ..."], value: Float[Array, "..."]
    ) -> Float[Array, "order ..."]:
        """Rates of the states under the value to be delayed."""
        a, _ = self.coefficients()
        held = sum((c * w for c, w in zip(a, states[1:])), states[0])
        last = (value - held) / a[-1]
        return jnp.concatenate([states[1:], last[None]]) / self.delay
