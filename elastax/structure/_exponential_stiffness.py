"""A spring that hardens towards a largest stiffness exponentially."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real
from ._stiffness import AbstractStiffness, invert


_NEWTON_STEPS = 10
_SERIES_BELOW = 0.02  # there the closed form of the energy has lost five digits


class ExponentialStiffness(AbstractStiffness):
    r"""Hardening spring, $\tau = \varphi\,[c_0 + (c_{max} - c_0)(1 - e^{-\gamma
    |\varphi|})]$.

    The text's $|\varphi|$ leaves a jump of the second derivative at zero; here it is
    $\sqrt{\varphi^2 + \varepsilon^2} - \varepsilon$, so that an inverse model can
    differentiate on. As $\varepsilon$ goes to zero the law is the text's. $c_{max}$
    bounds the secant; the tangent overshoots it, up to $c_0 + (c_{max} - c_0)(1 +
    e^{-2})$ at $\varphi = 2/\gamma$.

    Attributes:
        linear: $c_0 > 0$ [N m/rad].
        limit: $c_{max} > c_0$ [N m/rad].
        hardening: $\gamma > 0$ [1/rad], another unit than in (2.7).
        rounding: $\varepsilon > 0$ [rad], small against $1/\gamma$.

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] (2.8), with a rounded magnitude.
    """

    linear: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    limit: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    hardening: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    rounding: Float[Array, " *coordinates"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`linear` must be positive", self.linear, self.linear > 0)
        check_values(
            "`limit` must be above `linear`", self.limit, self.limit > self.linear
        )
        for name in ("hardening", "rounding"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return torsion * self.secant(torsion)

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return invert(_solve, self, torque)

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size, length = _magnitude(self, torsion)
        slope = self.hardening * torsion * (torsion / length)
        rise = (self.limit - self.linear) * slope * jnp.exp(-self.hardening * size)
        return self.secant(torsion) + rise

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size, _ = _magnitude(self, torsion)
        rise = -jnp.expm1(-self.hardening * size)
        return self.linear + (self.limit - self.linear) * rise

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size, _ = _magnitude(self, torsion)
        w = self.hardening * size
        small = jnp.minimum(w, _SERIES_BELOW)
        series = small**2 * (0.5 - small * (1 / 3 - small * (1 / 8 - small / 30)))
        large = jnp.maximum(w, _SERIES_BELOW)
        closed = -jnp.expm1(-large) - large * jnp.exp(-large)
        held = jnp.where(w < _SERIES_BELOW, series, closed) / self.hardening
        missing = (held - self.rounding * jnp.expm1(-w)) / self.hardening
        return 0.5 * self.limit * torsion**2 - (self.limit - self.linear) * missing

    def scaled(self, factor: Float[Array, "..."] | float) -> "ExponentialStiffness":
        return dataclasses.replace(
            self, linear=factor * self.linear, limit=factor * self.limit
        )


def _magnitude(spring, torsion):
    """The rounded magnitude, and the root that it comes from."""
    # scaled, so that neither tiny nor huge torsions are lost in the squares
    ratio = jnp.abs(torsion) / spring.rounding
    length = jnp.where(
        ratio < 1e8,
        jnp.sqrt(1.0 + jnp.minimum(ratio, 1e8) ** 2),
        ratio,
    )
    size = ratio * (ratio / (1.0 + length))
    return spring.rounding * size, spring.rounding * length


def _solve(spring, torque):
    magnitude = jnp.abs(torque)
    lower, upper = magnitude / spring.limit, magnitude / spring.linear
    torsion = lower
    for _ in range(_NEWTON_STEPS):
        residual = spring.torque(torsion) - magnitude
        torsion = torsion - residual / spring.stiffness(torsion)
        torsion = jnp.clip(torsion, lower, upper)
    return jnp.sign(torque) * torsion
