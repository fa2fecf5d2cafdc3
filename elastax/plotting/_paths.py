"""Figures of the tool and of the wrist over one motion."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike

from ..analysis import WINDOW
from ..control import Run
from ._style import (
    BASE_AXES,
    INK,
    add_legend,
    label_of,
    legend_of,
    line_of,
    mark_window,
    new_figure,
    rest_time,
)


def plot_path_error(runs: Mapping[str, Run]) -> Figure:
    """Distance of the tool from the rigid robot's tool over time, linear and log.

    Args:
        runs: by the name of the inverse: "rigid", "flexible_joint", "asim".
    """
    figure, (linear, log) = new_figure("Path error of the tool", 2, 1, 5.6, sharex=True)
    floor = np.inf
    for name, run in runs.items():
        judgement = run.judgement
        error = 1e3 * np.asarray(judgement.path_error)
        integral = 1e3 * float(judgement.path_error_integral)
        largest = 1e3 * float(judgement.path_error_max)
        label = (
            f"{label_of(name)}: integral {integral:#.3g} mm s, "
            f"largest {largest:#.3g} mm"
        )
        times = run.simulation.times
        linear.plot(times, error, **line_of(name), label=label)
        log.plot(times, np.where(error > 0, error, np.nan), **line_of(name))
        floor = min(floor, np.percentile(error, 2))
    top = log.get_ylim()[1]
    log.set_yscale("log")
    log.set_ylim(min(max(0.5 * floor, 1e-5), 0.1 * top), 2 * top)
    log.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    linear.set_ylim(bottom=0)
    for axes in (linear, log):
        axes.set_ylabel("path error [mm]")
        mark_window(axes, runs, text=axes is linear)
    log.set_xlabel("time [s]")
    add_legend(figure, *legend_of(linear), columns=1)
    return figure


def plot_wrist_acceleration(
    runs: Mapping[str, Run], *, before: float | int = 0.1
) -> Figure:
    """Acceleration of the wrist centre after the stop, the window of C shaded.

    Args:
        runs: by the name of the inverse.
        before: what is shown of the time in front of t_0 [s].

    References:
        [Reiner2010] (6.1).
    """
    title = "Acceleration of the wrist centre after the stop, base frame"
    figure, panels = new_figure(title, 3, 1, 6.0, sharex=True)
    start = rest_time(runs)
    for k, axes in enumerate(panels):
        extremes = [0.0]
        for name, run in runs.items():
            times = np.asarray(run.simulation.times)
            shown = times >= start - before
            component = np.asarray(run.simulation.wrist_acceleration)[:, k]
            label = f"{label_of(name)}: C = {float(run.judgement.criterion):#.3g} m/s"
            axes.plot(times[shown], component[shown], **line_of(name), label=label)
            extremes.extend(component[(times >= start) & (times <= start + WINDOW)])
        axes.axhline(0, color=INK, linewidth=0.5)
        axes.set_ylabel(f"$a_{BASE_AXES[k]}$ [m/s²]")
        # the stop itself is far larger: leave it outside
        room = 0.08 * max(np.ptp(extremes), 1e-6)
        axes.set_ylim(min(extremes) - room, max(extremes) + room)
        mark_window(axes, runs, text=k == 0)
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(start - before, None)
    add_legend(figure, *legend_of(panels[0]))
    return figure


def plot_tool_deviation(runs: Mapping[str, Run], tool_path: ArrayLike) -> Figure:
    """Components of the tool's deviation from the rigid robot's tool.

    Args:
        runs: by the name of the inverse.
        tool_path: `control.rigid_tool_path`, shape (times, 3) [m].
    """
    title = "Deviation of the tool from the reference, base frame"
    figure, panels = new_figure(title, 3, 1, 6.0, sharex=True)
    for k, axes in enumerate(panels):
        for name, run in runs.items():
            deviation = 1e3 * _deviation(run, tool_path)[:, k]
            times = run.simulation.times
            axes.plot(times, deviation, **line_of(name), label=label_of(name))
        axes.axhline(0, color=INK, linewidth=0.5)
        axes.set_ylabel(f"$\\Delta {BASE_AXES[k]}$ [mm]")
        mark_window(axes, runs, text=k == 0)
    panels[-1].set_xlabel("time [s]")
    add_legend(figure, *legend_of(panels[0]))
    return figure


def plot_cartesian_path(
    runs: Mapping[str, Run],
    tool_path: ArrayLike,
    *,
    magnification: float | int | None = None,
) -> Figure:
    """The tool's path in its plane with magnified deviations, and the error over time.

    The deviation at the first sample, the sag at rest, is subtracted.

    Args:
        runs: by the name of the inverse.
        tool_path: `control.rigid_tool_path`, shape (times, 3) [m].
        magnification: of the deviations; unless given, the round number at which the
            largest one takes up to 15 % of the path's extent.

    References:
        [Reiner2010] figure 6.5.
    """
    reference = np.asarray(tool_path)
    deviations = {name: _deviation(run, reference) for name, run in runs.items()}
    deviations = {name: d - d[:1] for name, d in deviations.items()}
    plane, names = _plane(reference)
    flat = reference @ plane.T
    if magnification is None:
        largest = max(np.max(np.linalg.norm(d, axis=1)) for d in deviations.values())
        magnification = _round_down(0.15 * np.max(np.ptp(flat, axis=0)) / largest)
    title = f"Cartesian path, deviations magnified {magnification:g} times"
    figure, (path, error) = new_figure(title, 1, 2, 4.6, width_ratios=(1.25, 1.0))
    for name, run in runs.items():
        shown = flat + magnification * (deviations[name] @ plane.T)
        path.plot(*shown.T, **line_of(name), label=label_of(name))
        distance = 1e3 * np.linalg.norm(deviations[name], axis=1)
        error.plot(run.simulation.times, distance, **line_of(name))
    dashes = (0, (4, 2))
    path.plot(*flat.T, color=INK, lw=1.0, ls=dashes, label="reference")
    path.set_aspect("equal", adjustable="datalim")
    path.set_xlabel(f"{names[0]} [m]")
    path.set_ylabel(f"{names[1]} [m]")
    error.set_xlabel("time [s]")
    error.set_ylabel("distance, offset at t = 0 subtracted [mm]")
    error.set_ylim(bottom=0)
    mark_window(error, runs)
    add_legend(figure, *legend_of(path))
    return figure


def _deviation(run: Run, tool_path: ArrayLike) -> np.ndarray:
    path = np.asarray(tool_path)
    position = np.asarray(run.simulation.tool_pose)[:, :3, 3]
    if path.shape != position.shape:
        raise ValueError(
            f"`tool_path` must have the shape {position.shape} of the simulated path, "
            f"but has {path.shape}"
        )
    return position - path


def _plane(path: np.ndarray) -> tuple[np.ndarray, tuple[str, str]]:
    """Two directions of the plane in which a path lies best, and their names."""
    normal = np.linalg.svd(path - path.mean(0), full_matrices=True)[2][-1]
    main = int(np.argmax(np.abs(normal)))
    if abs(normal[main]) > 1 - 1e-6:
        kept = [k for k in range(3) if k != main]
        return np.eye(3)[kept], (BASE_AXES[kept[0]], BASE_AXES[kept[1]])
    if abs(normal[2]) > 1 - 1e-3:
        return np.eye(3)[:2], ("x", "y")
    across = np.cross([0.0, 0.0, 1.0], normal)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(normal, across)]), ("across", "up")


def _round_down(value: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is not above `value`."""
    if not (np.isfinite(value) and value > 0):
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(m for m in (1, 2, 5) if m * power <= value))
