"""A spring whose law is a measured table."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import as_real
from ._stiffness import AbstractStiffness, invert


Points = Float[Array, "points *coordinates"]

_NEWTON_STEPS = 8


class TabulatedStiffness(AbstractStiffness):
    r"""Spring through the points of a table, odd and strictly increasing.

    Between the points a cubic with the slopes of Fritsch and Carlson (weighted harmonic
    means of the neighbouring secants), which keeps the order of the points; beyond the
    last point a straight line. The law has a continuous stiffness; its derivative jumps
    at the points.

    Attributes:
        torsions: $0 < \varphi_1 < \varphi_2 < \dots$ [rad], shape (points, joints); the
            origin is a point of its own.
        torques: $0 < \tau_1 < \tau_2 < \dots$ [N m].

    Raises:
        ValueError: torsions or torques are not positive and strictly increasing, or
            their shapes differ.

    References:
        [Reiner2010] section 2.3.2 for the spring; interpolation [FritschCarlson1980].
    """

    torsions: Points = eqx.field(converter=as_real)
    torques: Points = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("torsions", "torques"):
            value = getattr(self, name)
            if is_concrete(value):
                points = np.asarray(value)
                steps = np.diff(points, axis=0, prepend=np.zeros_like(points[:1]))
                check_values(
                    f"`{name}` of a table must be positive and increase strictly, row "
                    "by row",
                    value,
                    steps > 0,
                )

    def torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        # not by the sign: its derivative at zero would be lost
        return torsion * self.secant(torsion)

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        return invert(_solve, self, torque)

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size = jnp.abs(torsion)
        left, _, slope, second, third = _piece(self, size)
        u = size - left
        return slope + u * (2.0 * second + 3.0 * u * third)

    def secant(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size = jnp.abs(torsion)
        left, y, slope, second, third = _piece(self, size)
        u = size - left
        first = left == 0  # there the torque is a multiple of the torsion
        safe = jnp.where(first, jnp.ones_like(size), size)
        whole = (y + u * (slope + u * (second + u * third))) / safe
        return jnp.where(first, slope + u * (second + u * third), whole)

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        size = jnp.abs(torsion)
        x, y, slopes, seconds, thirds = _coefficients(self)
        width = jnp.diff(x, axis=0)
        energy = jnp.zeros_like(size)
        for k in range(x.shape[0]):
            reach = jnp.maximum(size - x[k], 0.0)
            u = jnp.minimum(reach, width[k]) if k < width.shape[0] else reach
            cubic = seconds[k] / 3.0 + 0.25 * u * thirds[k]
            energy = energy + u * (y[k] + u * (0.5 * slopes[k] + u * cubic))
        return energy

    def scaled(self, factor: Float[Array, "..."] | float) -> "TabulatedStiffness":
        return dataclasses.replace(self, torques=factor * self.torques)


def _coefficients(spring):
    """Left ends, values there, coefficients of the cubics; the last is a line."""
    zero = jnp.zeros_like(spring.torsions[:1])
    x = jnp.concatenate([zero, spring.torsions])
    y = jnp.concatenate([zero, spring.torques])
    h, secant = jnp.diff(x, axis=0), jnp.diff(y, axis=0) / jnp.diff(x, axis=0)
    before, after = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    inner = (before + after) / (before / secant[:-1] + after / secant[1:])
    # the law is odd: the first slope is the secant to the first point
    slopes = jnp.concatenate([secant[:1], inner, secant[-1:]])
    second = (3.0 * secant - 2.0 * slopes[:-1] - slopes[1:]) / h
    third = (slopes[:-1] + slopes[1:] - 2.0 * secant) / h**2
    line = jnp.zeros_like(zero)
    return (
        x,
        y,
        slopes,
        jnp.concatenate([second, line]),
        jnp.concatenate([third, line]),
    )


def _piece(spring, size):
    """Left end, value and coefficients of the piece that holds a torsion."""
    parts = _coefficients(spring)
    found = [part[0] * jnp.ones_like(size) for part in parts]
    for k in range(1, parts[0].shape[0]):
        beyond = size >= parts[0][k]
        found = [jnp.where(beyond, part[k], now) for part, now in zip(parts, found)]
    return found


def _solve(spring, torque):
    magnitude = jnp.abs(torque)
    x, y, slopes, _, _ = _coefficients(spring)
    left, right = x[0] * jnp.ones_like(magnitude), x[1] * jnp.ones_like(magnitude)
    for k in range(1, x.shape[0]):
        beyond = magnitude >= y[k]
        last = k + 1 == x.shape[0]
        far = x[k] + (magnitude - y[k]) / slopes[k] if last else x[k + 1]
        left, right = jnp.where(beyond, x[k], left), jnp.where(beyond, far, right)
    torsion = 0.5 * (left + right)
    low, high = left, right
    for _ in range(_NEWTON_STEPS):
        residual = spring.torque(torsion) - magnitude
        low, high = (
            jnp.where(residual < 0, torsion, low),
            jnp.where(residual < 0, high, torsion),
        )
        step = torsion - residual / spring.stiffness(torsion)
        inside = (step >= low) & (step <= high)
        torsion = jnp.where(inside, step, 0.5 * (low + high))
    return jnp.sign(torque) * torsion
