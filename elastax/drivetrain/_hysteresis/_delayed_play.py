"""The smooth play of the text: soft limits around a delayed output."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ..._smooth import smooth_maximum, smooth_minimum
from ._pade_delay import PadeDelay
from ._play_base import AbstractSmoothPlay


class DelayedPlay(AbstractSmoothPlay):
    r"""The approximate play $P^*$: (2.13) with soft limits and a Pade delay.

    $y = \mathrm{smax}(x - r,\ \mathrm{smin}(x + r,\ y(t - T_t)))$, where the output
    delayed by $T_t$ stands for the one of the sample before. Four results that the
    text does not give tell how to choose $\psi$ and $T_t$:

    - at a constant input the output goes to $x + \mathrm{asinh}(e^{-\psi r}/2)/\psi$
      from every start: the memory is lost, with the time constant $T_t\,e^{\psi r}/2$;
    - on a ramp of the speed v it is off by $-\ln(1 - e^{-\psi v T_t})/\psi$ from the
      exact play, so that a shorter delay makes it worse at fixed $\psi$;
    - turned at once from the speed v to -v it stays off by $v T_t/4$: the delay holds
      what came before the turn and what came after it;
    - for $r = 0$ it is off by $\ln((1 + \sqrt5)/2)/\psi$: take the input itself there.

    So $\psi \ge \max(3/(v T_t),\ \ln(2 t_{hold}/T_t)/r)$ for the slowest speed v and
    the longest hold $t_{hold}$. `RateIndependentPlay` has none of these errors.

    Attributes:
        thresholds: $r_i > 0$, shape (plays, joints), in the unit of the input.
        sharpness: $\psi > 0$, one over that unit: for torsions of 1e-3 rad 1e4 to 1e5
            1/rad, not the 25 to 50 of the text's figure, whose input is of order one.
        delay: $T_t$ and its order.

    Raises:
        ValueError: a threshold or the sharpness is not positive, or shapes differ.

    References:
        [Reiner2010] (2.13), (2.17), (2.18), figure 2.6 and table 2.1.
    """

    thresholds: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    sharpness: Float[Array, " joints"] = eqx.field(converter=as_real)
    delay: PadeDelay

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`thresholds` must be positive: the play of width zero is the input itself",
            self.thresholds,
            self.thresholds > 0,
        )
        check_values("`sharpness` must be positive", self.sharpness, self.sharpness > 0)

    @property
    def number(self) -> int:
        return self.thresholds.shape[0]

    @property
    def states(self) -> int:
        return self.number * self.delay.order

    def rest(self, x: Float[Array, " joints"]) -> Float[Array, "states joints"]:
        psi = self.sharpness[None]
        bias = jnp.arcsinh(0.5 * jnp.exp(-psi * self.thresholds)) / psi
        states = self.delay.rest(x[None] + bias)
        return jnp.swapaxes(states, 0, 1).reshape(self.states, -1)

    def outputs(
        self, x: Float[Array, " joints"], states: Float[Array, "states joints"]
    ) -> Float[Array, "plays joints"]:
        delayed = self.delay.output(self._by_order(states))
        psi, x = self.sharpness[None], x[None]
        inner = smooth_minimum(x + self.thresholds, delayed, psi)
        return smooth_maximum(x - self.thresholds, inner, psi)

    def rates(
        self,
        x: Float[Array, " joints"],
        xd: Float[Array, " joints"],
        states: Float[Array, "states joints"],
    ) -> Float[Array, "states joints"]:
        rates = self.delay.rates(self._by_order(states), self.outputs(x, states))
        return jnp.swapaxes(rates, 0, 1).reshape(self.states, -1)

    def path(self) -> None:
        return None

    def _by_order(self, states):
        """States as (order, plays, joints)."""
        split = states.reshape(self.number, self.delay.order, -1)
        return jnp.swapaxes(split, 0, 1)
