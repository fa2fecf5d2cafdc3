"""A spring with a soft gap: the smooth counterpart of backlash."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real
from ._stiffness import AbstractStiffness, invert


_NEWTON_STEPS = 16


class BacklashStiffness(AbstractStiffness):
    r"""Spring behind a rounded dead zone of the width b, strictly increasing.

    $$\tau = \varphi\,\Bigl[c\,\Bigl(1 - \frac{b}{S_+ + S_-}\Bigr) + c_r\Bigr],\qquad
      S_\pm = \sqrt{(\varphi \pm b/2)^2 + \varepsilon^2}$$

    The dead zone is $\varphi - (S_+ - S_-)/2$: within $\varepsilon$ of the sharp one,
    infinitely often differentiable and never flat, so that its inverse exists. In the
    gap it leaves the stiffness $c\,(1 - b/\sqrt{b^2 + 4\varepsilon^2}) + c_r$; the
    smaller that is, the larger are the motor speeds that an exact inverse asks for when
    the load changes its sign.

    Attributes:
        contact: $c > 0$ of the teeth in contact [N m/rad].
        width: total play $b \ge 0$ [rad].
        rounding: $\varepsilon > 0$ [rad], below the width.
        residual: $c_r \ge 0$, stiffness that stays in the gap [N m/rad].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] (2.12), smooth counterpart; the form is ours.
    """

    contact: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    width: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    rounding: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    residual: Float[Array, " *coordinates"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`contact` must be positive", self.contact, self.contact > 0)
        check_values("`width` must not be negative", self.width, self.width >= 0)
        check_values("`rounding` must be positive", self.rounding, self.rounding > 0)
        check_values(
            "`residual` must not be negative", self.residual, self.residual >= 0
        )

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return torsion * self.secant(torsion)

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return invert(_solve, self, torque)

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        excess, both, root = _gap(self, torsion)
        rise = self.width * torsion**2 * (excess / root / both**3)
        return self.secant(torsion) + self.contact * rise

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        excess, both, _ = _gap(self, torsion)
        share = excess / (both * (both + self.width))  # 1 - b / (S+ + S-)
        return self.contact * share + self.residual

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        half = 0.5 * self.width
        gap = _area(self, torsion + half) - _area(self, torsion - half)
        closed = 0.5 * torsion**2 - 0.5 * gap + _area(self, half)
        return self.contact * closed + 0.5 * self.residual * torsion**2

    def scaled(self, factor: Float[Array, "..."] | float) -> "BacklashStiffness":
        return dataclasses.replace(
            self, contact=factor * self.contact, residual=factor * self.residual
        )


def _root(spring, u):
    """Square root of u^2 + rounding^2, without overflow."""
    ratio = u / spring.rounding
    safe = jnp.clip(ratio, -1e8, 1e8)
    near = spring.rounding * jnp.sqrt(1.0 + safe**2)
    return jnp.where(jnp.abs(ratio) < 1e8, near, jnp.abs(u))


def _gap(spring, torsion):
    """$(S_+ + S_-)^2 - b^2$ without cancellation, $S_+ + S_-$ and $S_+ S_-$."""
    half, rounding = 0.5 * spring.width, spring.rounding
    outside = (jnp.abs(torsion) + half) * (jnp.abs(torsion) - half) + rounding**2
    product = jnp.sqrt(outside**2 + (2.0 * half * rounding) ** 2)
    inside = (2.0 * half * rounding) ** 2 / (product + jnp.abs(outside))
    excess = 2.0 * jnp.where(outside > 0, outside + product, inside)
    return excess, jnp.sqrt(spring.width**2 + excess), product


def _area(spring, u):
    """Integral of the root from zero to u, odd."""
    rounding = spring.rounding
    return 0.5 * (u * _root(spring, u) + rounding**2 * jnp.arcsinh(u / rounding))


def _solve(spring, torque):
    magnitude = jnp.abs(torque)
    # the law is convex for positive torsions: Newton's steps from above stay above
    closed = magnitude / (spring.contact + spring.residual)
    upper = jnp.minimum(
        closed + 0.5 * spring.width, magnitude / spring.secant(0.0 * magnitude)
    )
    torsion = upper
    for _ in range(_NEWTON_STEPS):
        residual = spring.torque(torsion) - magnitude
        torsion = torsion - residual / spring.stiffness(torsion)
        torsion = jnp.clip(torsion, 0.0, upper)
    return jnp.sign(torque) * torsion
