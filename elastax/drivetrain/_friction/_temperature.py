"""Friction that falls as the lubricant warms up."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ._base import AbstractFriction, ratio_size


class TemperatureFriction(AbstractFriction):
    r"""A friction law and viscous friction that decays with the temperature.

    $$\tau_r(v) = \tau_{law}(v) + \tau_{v,T}\,e^{-(T - T_0)/T_v}\,v$$

    The law holds what stays in a warm gear, its viscous part included. The temperature
    is a parameter, constant during a motion: gears warm up in minutes. A reference
    $T_0$ lets the coefficient be that of a cold gear; fitting holds it, because the two
    cannot be told apart.

    Attributes:
        law: friction that does not depend on the temperature.
        viscous: $\tau_{v,T} \ge 0$, additional at the reference [N m s/rad].
        decay: $T_v > 0$, warming that divides it by e [K].
        reference: $T_0$ [K], or in degrees Celsius like `temperature`.
        temperature: $T$ of the lubricant.

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Bittencourt2012], whose model also lets the Stribeck speed grow with the
        temperature. The text names the effect but gives no law, and leaves it out
        because the gears that it studied have no sensor.
    """

    law: AbstractFriction
    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    decay: Float[Array, " *joints"] = eqx.field(converter=as_real)
    reference: Float[Array, " *joints"] = eqx.field(converter=as_real)
    temperature: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`viscous` must not be negative", self.viscous, self.viscous >= 0)
        check_values("`decay` must be positive", self.decay, self.decay > 0)

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.law.torque(speed) + self.warm_viscous() * speed

    def is_monotone(self) -> Bool[Array, "..."]:
        return self.law.is_monotone()

    def warm_viscous(self) -> Float[Array, " *joints"]:
        """Additional viscous coefficient at the present temperature [N m s/rad]."""
        warming = (self.temperature - self.reference) / self.decay
        return self.viscous * jnp.exp(-warming)

    def scaled(self, factor: Float[Array, "..."] | float) -> "TemperatureFriction":
        return dataclasses.replace(
            self, law=self.law.scaled(factor), viscous=factor * self.viscous
        )

    def to_output_side(
        self, ratio: Float[Array, "..."] | float
    ) -> "TemperatureFriction":
        size = ratio_size(ratio)
        one = jnp.ones_like(size)
        return dataclasses.replace(
            self,
            law=self.law.to_output_side(ratio),
            viscous=size**2 * self.viscous,
            decay=self.decay * one,
            reference=self.reference * one,
            temperature=self.temperature * one,
        )
