"""Reference motion: joint angles over time, with their derivatives."""

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._checks import check_fields, is_concrete
from .._custom_types import Scalar, Times, as_optional_real, as_real
from ._filters import AbstractFilter
from ._interpolate import UniformHermite


TimesByJoints = Float[Array, "times joints"]

# Largest difference between two sampling intervals, relative to the interval.
_JITTER = 1e-3


class Reference(eqx.Module):
    """Motion of the ideally rigid robot with the derivatives that an inverse asks for.

    Attributes:
        times: uniformly spaced, increasing, shape (times,) [s].
        derivatives: joint angles (row 0) and their time derivatives up to `order`,
            shape (order + 1, times, joints) [rad/s^k].
        tool_poses: poses of the tool, shape (times, 4, 4), or None.

    Raises:
        ValueError: wrong shapes, times that do not increase uniformly, or values
            that are not finite (the first sample and axis are named).
    """

    times: Times = eqx.field(converter=as_real)
    derivatives: Float[Array, "derivatives times joints"] = eqx.field(converter=as_real)
    tool_poses: Float[Array, "times 4 4"] | None = eqx.field(
        converter=as_optional_real, default=None
    )

    def __check_init__(self):
        check_fields(self)
        _check_times(self.times)
        if is_concrete(self.derivatives):
            for k, values in enumerate(np.asarray(self.derivatives)):
                _check_finite(f"`derivatives[{k}]`", self.times, values)
        if self.tool_poses is not None:
            expected = (*self.times.shape, 4, 4)
            if self.tool_poses.shape != expected:
                raise ValueError(
                    f"`tool_poses` must have the shape {expected}, one pose per "
                    f"sample, but has {self.tool_poses.shape}"
                )
            flat = self.tool_poses.reshape(-1, 16)
            _check_finite("`tool_poses`", self.times, flat, "element")

    @classmethod
    def from_samples(
        cls,
        times: ArrayLike,
        positions: ArrayLike,
        *,
        filter: AbstractFilter,
        order: int = 4,
        settle: float = 0.0,
        max_step: ArrayLike | None = None,
    ) -> "Reference":
        """Filter sampled joint angles; the filter delivers the derivatives.

        The filter starts at rest at the first sample and delays the motion by
        `filter.delay()`. It takes the angles as linear between the samples. Of a
        filter of just the order `order` the highest derivative contains the angles
        themselves and is off by about rate^order dt^2 / 12 times their acceleration:
        some 10 % of its peak for a Bessel filter of order 4 and 20 Hz at 1 kHz. Take
        a filter of one order more (0.2 %), or more samples.

        Args:
            times: of the samples, uniform, shape (times,) [s].
            positions: joint angles, shape (times, joints) [rad].
            filter: of at least the order `order`.
            order: highest derivative.
            settle: time for which the last angles are held at the end, so that the
                filter comes to rest [s].
            max_step: largest change between two samples, scalar or (joints,) [rad];
                None does not look for jumps.

        Raises:
            ValueError: as `check_recording_signal`, or a filter of too low an order.
        """
        check_recording_signal(times, positions, max_step)
        if settle < 0:
            raise ValueError(f"`settle` must not be negative, but is {settle}")
        held = 0
        if settle > 0:
            # The number of samples must be known, in a trace as well.
            if not is_concrete(times):
                raise ValueError("`settle` needs `times` that are not traced")
            grid = np.asarray(times)
            held = _whole_steps(settle, float(grid[-1] - grid[0]) / (len(grid) - 1))
        times, positions = _hold(as_real(times), as_real(positions), held)
        dt = _mean_step(times)
        return cls(times, filter.apply(positions, dt, order))

    @classmethod
    def from_derivatives(
        cls, times: ArrayLike, derivatives: ArrayLike, *, tolerance: float = 1e-2
    ) -> "Reference":
        """Take derivatives that come with a profile or a recording, after a check.

        The integral of derivative k + 1 (trapezoidal rule) must follow derivative k:
        their difference may reach `tolerance` times the range that derivative k runs
        through on this axis (at least a hundredth of the largest range of any axis).
        Wrong units, signs, axes, rates and time shifts break this.

        Args:
            times: of the samples, uniform, shape (times,) [s].
            derivatives: angles and derivatives, shape (order + 1, times, joints).
            tolerance: allowed difference as a fraction of the range.

        Raises:
            ValueError: as the constructor, or derivatives that contradict each other.
        """
        reference = cls(times, derivatives)
        if is_concrete(reference.times, reference.derivatives):
            _check_consistent(
                np.asarray(reference.times),
                np.asarray(reference.derivatives),
                tolerance,
            )
        return reference

    @classmethod
    def from_position_function(
        cls,
        function: Callable,
        duration: float,
        dt: float,
        *,
        filter: AbstractFilter,
        order: int = 4,
        settle: float = 0.0,
        oversampling: int = 8,
    ) -> "Reference":
        """Sample a motion from time zero and filter it.

        Args:
            function: joint angles (joints,) [rad] at a time [s], such as the
                `position` of a point-to-point motion; also asked up to `dt` after
                `duration`.
            duration: of the motion, rounded up to whole samples [s].
            dt: sampling time [s].
            filter: of at least the order `order`.
            order: highest derivative.
            settle: time for which the last angles are held at the end, so that the
                filter comes to rest [s].
            oversampling: samples that the filter sees per sample that is kept; its
                error falls with the square. One gives what `from_samples` gives.

        Raises:
            ValueError: `duration`, `dt` or `oversampling` not positive, `settle`
                negative, or a filter of too low an order.
        """
        duration, dt, settle = float(duration), float(dt), float(settle)
        if not (0 < dt < math.inf and 0 < duration < math.inf and settle >= 0):
            raise ValueError(
                "`duration` and `dt` must be positive and `settle` not negative, but "
                f"they are {duration}, {dt} and {settle}"
            )
        if oversampling < 1:
            raise ValueError(f"`oversampling` must be positive, but is {oversampling}")
        fine = dt / oversampling
        times = as_real(fine * np.arange(_whole_steps(duration, dt) * oversampling + 1))
        held = _whole_steps(settle, dt) * oversampling
        times, positions = _hold(times, jax.vmap(function)(times), held)
        derivatives = filter.apply(positions, fine, order)
        return cls(times[::oversampling], derivatives[:, ::oversampling])

    @property
    def order(self) -> int:
        """Highest derivative that is held."""
        return self.derivatives.shape[0] - 1

    @property
    def dt(self) -> Scalar:
        """Sampling time [s]."""
        return _mean_step(self.times)

    @property
    def positions(self) -> TimesByJoints:
        """Joint angles, shape (times, joints) [rad]."""
        return self.derivatives[0]

    def require_order(self, order: int) -> None:
        """Raise unless derivatives up to `order` are held.

        Raises:
            ValueError: there are too few, with what to change.
        """
        if self.order < order:
            raise ValueError(
                "filter of too low an order: the reference holds derivatives up to "
                f"{self.order}, but {order} are needed; build it with `order={order}` "
                f"and a filter of order {order} or higher"
            )

    def rest_time(self, fraction: float = 1e-3) -> Scalar:
        """Last time at which any joint speed exceeds `fraction` of its own peak [s].

        The time from which residual vibration is judged. Speeds that are mere
        rounding of the angles do not count; without any motion it is the first time.

        Raises:
            ValueError: the reference holds no speeds.
        """
        self.require_order(1)
        speed = jnp.abs(self.derivatives[1])
        largest = jnp.max(jnp.abs(self.positions), axis=0)
        rounding = 100 * jnp.finfo(speed.dtype).eps * largest / self.dt
        threshold = jnp.maximum(fraction * jnp.max(speed, axis=0), rounding)
        moving = jnp.any(speed > threshold[None], axis=1)
        numbers = jnp.arange(self.times.shape[0])
        return self.times[jnp.max(jnp.where(moving, numbers, 0))]

    def interpolant(self, derivative: int = 0) -> UniformHermite:
        """Derivative number `derivative` as a function of time, with its own slope.

        Raises:
            ValueError: the next higher derivative is not held.
        """
        self.require_order(derivative + 1)
        return UniformHermite(
            self.times[0],
            self.dt,
            self.derivatives[derivative],
            self.derivatives[derivative + 1],
        )


