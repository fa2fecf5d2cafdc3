"""Viscous and smoothed Coulomb friction, on one and on two scales of speed."""

import dataclasses

import equinox as eqx
from jaxtyping import Array, Bool, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ._base import AbstractFriction, ratio_size
from ._tanh import tanh


class CoulombViscousFriction(AbstractFriction):
    r"""Viscous and smoothed Coulomb friction.

    $$\tau_r(v) = \tau_v v + \frac{2\tau_h}{1 + e^{-sv}} - \tau_h
      = \tau_v v + \tau_h \tanh(s v / 2)$$

    The second form is the one that is evaluated: it cannot overflow. The slope at zero
    speed is $\tau_v + s\,\tau_h/2$.

    Attributes:
        viscous: $\tau_v \ge 0$ [N m s/rad].
        coulomb: $\tau_h \ge 0$ [N m].
        steepness: $s > 0$ [s/rad].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] (2.3), equal to (3.94f).
    """

    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`viscous` must not be negative", self.viscous, self.viscous >= 0)
        check_values("`coulomb` must not be negative", self.coulomb, self.coulomb >= 0)
        check_values("`steepness` must be positive", self.steepness, self.steepness > 0)

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.viscous * speed + self.coulomb * tanh(0.5 * self.steepness * speed)

    def is_monotone(self) -> Bool[Array, "..."]:
        return self.viscous + self.coulomb > 0

    def scaled(self, factor: Float[Array, "..."] | float) -> "CoulombViscousFriction":
        return dataclasses.replace(
            self, viscous=factor * self.viscous, coulomb=factor * self.coulomb
        )

    def to_output_side(
        self, ratio: Float[Array, "..."] | float
    ) -> "CoulombViscousFriction":
        size = ratio_size(ratio)
        return dataclasses.replace(
            self,
            viscous=size**2 * self.viscous,
            coulomb=size * self.coulomb,
            steepness=size * self.steepness,
        )


class TwoScaleFriction(AbstractFriction):
    r"""Viscous friction, Coulomb friction on two scales of speed, and an offset.

    $$\tau_r(v) = \tau_0 + \tau_v v + \tau_h \tanh(s_h v) + \tau_a \tanh(s_a v)$$

    The law of the recordings of the KUKA KR300. Mind that a steepness here is that of
    the argument of tanh itself, twice as steep as in `CoulombViscousFriction`. The
    offset is the only part that acts at rest; it stands for what the rigid model leaves
    out, such as gravity of the cables.

    Attributes:
        viscous: $\tau_v \ge 0$, $f_{vis}$ there [N m s/rad].
        coulomb: $\tau_h \ge 0$, $f_{coul}$ there [N m].
        steepness: $s_h > 0$, $s_f$ there [s/rad].
        coulomb_fine: $\tau_a \ge 0$, $f_a$ there [N m].
        steepness_fine: $s_a > 0$, $f_b$ there [s/rad].
        offset: $\tau_0$, $f_{asym}$ there [N m].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Weigand2021], the feed-forward torque of the program and its data.
    """

    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb_fine: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness_fine: Float[Array, " *joints"] = eqx.field(converter=as_real)
    offset: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("viscous", "coulomb", "coulomb_fine"):
            value = getattr(self, name)
            check_values(f"`{name}` must not be negative", value, value >= 0)
        for name in ("steepness", "steepness_fine"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        return (
            self.offset
            + self.viscous * speed
            + self.coulomb * tanh(self.steepness * speed)
            + self.coulomb_fine * tanh(self.steepness_fine * speed)
        )

    def is_monotone(self) -> Bool[Array, "..."]:
        return self.viscous + self.coulomb + self.coulomb_fine > 0

    def scaled(self, factor: Float[Array, "..."] | float) -> "TwoScaleFriction":
        return dataclasses.replace(
            self,
            viscous=factor * self.viscous,
            coulomb=factor * self.coulomb,
            coulomb_fine=factor * self.coulomb_fine,
            offset=factor * self.offset,
        )

    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "TwoScaleFriction":
        size = ratio_size(ratio)
        return dataclasses.replace(
            self,
            viscous=size**2 * self.viscous,
            coulomb=size * self.coulomb,
            steepness=size * self.steepness,
            coulomb_fine=size * self.coulomb_fine,
            steepness_fine=size * self.steepness_fine,
            offset=as_real(ratio) * self.offset,
        )
