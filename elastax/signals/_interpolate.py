"""Interpolation on a uniform time grid, for the right-hand sides of simulations."""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


TimesByJoints = Float[Array, "times joints"]


class UniformLinear(eqx.Module):
    r"""Linear interpolation, $y = (1 - s)\,y_k + s\,y_{k+1}$.

    Outside the grid the first or last value holds. The look-up costs the same for
    any number of samples.

    Attributes:
        start: time of the first sample [s].
        step: time between samples [s], positive.
        values: samples, shape (times, joints), at least two.

    Raises:
        ValueError: wrong shapes, or `step` is not positive.
    """

    start: Scalar = eqx.field(converter=as_real)
    step: Scalar = eqx.field(converter=as_real)
    values: TimesByJoints = eqx.field(converter=as_real)

    def __check_init__(self):
        _check_grid(self)

    def __call__(self, t: ArrayLike) -> Float[Array, " joints"]:
        """Value at the time `t` [s]."""
        k, s = _locate(self, t)
        return (1 - s) * self.values[k] + s * self.values[k + 1]


class UniformHermite(eqx.Module):
    r"""Cubic Hermite interpolation from values and slopes, once differentiable.

    $y = h_{00} y_k + h_{10} \Delta t\,\dot y_k + h_{01} y_{k+1}
    + h_{11} \Delta t\,\dot y_{k+1}$, error of fourth order in the step. Outside the
    grid the first or last value holds, with slope zero.

    Attributes:
        start: time of the first sample [s].
        step: time between samples [s], positive.
        values: samples, shape (times, joints), at least two.
        slopes: their time derivatives, same shape [1/s].

    Raises:
        ValueError: wrong shapes, or `step` is not positive.
    """

    start: Scalar = eqx.field(converter=as_real)
    step: Scalar = eqx.field(converter=as_real)
    values: TimesByJoints = eqx.field(converter=as_real)
    slopes: TimesByJoints = eqx.field(converter=as_real)

    def __check_init__(self):
        _check_grid(self)

    def __call__(self, t: ArrayLike) -> Float[Array, " joints"]:
        """Value at the time `t` [s]."""
        k, s = _locate(self, t)
        rise = self.values[k + 1] - self.values[k]
        # What the slopes add to the straight line between the two samples.
        before = self.step * self.slopes[k] - rise
        after = self.step * self.slopes[k + 1] - rise
        bend = s * (1 - s) * ((1 - s) * before - s * after)
        return self.values[k] + s * rise + bend


class UniformQuintic(eqx.Module):
    """Quintic Hermite interpolation from values, slopes and curvatures.

    Twice differentiable, error of sixth order in the step. Outside the grid the
    first or last value holds, with slope zero.

    Attributes:
        start: time of the first sample [s].
        step: time between samples [s], positive.
        values: samples, shape (times, joints), at least two.
        slopes: their first time derivatives, same shape [1/s].
        curvatures: their second time derivatives, same shape [1/s^2].

    Raises:
        ValueError: wrong shapes, or `step` is not positive.
    """

    start: Scalar = eqx.field(converter=as_real)
    step: Scalar = eqx.field(converter=as_real)
    values: TimesByJoints = eqx.field(converter=as_real)
    slopes: TimesByJoints = eqx.field(converter=as_real)
    curvatures: TimesByJoints = eqx.field(converter=as_real)

    def __check_init__(self):
        _check_grid(self)

    def __call__(self, t: ArrayLike) -> Float[Array, " joints"]:
        """Value at the time `t` [s]."""
        k, s = _locate(self, t)
        h = self.step
        slope, curvature = h * self.slopes[k], 0.5 * h**2 * self.curvatures[k]
        # Misfit at the end of the parabola that leaves the first sample.
        value_miss = self.values[k + 1] - self.values[k] - slope - curvature
        slope_miss = h * self.slopes[k + 1] - slope - 2 * curvature
        curvature_miss = 0.5 * h**2 * self.curvatures[k + 1] - curvature
        third = 10 * value_miss - 4 * slope_miss + curvature_miss
        fourth = -15 * value_miss + 7 * slope_miss - 2 * curvature_miss
        fifth = 6 * value_miss - 3 * slope_miss + curvature_miss
        tail = third + s * (fourth + s * fifth)
        return self.values[k] + s * (slope + s * (curvature + s * tail))


def _check_grid(grid) -> None:
    check_fields(grid)
    if grid.values.shape[0] < 2:
        raise ValueError(
            "`values` must hold at least two samples, but has the shape "
            f"{grid.values.shape}"
        )
    check_values("`step` must be positive", grid.step, grid.step > 0)


def _locate(grid, t: ArrayLike):
    """Interval of `t` and the place in it, 0 to 1; constant outside the grid."""
    last = grid.values.shape[0] - 1
    x = (as_real(t) - grid.start) / grid.step
    # A plain clip halves the slope at the ends of the grid.
    x = jnp.where(x < 0, jnp.zeros_like(x), x)
    x = jnp.where(x > last, jnp.full_like(x, last), x)
    k = jnp.clip(jnp.floor(x).astype(int), 0, last - 1)
    return k, x - k.astype(x.dtype)