def check_recording_signal(
    times: ArrayLike, values: ArrayLike, max_step: ArrayLike | None = None
) -> None:
    """Refuse a recorded signal that cannot be filtered.

    Args:
        times: of the samples, shape (times,) [s].
        values: samples, shape (times, joints).
        max_step: largest change from one sample to the next, scalar or (joints,),
            in the unit of `values`; None does not look for jumps.

    Raises:
        ValueError: wrong shapes, times that do not increase uniformly, a value that
            is not finite, or a jump; the first sample and axis are named.
    """
    shape, expected = np.shape(values), np.shape(times)
    if len(expected) != 1 or len(shape) != 2 or shape[0] != expected[0]:
        raise ValueError(
            "the samples must have the shape (times, joints) and the times (times,), "
            f"but these are {shape} and {expected}"
        )
    _check_times(times)
    _check_finite("the signal", times, values)
    if max_step is None or not is_concrete(times, values):
        return
    limit = np.broadcast_to(np.asarray(max_step, float), shape[1])
    if not np.all(limit > 0):
        raise ValueError(f"`max_step` must be positive, but is {max_step}")
    steps = np.abs(np.diff(np.asarray(values), axis=0))
    if np.any(steps > limit):
        k, axis = np.argwhere(steps > limit)[0].tolist()
        raise ValueError(
            f"the signal must not jump, but it changes by {steps[k, axis]:.6g} (more "
            f"than `max_step` = {limit[axis]:.6g}) up to {_place(times, k + 1, axis)}; "
            "repair the recording, unwrap its angles or raise `max_step`"
        )


