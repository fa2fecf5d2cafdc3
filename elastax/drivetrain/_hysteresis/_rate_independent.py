"""A smooth play that keeps its memory and does not depend on the speed."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ..._smooth import logistic, softplus
from ._play_base import AbstractSmoothPlay


class RateIndependentPlay(AbstractSmoothPlay):
    r"""Smooth play in differential form, one state each.

    $$\dot y = \dot x\,\bigl[s\,e^{\psi(x - r - y)} + (1 - s)\,e^{\psi(y - x - r)}
      \bigr],\qquad s = \frac{1}{1 + e^{-2\dot x/v_0}}$$

    While the input rises, $e^{\psi y} - e^{\psi(x - r)}$ stays constant, while it falls
    $e^{-\psi y} - e^{-\psi(x + r)}$: the output is the soft maximum (2.17a) of $x - r$
    and of where the last reversal left it, or the soft minimum, without a delay. What
    follows, for speeds well above $v_0$ and $|x - y| \le r$ at the start:

    - the output follows the path of the input and not its speed;
    - at rest nothing creeps: the memory of a hold is exact, for every length of it;
    - $|x - y| \le r$ forever, and the output differs from the exact play's by
      $\ln 2/\psi$ per reversal at most, far less once the input has moved on by some
      $1/\psi$ beyond the corner;
    - inner cycles that keep the distance m to both limits move the output by less than
      $e^{-\psi m}/\psi$ each: the leak of the memory.

    Below $v_0$ the direction is uncertain and the output moves along one path in both;
    $v_0$ smooths the corner of the rate at a reversal, nothing else. The operator is
    ours; peers smooth the play by a delay, as the text does, or by Bouc's equation,
    whose corner is wider and whose small cycles drift.

    Attributes:
        thresholds: $r_i > 0$, shape (plays, joints), in the unit of the input.
        sharpness: $\psi > 0$, one over that unit; $\psi r$ of 10 or more looks sharp.
        reversal_speed: $v_0 > 0$, in that unit per second, below the speeds that count.

    Raises:
        ValueError: a parameter is not positive, or shapes differ.

    References:
        [Reiner2010] (2.13), (2.17) for the exact play and the soft limits.
    """

    thresholds: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    sharpness: Float[Array, " joints"] = eqx.field(converter=as_real)
    reversal_speed: Float[Array, " joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`thresholds` must be positive: the play of width zero is the input itself",
            self.thresholds,
            self.thresholds > 0,
        )
        for name in ("sharpness", "reversal_speed"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    @property
    def number(self) -> int:
        return self.thresholds.shape[0]

    @property
    def states(self) -> int:
        return self.number

    def rest(self, x: Float[Array, " joints"]) -> Float[Array, "states joints"]:
        psi, size = self.sharpness[None], jnp.abs(x)[None]
        # e^(psi y) = 1 - e^(-psi r) + e^(psi (|x| - r))
        start = jnp.log1p(-jnp.exp(-psi * self.thresholds))
        reached = start + softplus(psi * (size - self.thresholds) - start)
        return jnp.sign(x)[None] * reached / psi

    def outputs(
        self, x: Float[Array, " joints"], states: Float[Array, "states joints"]
    ) -> Float[Array, "plays joints"]:
        return states

    def rates(
        self,
        x: Float[Array, " joints"],
        xd: Float[Array, " joints"],
        states: Float[Array, "states joints"],
    ) -> Float[Array, "states joints"]:
        psi, r = self.sharpness[None], self.thresholds
        rising = logistic(2.0 * xd / self.reversal_speed)[None]
        falling = logistic(-2.0 * xd / self.reversal_speed)[None]
        ahead = x[None] - states
        up, down = _growth(psi * (ahead - r)), _growth(psi * (-ahead - r))
        return xd[None] * (rising * up + falling * down)

    def path(self) -> Callable:
        return self._after

    def _after(self, start, states, end):
        """States after a monotone motion of the input, in closed form."""
        psi, r = self.sharpness[None], self.thresholds
        way, ahead = (end - start)[None], start[None] - states
        up = _approach(psi * (ahead - r), psi * way)
        down = _approach(psi * (-ahead - r), -psi * way)
        return states + jnp.where(way >= 0, up, -down) / psi


def _approach(gap, way):
    """Solution of z' = exp(gap + way - z), z = 0 at way = 0, for a `gap` up to zero.

    $\\ln(1 + e^{gap}(e^{way} - 1))$, without overflow and without cancellation.
    """
    gap = jnp.minimum(gap, 0.0)
    way = jnp.maximum(way, 0.0)
    end = gap + way
    inside, beyond = jnp.minimum(end, 0.0), jnp.maximum(end, 0.0)
    near = jnp.log1p(jnp.exp(inside) - jnp.exp(gap))
    far = beyond + jnp.log1p(-jnp.exp(-beyond) * jnp.expm1(gap))
    return jnp.where(end < 0.0, near, far)


def _growth(z):
    """The exponential up to zero, continued by its parabola: no overflow."""
    safe = jnp.minimum(z, 0.0)
    excess = jnp.maximum(z, 0.0)
    return jnp.where(z > 0.0, 1.0 + excess + 0.5 * excess**2, jnp.exp(safe))
