"""Friction that is largest at low speed: two forms of the Stribeck effect."""

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ._base import AbstractFriction, ratio_size
from ._tanh import tanh


class StribeckFriction(AbstractFriction):
    r"""Viscous and smoothed Coulomb friction with a bump at low speed.

    $$\tau_r(v) = \tau_v v + \tau_h \tanh(s v / 2) + \frac{v}{a v^2 + c}$$

    The printed (2.4) has $a v + c$ below the bar, which is neither odd nor free of a
    pole; the lost exponent is the simplest reading that gives a bump. It is
    $1/(2\sqrt{ac})$ high, at the speed $\sqrt{c/a}$, and falls at most by $1/(8c)$ per
    rad/s, at $\sqrt{3c/a}$: with $\tau_v \ge 1/(8c)$ the law is monotone and has an
    inverse whatever the other parameters are.

    Attributes:
        viscous: $\tau_v \ge 0$ [N m s/rad].
        coulomb: $\tau_h \ge 0$ [N m].
        steepness: $s > 0$ [s/rad].
        stribeck_fall: $a > 0$ [s/(rad N m)]: far out the bump is $1/(a v)$.
        stribeck_rise: $c > 0$ [rad/(s N m)]: at rest its slope is $1/c$.

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] (2.4), corrected.
    """

    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    stribeck_fall: Float[Array, " *joints"] = eqx.field(converter=as_real)
    stribeck_rise: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("viscous", "coulomb"):
            value = getattr(self, name)
            check_values(f"`{name}` must not be negative", value, value >= 0)
        for name in ("steepness", "stribeck_fall", "stribeck_rise"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        return (
            self.viscous * speed
            + self.coulomb * tanh(0.5 * self.steepness * speed)
            + speed / (self.stribeck_fall * speed**2 + self.stribeck_rise)
        )

    def is_monotone(self) -> Bool[Array, "..."]:
        # Sufficient; the slope of the Coulomb part would allow for a little less.
        return self.viscous * self.stribeck_rise >= 0.125

    def peak(self) -> tuple[Float[Array, " *joints"], Float[Array, " *joints"]]:
        """Speed [rad/s] at which the bump is highest, and its torque there [N m]."""
        speed = jnp.sqrt(self.stribeck_rise / self.stribeck_fall)
        return speed, 0.5 / jnp.sqrt(self.stribeck_rise * self.stribeck_fall)

    def scaled(self, factor: Float[Array, "..."] | float) -> "StribeckFriction":
        return dataclasses.replace(
            self,
            viscous=factor * self.viscous,
            coulomb=factor * self.coulomb,
            stribeck_fall=self.stribeck_fall / factor,
            stribeck_rise=self.stribeck_rise / factor,
        )

    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "StribeckFriction":
        size = ratio_size(ratio)
        # i v i / (a i^2 v^2 + c): only the second parameter changes
        return dataclasses.replace(
            self,
            viscous=size**2 * self.viscous,
            coulomb=size * self.coulomb,
            steepness=size * self.steepness,
            stribeck_fall=self.stribeck_fall * jnp.ones_like(size),
            stribeck_rise=self.stribeck_rise / size**2,
        )


class BreakawayFriction(AbstractFriction):
    r"""Viscous and Coulomb friction whose level falls from that of the breakaway.

    $$\tau_r(v) = \tau_v v + \bigl[\tau_h + (\tau_s - \tau_h)\,e^{-(v/v_s)^2}\bigr]
      \tanh(s v / 2)$$

    A peak of nearly $\tau_s$ just beyond the zero crossing needs $s v_s \gg 1$. The
    law is smooth and holds nothing at rest; sticking needs a switching law. It is
    monotone if $\tau_v \ge \sqrt{2/e}\,(\tau_s - \tau_h)/v_s$, the steepest descent of
    the bell.

    Attributes:
        viscous: $\tau_v \ge 0$ [N m s/rad].
        coulomb: $\tau_h \ge 0$ [N m], the level at high speed.
        steepness: $s > 0$ [s/rad].
        breakaway: $\tau_s \ge \tau_h$ [N m], the level at low speed.
        stribeck_speed: $v_s > 0$ [rad/s].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Armstrong1994], the Gaussian Stribeck curve; here its sign function is smooth.
        The text has no such law, only (2.4).
    """

    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    breakaway: Float[Array, " *joints"] = eqx.field(converter=as_real)
    stribeck_speed: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("viscous", "coulomb"):
            value = getattr(self, name)
            check_values(f"`{name}` must not be negative", value, value >= 0)
        for name in ("steepness", "stribeck_speed"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)
        check_values(
            "`breakaway` must not be below `coulomb`",
            self.breakaway,
            self.breakaway >= self.coulomb,
        )

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        bell = jnp.exp(-((speed / self.stribeck_speed) ** 2))
        level = self.coulomb + (self.breakaway - self.coulomb) * bell
        return self.viscous * speed + level * tanh(0.5 * self.steepness * speed)

    def is_monotone(self) -> Bool[Array, "..."]:
        descent = (self.breakaway - self.coulomb) / self.stribeck_speed
        sufficient = self.viscous >= math.sqrt(2.0 / math.e) * descent
        return sufficient & (self.viscous + self.coulomb > 0)

    def scaled(self, factor: Float[Array, "..."] | float) -> "BreakawayFriction":
        return dataclasses.replace(
            self,
            viscous=factor * self.viscous,
            coulomb=factor * self.coulomb,
            breakaway=factor * self.breakaway,
        )

    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "BreakawayFriction":
        size = ratio_size(ratio)
        return dataclasses.replace(
            self,
            viscous=size**2 * self.viscous,
            coulomb=size * self.coulomb,
            steepness=size * self.steepness,
            breakaway=size * self.breakaway,
            stribeck_speed=self.stribeck_speed / size,
        )