def _place(times: ArrayLike, k: int, axis: int, word: str = "axis") -> str:
    t = float(np.asarray(times)[k])
    return f"sample {k} (t = {t:.6g} s), {word} {axis} (both counted from 0)"


def _check_times(times: ArrayLike) -> None:
    count = np.shape(times)[0]
    if count < 2:
        raise ValueError(f"`times` must hold at least two samples, but has {count}")
    if not is_concrete(times):
        return
    t = np.asarray(times)
    if not np.all(np.isfinite(t)):
        k = int(np.argmin(np.isfinite(t)))
        raise ValueError(f"`times` must be finite, but is {t[k]} at sample {k}")
    steps = np.diff(t)
    if not np.all(steps > 0):
        k = int(np.argmin(steps > 0)) + 1
        raise ValueError(
            f"`times` must increase, but sample {k} is at {t[k]:.9g} s after "
            f"{t[k - 1]:.9g} s"
        )
    mean = (t[-1] - t[0]) / (len(t) - 1)
    allowed = _JITTER * mean + 8 * np.finfo(t.dtype).eps * np.max(np.abs(t))
    if np.any(np.abs(steps - mean) > allowed):
        k = int(np.argmax(np.abs(steps - mean) > allowed)) + 1
        raise ValueError(
            f"`times` must be uniform, but the step to sample {k} is "
            f"{steps[k - 1]:.6g} s against {mean:.6g} s on average; resample the "
            "signal on a uniform grid"
        )


def _check_finite(
    what: str, times: ArrayLike, values: ArrayLike, word: str = "axis"
) -> None:
    if not is_concrete(times, values):
        return
    finite = np.isfinite(np.asarray(values))
    if not np.all(finite):
        k, axis = np.argwhere(~finite)[0].tolist()
        raise ValueError(
            f"{what} must be finite, but is {np.asarray(values)[k, axis]} at "
            f"{_place(times, k, axis, word)}"
        )


def _check_consistent(
    times: np.ndarray, derivatives: np.ndarray, tolerance: float
) -> None:
    dt = (times[-1] - times[0]) / (len(times) - 1)
    for k in range(len(derivatives) - 1):
        lower, upper = derivatives[k], derivatives[k + 1]
        growth = np.cumsum(0.5 * dt * (upper[1:] + upper[:-1]), axis=0)
        miss = np.abs(lower[1:] - lower[0] - growth)
        ranges = np.ptp(lower, axis=0)
        rounding = 1e3 * np.finfo(lower.dtype).eps * np.max(np.abs(lower))
        scale = np.maximum(ranges, 1e-2 * np.max(ranges))
        allowed = tolerance * scale + rounding
        if np.any(miss > allowed):
            i, axis = np.argwhere(miss > allowed)[0].tolist()
            raise ValueError(
                f"`derivatives[{k + 1}]` must be the time derivative of "
                f"`derivatives[{k}]`, but their integral and value differ by "
                f"{miss[i, axis]:.3g} (allowed {allowed[axis]:.3g}) at "
                f"{_place(times, i + 1, axis)}; check units, signs and time shifts, "
                "or build the reference with `from_samples` and a filter"
            )


def _mean_step(times: Array) -> Scalar:
    return (times[-1] - times[0]) / (times.shape[0] - 1)


def _whole_steps(duration: float, dt: float) -> int:
    """Steps of `dt` that cover `duration`, forgiving rounding."""
    return math.ceil(duration / dt * (1 - 1e-12) - 1e-9)


def _hold(times: Array, positions: Array, count: int) -> tuple[Array, Array]:
    """Append `count` samples with the last value."""
    later = times[-1] + _mean_step(times) * as_real(np.arange(1, count + 1))
    last = jnp.broadcast_to(positions[-1], (count, positions.shape[1]))
    return jnp.concatenate([times, later]), jnp.concatenate([positions, last])
