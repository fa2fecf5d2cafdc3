r"""Spring laws of gears, bearings and structural hinges.

Every law is odd and strictly increasing, so that it can be inverted: the inverse model
of a drive train needs the torsion that transmits a given torque. The laws act
elementwise; their parameters are scalars or hold one value per coordinate.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real


_NEWTON_STEPS = 6
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


class AbstractStiffness(eqx.Module):
    """Odd, strictly increasing map from torsion to transmitted torque."""

    @abc.abstractmethod
    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Torque [N m] transmitted at `torsion` [rad]."""

    @abc.abstractmethod
    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        """Torsion [rad] at which `torque` [N m] is transmitted: the exact inverse."""

    @abc.abstractmethod
    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Tangent stiffness [N m/rad], the derivative of `torque`."""

    @abc.abstractmethod
    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Secant stiffness [N m/rad], `torque` over torsion; at zero its limit."""

    @abc.abstractmethod
    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Stored energy [J], zero at zero torsion."""

    @abc.abstractmethod
    def scaled(self, factor: Float[Array, "..."] | float) -> "AbstractStiffness":
        """The same law with its torque multiplied by `factor` > 0."""


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def invert(solve: Callable, spring: AbstractStiffness, torque):
    """Inverse of `spring.torque` by `solve`, differentiated implicitly."""
    return solve(spring, torque)


@invert.defjvp
def _invert_jvp(solve, primals, tangents):
    spring, torque = primals
    spring_change, torque_change = tangents
    torsion = invert(solve, spring, torque)
    _, held = jax.jvp(lambda law: law.torque(torsion), (spring,), (spring_change,))
    return torsion, (torque_change - held) / spring.stiffness(torsion)


class LinearStiffness(AbstractStiffness):
    r"""Linear spring, $\tau = c_0\,\varphi$.

    Attributes:
        linear: $c_0 > 0$ [N m/rad].

    Raises:
        ValueError: `linear` is not positive.
    """

    linear: Float[Array, " *coordinates"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`linear` must be positive", self.linear, self.linear > 0)

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.linear * torsion

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return torque / self.linear

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.linear * jnp.ones_like(torsion)

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.linear * jnp.ones_like(torsion)

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return 0.5 * self.linear * torsion**2

    def scaled(self, factor: Float[Array, "..."] | float) -> "LinearStiffness":
        return dataclasses.replace(self, linear=factor * self.linear)


class CubicStiffness(AbstractStiffness):
    r"""Hardening spring, $\tau = c_0\,(1 + \gamma\varphi^2)\,\varphi$.

    The potential is $c_0(\varphi^2/2 + \gamma\varphi^4/4)$, the tangent
    $c_0(1 + 3\gamma\varphi^2)$. The inverse is the real root of the cubic,
    $3u/(1 + a^2 + a^{-2})$ with $u = \tau/c_0$, $a^3 = z + \sqrt{1 + z^2}$ and
    $z = \tfrac32\sqrt{3\gamma}\,|u|$: Cardano's formula without its cancellation, exact
    also at $\gamma = 0$.

    Attributes:
        linear: $c_0 > 0$ [N m/rad], the stiffness at small load.
        hardening: $\gamma \ge 0$ [1/rad^2].

    Raises:
        ValueError: `linear` is not positive, `hardening` is negative, or their shapes
            differ.

    References:
        [Reiner2010] (1.1), (2.7); potential (3.80b).
    """

    linear: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    hardening: Float[Array, " *coordinates"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`linear` must be positive", self.linear, self.linear > 0)
        check_values(
            "`hardening` must not be negative", self.hardening, self.hardening >= 0
        )

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.secant(torsion) * torsion

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return invert(_solve_cubic, self, torque)

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.linear * (1.0 + 3.0 * self.hardening * torsion**2)

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.linear * (1.0 + self.hardening * torsion**2)

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        square = torsion**2
        return 0.5 * self.linear * square * (1.0 + 0.5 * self.hardening * square)

    def scaled(self, factor: Float[Array, "..."] | float) -> "CubicStiffness":
        return dataclasses.replace(self, linear=factor * self.linear)


def _solve_cubic(spring, torque):
    ratio = torque / spring.linear
    z = 1.5 * jnp.sqrt(3.0 * spring.hardening) * jnp.abs(ratio)
    square = jnp.cbrt(z + jnp.hypot(jnp.ones_like(z), z)) ** 2
    return 3.0 * ratio / (1.0 + square + 1.0 / square)


class LimitedStiffness(AbstractStiffness):
    r"""Hardening spring whose secant stiffness is limited.

    $$\tau = \varphi\,\bigl[c_\gamma (B - A) + c_{max} (A + \tfrac12)\bigr],\quad
      c_\gamma = c_0 (1 + \gamma \varphi^2),$$

    with $A = \arctan((c_\gamma - c_{max})s)/\pi$ and $B = \arctan(c_\gamma s)/\pi$.
    The printed (2.9a) closes one bracket too early and leaves the term of $c_{max}$
    without its $\varphi$; the brackets here are those of (3.94a).

    The limit holds for the secant $\tau/\varphi$, which stays below $c_{max}$; the
    tangent overshoots it in the transition, up to nearly $3c_{max} - 2c_0$. At the
    corner the secant falls short of the limit by about $1/(\pi s)$, and at zero torsion
    it differs from $c_0$ by a similar rounding, so that $s\,c_{max} \gg 1$ is meant.

    The inverse takes a fixed number of Newton steps from the larger one of the
    unlimited and the fully limited solution, kept inside the bracket that the bounds of
    the secant give; over ten decades of $s\,c_{max}$ five steps reach rounding.

    Attributes:
        linear: $c_0 > 0$ [N m/rad].
        hardening: $\gamma \ge 0$ [1/rad^2].
        limit: $c_{max} > c_0$ [N m/rad].
        steepness: $s > 0$ of the limitation [rad/(N m)].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] (2.9), corrected; (3.94a), (3.94b).
    """

    linear: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    hardening: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    limit: Float[Array, " *coordinates"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *coordinates"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`linear` must be positive", self.linear, self.linear > 0)
        check_values(
            "`hardening` must not be negative", self.hardening, self.hardening >= 0
        )
        check_values(
            "`limit` must be above `linear`", self.limit, self.limit > self.linear
        )
        check_values("`steepness` must be positive", self.steepness, self.steepness > 0)

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        return torsion * self.secant(torsion)

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return invert(_solve_limited, self, torque)

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        rise = self.linear * self.hardening * torsion**2
        hardened = self.linear + rise
        slope = _limit_slope(hardened, self.limit, self.steepness)
        return _limited_secant(self, hardened) + 2.0 * rise * slope

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        hardened = self.linear * (1.0 + self.hardening * torsion**2)
        return _limited_secant(self, hardened)

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        r"""Stored energy [J].

        With $c_\gamma$ as variable of integration this is $\varphi^2/2$ times the mean
        of the secant over $[c_0, c_\gamma]$. Where $s(c_\gamma - c_0) > 1$ the mean has
        a closed form; below, where that form cancels, 12-point Gauss quadrature is
        exact to rounding, because the poles of the integrand are at distance 1/s.
        """
        return _limited_potential(self, torsion)

    def scaled(self, factor: Float[Array, "..."] | float) -> "LimitedStiffness":
        return dataclasses.replace(
            self,
            linear=factor * self.linear,
            limit=factor * self.limit,
            steepness=self.steepness / factor,
        )


def _limited_secant(spring, hardened):
    """Secant stiffness [N m/rad] for the unlimited one, `hardened`."""
    return _limit(hardened, spring.limit, spring.steepness)


# The brackets of (2.9) in another order: the sharp limit, less the rounding of the
# corners at 0 and at `limit`, which is bounded. Neither large arguments nor a sharp
# corner cost digits; the kinks of the two parts cancel, but only in the derivatives
# below, not in those of the parts.
@jax.custom_jvp
def _limit(hardened, limit, steepness):
    rounding = _wedge(steepness * hardened) - _wedge(
        jnp.abs(steepness * (hardened - limit))
    )
    return jnp.minimum(hardened, limit) - rounding / (math.pi * steepness)


@_limit.defjvp
def _limit_jvp(primals, tangents):
    hardened, limit, steepness = primals
    hardened_change, limit_change, steepness_change = tangents
    p = steepness * hardened
    z = steepness * (hardened - limit)
    along_limit = jnp.arctan2(jnp.ones_like(z), -z) + z / (1.0 + z**2)
    along_steepness = (1.0 / (1.0 + z**2) - 1.0 / (1.0 + p**2)) / steepness**2
    return _limit(hardened, limit, steepness), (
        _limit_slope(hardened, limit, steepness) * hardened_change
        + (along_limit * limit_change + along_steepness * steepness_change) / math.pi
    )


def _limit_slope(hardened, limit, steepness):
    """Derivative of the limited secant stiffness with respect to the unlimited one."""
    # [atan x + x / (1 + x^2)] between z and p, written as one angle and one quotient,
    # which do not cancel far beyond the corner.
    p = steepness * hardened
    r = steepness * limit
    z = steepness * (hardened - limit)
    angle = jnp.arctan2(r, 1.0 + p * z)
    return (angle + r * ((1.0 - p * z) / (1.0 + p**2)) / (1.0 + z**2)) / math.pi


def _wedge(y):
    """y atan(1/y) for y >= 0, from 0 to 1."""
    return y * jnp.arctan2(jnp.ones_like(y), y)


def _solve_limited(spring, torque):
    magnitude = jnp.abs(torque)
    lower = magnitude / spring.limit
    upper = magnitude / _limited_secant(spring, spring.linear)
    unlimited = _solve_cubic(spring, magnitude)
    torsion = jnp.clip(jnp.maximum(unlimited, lower), lower, upper)
    for _ in range(_NEWTON_STEPS):
        residual = spring.torque(torsion) - magnitude
        torsion = torsion - residual / spring.stiffness(torsion)
        torsion = jnp.clip(torsion, lower, upper)
    return jnp.sign(torque) * torsion


@jax.custom_jvp
def _limited_potential(spring, torsion):
    return _limited_energy(spring, torsion)


@_limited_potential.defjvp
def _limited_potential_jvp(primals, tangents):
    spring, torsion = primals
    spring_change, torsion_change = tangents
    energy, change = jax.jvp(
        lambda law: _limited_energy(law, torsion), (spring,), (spring_change,)
    )
    return energy, change + spring.torque(torsion) * torsion_change


def _limited_energy(spring, torsion):
    p_start = spring.steepness * spring.linear
    r = spring.steepness * spring.limit
    growth = spring.hardening * torsion**2
    width = p_start * growth

    quadrature = 0.0
    for node, weight in zip(_NODES.tolist(), _WEIGHTS.tolist(), strict=True):
        hardened = spring.linear * (1.0 + 0.5 * (1.0 + node) * growth)
        quadrature = quadrature + 0.5 * weight * _limited_secant(spring, hardened)

    # The law with a sharp corner, less the rounding of the corners at 0 and at r.
    safe = jnp.where(width > 1.0, width, jnp.ones_like(width))
    p_end = p_start + safe
    corner = jnp.minimum(p_end, r)
    sharp = 0.5 * (corner - p_start) * (corner + p_start) + r * (p_end - corner)
    rounding = (
        _corner(p_end) - _corner(p_start) - _corner(p_end - r) + _corner(p_start - r)
    )
    closed = (sharp - rounding / math.pi) / (spring.steepness * safe)
    return 0.5 * torsion**2 * jnp.where(width > 1.0, closed, quadrature)


def _corner(y):
    """Integral of the wedge of |y|, zero at zero, odd."""
    size = jnp.abs(y)
    angle = jnp.arctan2(jnp.ones_like(size), size)
    return jnp.sign(y) * 0.5 * ((size**2 + 1.0) * angle + size - 0.5 * math.pi)
