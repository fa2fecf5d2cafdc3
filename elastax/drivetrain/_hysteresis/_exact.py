"""The play operator and weighted sums of it, sample by sample; exact inverse."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._checks import check_fields, check_values, is_concrete
from ..._custom_types import as_real


Plays = Float[Array, "plays *joints"]
Sequence = Float[Array, "times *joints"]


def play(
    x: Float[Array, "..."], y: Float[Array, "..."], threshold: Float[Array, "..."]
) -> Float[Array, "..."]:
    r"""One step of the play operator, $\max(x - r, \min(x + r, y))$.

    Args:
        x: input now.
        y: output before; at the first step its initial state.
        threshold: $r \ge 0$, half the width of the play, in the unit of the input.

    References:
        [Reiner2010] (2.13).
    """
    return jnp.maximum(x - threshold, jnp.minimum(x + threshold, y))


class PrandtlIshlinskii(eqx.Module):
    r"""Weighted sum of plays, $H[x](k) = \sum_i w_i\,P_{r_i}[x, y_{0i}](k)$.

    Rate-independent, with the memory of the plays. The inverse exists if $r_0 = 0$, all
    partial sums of the weights are positive and the initial states are ones that plays
    of one input can have: $|y_{0,i+1} - y_{0,i}| \le r_{i+1} - r_i$. The text's
    conditions (2.15) are not sufficient: a smallest threshold above zero is a dead
    zone, which nothing can undo, and unsorted thresholds break (2.16). It is not
    needed that the weights be positive. Weights are what is stored: where those of
    this operator and of its inverse add up to $S$ and $S'$ in magnitude, the round trip
    holds to some $\epsilon S S'$ times the signal, by the condition of the task.

    Attributes:
        weights: $w_i$, shape (plays,) or (plays, joints).
        thresholds: $0 \le r_0 < r_1 < \dots$, in the unit of the input.
        initial: $y_{0i}$, states before the first sample.

    Raises:
        ValueError: shapes differ, or the thresholds are negative or not increasing.

    References:
        [Reiner2010] (2.14); inverse (2.15), (2.16), both corrected.
    """

    weights: Plays = eqx.field(converter=as_real)
    thresholds: Plays = eqx.field(converter=as_real)
    initial: Plays = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`thresholds` must not be negative", self.thresholds, self.thresholds >= 0
        )
        if is_concrete(self.thresholds):
            gaps = np.diff(np.asarray(self.thresholds), axis=0)
            check_values(
                "`thresholds` must increase from play to play",
                self.thresholds,
                gaps > 0,
            )

    def init(self, x: Float[Array, " *joints"]) -> Plays:
        """States of the plays at the first input."""
        return play(x[None], self.initial, self.thresholds)

    def output(self, state: Plays) -> Float[Array, " *joints"]:
        """The weighted sum of the plays' states."""
        return jnp.sum(self.weights * state, axis=0)

    def step(
        self, state: Plays, x: Float[Array, " *joints"]
    ) -> tuple[Float[Array, " *joints"], Plays]:
        """Output and states at the next input."""
        state = play(x[None], state, self.thresholds)
        return self.output(state), state

    def apply(self, x: Sequence) -> Sequence:
        """Outputs along a whole sequence of inputs."""

        def advance(state, now):
            output, state = self.step(state, now)
            return state, output

        # the first step repeats the first input, which changes nothing
        return jax.lax.scan(advance, self.init(x[0]), x)[1]

    def inverse(self) -> "PrandtlIshlinskii":
        r"""The operator that undoes this one, from either side.

        $w'_0 = 1/w_0$, $w'_i = -w_i/(W_i W_{i-1})$, $r'_i = \sum_{j \le i} w_j (r_i -
        r_j)$, $y'_{0i} = W_i\,y_{0i} + \sum_{j > i} w_j\,y_{0j}$ with the partial sums
        $W_i$. The text prints $y_{0j}$ in the first term of the last.

        Raises:
            ValueError: a condition for the inverse is not met.
        """
        _check_invertible(self)
        w, y = self.weights, self.initial
        total = jnp.cumsum(w, axis=0)
        # the sums by parts: gaps and steps times positive factors, without cancellation
        gaps = total[:-1] * jnp.diff(self.thresholds, axis=0)
        steps = -total[:-1] * jnp.diff(y, axis=0)
        last = total[-1:] * y[-1:]
        inner = last + jnp.cumsum(steps[::-1], axis=0)[::-1]
        return PrandtlIshlinskii(
            jnp.concatenate([1.0 / w[:1], -w[1:] / (total[1:] * total[:-1])]),
            jnp.concatenate([jnp.zeros_like(w[:1]), jnp.cumsum(gaps, axis=0)]),
            jnp.concatenate([inner, last]),
        )


def _check_invertible(operator: PrandtlIshlinskii) -> None:
    check_values(
        "the first of `thresholds` must be zero for an inverse: a smallest play of "
        "positive width is a dead zone",
        operator.thresholds,
        operator.thresholds[0] == 0,
    )
    check_values(
        "all partial sums of `weights` must be positive for an inverse",
        operator.weights,
        jnp.cumsum(operator.weights, axis=0) > 0,
    )
    if is_concrete(operator.initial, operator.thresholds):
        initial, thresholds = np.asarray(operator.initial), operator.thresholds
        steps = np.abs(np.diff(initial, axis=0))
        gaps = np.diff(np.asarray(thresholds), axis=0)
        size = np.max(np.abs(initial), initial=0.0)
        rounding = 4 * np.finfo(initial.dtype).eps * size  # of the states themselves
        check_values(
            "`initial` must be admissible for an inverse: neighbouring states may "
            "differ by no more than their thresholds",
            operator.initial,
            steps <= gaps + rounding,
        )
