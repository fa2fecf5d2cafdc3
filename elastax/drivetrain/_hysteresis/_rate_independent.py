"""A smooth play that keeps its memory and does not depend on the speed."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ..._smooth import logistic
from ._play_base import AbstractSmoothPlay


class RateIndependentPlay(AbstractSmoothPlay):
    r"""Smooth play in differential form, one state each.

    $$\dot y = \dot x\,\bigl[s\,e^{\psi(x - r - y)} + (1 - s)\,e^{\psi(y - x - r)}
      \bigr],\qquad s = \frac{1}{1 + e^{-2\dot x/v_0}}$$

    While the input rises, $e^{\psi y} - e^{\psi(x - r)}$ stays constant, while it falls
    $e^{-\psi y} - e^{-\psi(x + r)}$: the output is the soft maximum (2.17a) of $x - r$
    and of where the last reversal left it, or the soft minimum, without a delay. From
    a start with $|x - y| \le r$, with turns at accelerations a, $v_0^2 \ll a/\psi$:

    - the output follows the path of the input and not its speed; every reversal moves
      it by less than $v_0^2/(2a)$ beyond that path;
    - at rest nothing creeps: the memory of a hold is exact, for every length of it;
    - $|x - y| \le r + v_0^2/(2a)$, and at no speed does it exceed $r + 0.74/\psi$;
    - the output differs from the exact play's by $\ln 2/\psi$ per reversal at most, far
      less once the input has moved on by some $1/\psi$ beyond the corner;
    - an inner cycle within $|x - y| \le r - m$ moves the output by less than
      $-\ln(1 - e^{-\psi m})/\psi$, about $e^{-\psi m}/\psi$: the leak of the memory.

    Below $v_0$ the direction is uncertain and the output moves along one path in both:
    a motion that stays this slow has no hysteresis. The operator is ours; the text
    smooths the play by a delay.

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
        # e^(psi y) = 1 - e^(-psi r) + e^(psi (|x| - r)), below and above the corner
        psi, r = self.sharpness[None], self.thresholds
        negative = x < 0
        size = jnp.where(negative, -x, x)[None]
        inside = size <= r
        below = jnp.exp(-psi * r) * jnp.expm1(psi * jnp.where(inside, size, r))
        beyond = psi * jnp.where(inside, 0.0, size - r)
        above = beyond + jnp.log1p(-jnp.exp(-beyond) * jnp.expm1(-psi * r))
        reached = jnp.where(inside, jnp.log1p(below), above) / psi
        return jnp.where(negative[None], -reached, reached)

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
    above = z > 0.0
    safe = jnp.where(above, 0.0, z)
    excess = jnp.where(above, z, 0.0)
    return jnp.where(above, 1.0 + excess + 0.5 * excess**2, jnp.exp(safe))
