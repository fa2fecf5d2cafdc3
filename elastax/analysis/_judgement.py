"""How well a feed-forward leaves the tool still: the figures of chapter 6."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar, Times
from ..dynamics import ElasticRobot, SimulationResult


WINDOW = 0.9  # [s], T of (6.1)
SETTLED = 1e-4  # [m]


class Judgement(eqx.Module):
    """Figures of one run.

    Attributes:
        rest_time: t_0, end of the filtered motion [s].
        criterion: C of (6.1), acceleration of the wrist centre [m/s].
        path_error_integral: integral of the path error over 0..t_0 + T [m s].
        path_error_integral_relative: the same, the error at t = 0 subtracted [m s].
        path_error_max: largest path error over that time [m].
        path_error_max_relative: the same, the error at t = 0 subtracted [m].
        settling_time: from t_0 until the tool stays within 0.1 mm of its final place
            [s].
        peak_motor_torque: largest magnitudes, motor side [N m], shape (axes,).
        peak_gear_torque: largest magnitudes, output side [N m], shape (axes,).
        path_error: over time [m], shape (times,).
    """

    rest_time: Scalar
    criterion: Scalar
    path_error_integral: Scalar
    path_error_integral_relative: Scalar
    path_error_max: Scalar
    path_error_max_relative: Scalar
    settling_time: Scalar
    peak_motor_torque: PerJoint
    peak_gear_torque: PerJoint
    path_error: Times


def judge(
    robot: ElasticRobot,
    simulation: SimulationResult,
    tool_path: Float[Array, "times 3"],
    rest_time: Scalar,
) -> Judgement:
    """Figures of a simulated run.

    Args:
        robot: the plant.
        simulation: its motion, at uniform times that reach to `rest_time` + T at least.
        tool_path: where the tool of the rigid robot on the filtered reference is [m].
        rest_time: t_0, when the filtered reference comes to rest [s].

    References:
        [Reiner2010] (6.1), table 6.1.
    """
    times = simulation.times
    position = simulation.tool_pose[:, :3, 3]
    deviation = position - tool_path
    error = _norm(deviation)
    relative = _norm(deviation - deviation[:1])
    end = rest_time + WINDOW
    within = times <= end + 1e-9 * WINDOW
    zero = jnp.zeros_like(error)
    final = position[-1:]
    away = (_norm(position - final) > SETTLED) & (times >= rest_time)
    last = jnp.max(jnp.where(away, times, rest_time))
    ratio = jnp.abs(robot.drives.ratio)[None]
    return Judgement(
        rest_time=rest_time,
        criterion=criterion(times, simulation.wrist_acceleration, rest_time),
        path_error_integral=_integral(times, error, times[0], end),
        path_error_integral_relative=_integral(times, relative, times[0], end),
        path_error_max=jnp.max(jnp.where(within, error, zero)),
        path_error_max_relative=jnp.max(jnp.where(within, relative, zero)),
        settling_time=last - rest_time,
        peak_motor_torque=jnp.max(jnp.abs(simulation.tau_m) / ratio, axis=0),
        peak_gear_torque=jnp.max(jnp.abs(simulation.tau_gear), axis=0),
        path_error=error,
    )


def criterion(
    times: Times,
    acceleration: Float[Array, "times 3"],
    start: Scalar,
    window: Scalar | float = WINDOW,
) -> Scalar:
    r"""Criterion C, [m/s].

    $C = \sum_{k=1}^{3}\int_{t_0}^{t_0+T} |a_k(t) - \bar a_k|\,dt$, the mean over the
    same window; exact for accelerations that are linear between the samples.

    Args:
        times: uniform [s], reaching over the window.
        acceleration: in the base frame [m/s^2], shape (times, 3).
        start: t_0 [s].
        window: T [s].

    References:
        [Reiner2010] (6.1).
    """
    end = start + window

    def one(a):
        mean = _integral(times, a, start, end) / window
        return _absolute_integral(times, a - mean, start, end)

    return one(acceleration[:, 0]) + one(acceleration[:, 1]) + one(acceleration[:, 2])


def _norm(vectors):
    """Euclidean norm along the last axis, with gradient zero at zero."""
    square = jnp.sum(vectors**2, axis=-1)
    safe = jnp.where(square > 0, square, 1.0)
    return jnp.where(square > 0, jnp.sqrt(safe), 0.0)


def _pieces(times, values, start, end):
    """Ends of the linear pieces of `values`, cut to the window, and their lengths."""
    left = jnp.clip(times[:-1], start, end)
    right = jnp.clip(times[1:], start, end)
    slope = (values[1:] - values[:-1]) / (times[1:] - times[:-1])
    first = values[:-1] + slope * (left - times[:-1])
    last = values[:-1] + slope * (right - times[:-1])
    return first, last, right - left


def _integral(times, values, start, end) -> Scalar:
    first, last, length = _pieces(times, values, start, end)
    return jnp.sum(0.5 * (first + last) * length)


def _absolute_integral(times, values, start, end) -> Scalar:
    first, last, length = _pieces(times, values, start, end)
    plain = 0.5 * jnp.abs(first + last)
    # where the piece changes sign it makes two triangles
    changes = first * last < 0
    total = jnp.where(changes, jnp.abs(first) + jnp.abs(last), 1.0)
    triangles = 0.5 * (first**2 + last**2) / total
    return jnp.sum(jnp.where(changes, triangles, plain) * length)
