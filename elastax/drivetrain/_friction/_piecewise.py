"""Friction in sections: a smooth zero crossing, a cubic, a straight line."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ._base import AbstractFriction, ratio_size
from ._tanh import sech2, tanh


class PiecewiseFriction(AbstractFriction):
    r"""Odd friction characteristic in three sections of the speed.

    $$\tau(v) = \begin{cases}
      R_h \tanh(s v/2) & 0 \le v < v_{step} \\
      p_1 v^3 + p_2 v^2 + p_3 v + p_4 & v_{step} \le v \le v_{lin} \\
      \tau_{lin} + d\tau_{lin}\,(v - v_{lin}) & v > v_{lin} \end{cases}$$

    The text fixes $v_{lin}$ at 1 rad/s and asks for a continuous curve. Here value and
    slope are continuous, which gives the four coefficients; the second derivative jumps
    at both speeds. The cubic is evaluated between its ends, in Hermite's form, not by
    its coefficients. It need not be monotone: one that falls is refused.

    Attributes:
        coulomb: $R_h > 0$ [N m], level that the zero crossing tends to.
        steepness: $s > 0$ [s/rad].
        step_speed: $v_{step} > 0$ [rad/s], where the zero crossing ends.
        break_speed: $v_{lin} > v_{step}$ [rad/s], where the straight line begins.
        break_torque: $\tau_{lin} > 0$ [N m], friction there.
        break_slope: $d\tau_{lin} \ge 0$ [N m s/rad], one symbol; slope of the line.

    Raises:
        ValueError: a parameter is outside its range, their shapes differ, or the
            cubic falls somewhere.

    References:
        [Reiner2010] (2.5), with the break speed as a parameter and $C^1$ transitions.
    """

    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    step_speed: Float[Array, " *joints"] = eqx.field(converter=as_real)
    break_speed: Float[Array, " *joints"] = eqx.field(converter=as_real)
    break_torque: Float[Array, " *joints"] = eqx.field(converter=as_real)
    break_slope: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("coulomb", "steepness", "step_speed", "break_torque"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)
        check_values(
            "`break_speed` must be above `step_speed`",
            self.break_speed,
            self.break_speed > self.step_speed,
        )
        check_values(
            "`break_slope` must not be negative",
            self.break_slope,
            self.break_slope >= 0,
        )
        least = _least_slope(self)
        check_values(
            "friction must not fall between `step_speed` and `break_speed` (raise "
            "`break_torque`, or lower `break_slope` or `coulomb`): its least slope "
            "there [N m s/rad] must not be negative",
            least,
            least >= 0,
        )

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        size = jnp.abs(speed)
        beyond = self.break_torque + self.break_slope * (size - self.break_speed)
        outer = jnp.where(size > self.break_speed, beyond, _cubic(self, size))
        inner = self.coulomb * tanh(0.5 * self.steepness * speed)
        return jnp.where(size < self.step_speed, inner, jnp.sign(speed) * outer)

    def is_monotone(self) -> Bool[Array, "..."]:
        return (_least_slope(self) >= 0) & (self.break_slope > 0)

    def coefficients(self) -> Float[Array, " powers *joints"]:
        """Coefficients $p_1$ to $p_4$ of the cubic, of descending powers."""
        # Derivatives of the cubic at its inner end, moved to speed zero.
        start = self.step_speed
        value, slope, second, third = _hermite_derivatives(self)
        p1 = third / 6.0
        p2 = 0.5 * second - 3.0 * p1 * start
        p3 = slope - (2.0 * p2 + 3.0 * p1 * start) * start
        p4 = value - ((p1 * start + p2) * start + p3) * start
        return jnp.stack([p1, p2, p3, p4])

    def scaled(self, factor: Float[Array, "..."] | float) -> "PiecewiseFriction":
        return dataclasses.replace(
            self,
            coulomb=factor * self.coulomb,
            break_torque=factor * self.break_torque,
            break_slope=factor * self.break_slope,
        )

    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "PiecewiseFriction":
        size = ratio_size(ratio)
        return dataclasses.replace(
            self,
            coulomb=size * self.coulomb,
            steepness=size * self.steepness,
            step_speed=self.step_speed / size,
            break_speed=self.break_speed / size,
            break_torque=size * self.break_torque,
            break_slope=size**2 * self.break_slope,
        )


def _ends(law):
    """Width of the cubic, and rise and the slopes at its ends over that width."""
    width = law.break_speed - law.step_speed
    argument = 0.5 * law.steepness * law.step_speed
    start = law.coulomb * tanh(argument)
    start_rise = width * 0.5 * law.steepness * law.coulomb * sech2(argument)
    return width, start, law.break_torque - start, start_rise, width * law.break_slope


def _cubic(law, size):
    width, start, rise, start_rise, end_rise = _ends(law)
    u = (size - law.step_speed) / width
    w = 1.0 - u
    inner = rise * (3.0 - 2.0 * u) * u + (start_rise * w - end_rise * u) * w
    return start + inner * u


def _hermite_derivatives(law):
    """Value and derivatives of the cubic at `step_speed`."""
    width, start, rise, start_rise, end_rise = _ends(law)
    second = 6.0 * rise - 4.0 * start_rise - 2.0 * end_rise
    third = 6.0 * (start_rise + end_rise) - 12.0 * rise
    return start, start_rise / width, second / width**2, third / width**3


def _least_slope(law):
    """Least slope of the cubic between its ends."""
    width, _, _, start_rise, end_rise = _ends(law)
    _, _, second, third = _hermite_derivatives(law)
    second, third = second * width**2, third * width**3
    # start + second u + third u^2 / 2 has its least value inside if it is convex there
    convex = third > 0
    place = jnp.where(convex, -second / jnp.where(convex, third, 1.0), 0.0)
    place = jnp.clip(place, 0.0, 1.0)
    between = start_rise + (second + 0.5 * third * place) * place
    return jnp.minimum(jnp.minimum(start_rise, end_rise), between) / width
