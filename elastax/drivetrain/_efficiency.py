"""Efficiency of a gear as a function of its speed."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real
from .._smooth import smooth_maximum


class AbstractEfficiency(eqx.Module):
    """Share of the power that the teeth hand on in one direction, in (0, 1]."""

    @abc.abstractmethod
    def value(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        """Efficiency [-] at the speed [rad/s], of either sign."""


class ConstantEfficiency(AbstractEfficiency):
    r"""The same efficiency at every speed.

    Attributes:
        level: $0 < \eta \le 1$ [-].

    Raises:
        ValueError: the level is outside (0, 1].

    References:
        [Reiner2010] (2.10), (2.11).
    """

    level: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        _check_share("level", self.level)

    def value(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.level * jnp.ones_like(speed)


class FallingEfficiency(AbstractEfficiency):
    r"""Efficiency that falls with the speed to a floor, smoothly.

    $\eta = \mathrm{smax}_\psi(\eta_0 - k\,|\omega|_\varepsilon,\ \eta_{min})$ with
    $|\omega|_\varepsilon = \sqrt{\omega^2 + \varepsilon^2} - \varepsilon$. The law of
    the text's figure 2.4, $\eta_0 - k|\omega|$, has a corner at rest and runs through
    zero; the floor keeps it positive. The soft maximum exceeds by up to $\ln 2/\psi$.

    Attributes:
        at_rest: $\eta_0$, in (0, 1] [-].
        decline: $k \ge 0$ [s/rad].
        floor: $\eta_{min}$, positive and below `at_rest` [-].
        sharpness: $\psi > 0$ of the floor [-].
        rounding: $\varepsilon > 0$ [rad/s].

    Raises:
        ValueError: a parameter is outside its range, their shapes differ, or the soft
            floor would lift the efficiency above 1.

    References:
        [Reiner2010] figure 2.4, with a floor and a rounded magnitude.
    """

    at_rest: Float[Array, " *joints"] = eqx.field(converter=as_real)
    decline: Float[Array, " *joints"] = eqx.field(converter=as_real)
    floor: Float[Array, " *joints"] = eqx.field(converter=as_real)
    sharpness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    rounding: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        _check_share("at_rest", self.at_rest)
        _check_share("floor", self.floor)
        check_values("`decline` must not be negative", self.decline, self.decline >= 0)
        for name in ("sharpness", "rounding"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)
        check_values(
            "`floor` must be below `at_rest`", self.floor, self.floor < self.at_rest
        )
        top = smooth_maximum(self.at_rest, self.floor, self.sharpness)
        check_values(
            "the efficiency must not exceed 1 at rest: raise `sharpness`", top, top <= 1
        )

    def value(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        ratio = jnp.clip(speed / self.rounding, -1e8, 1e8)
        root = jnp.sqrt(1.0 + ratio**2)
        size = self.rounding * ratio * (ratio / (1.0 + root))
        fallen = self.at_rest - self.decline * size
        return smooth_maximum(fallen, self.floor, self.sharpness)


def _check_share(name: str, value) -> None:
    check_values(
        f"efficiency `{name}` must be above zero and up to one",
        value,
        (value > 0) & (value <= 1),
    )
