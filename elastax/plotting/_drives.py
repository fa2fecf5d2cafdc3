"""Figures of what the drive trains and the structure do over one motion."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..control import Run
from ..dynamics import ElasticRobot
from ._style import (
    CYCLE,
    FRAME,
    INK,
    add_legend,
    label_of,
    legend_of,
    line_of,
    mark_window,
    new_figure,
)


def plot_deformations(
    robot: ElasticRobot,
    runs: Mapping[str, Run],
    *,
    inverse: str = "asim",
    gears: Sequence[int] = (0, 1, 2),
) -> Figure:
    """Deformations that an inverse computed (dashed) against the plant's (solid).

    One panel per group of elastic coordinates whose names begin alike, and one for the
    wind-up of the gears. The scale on the right is relative to the largest angle,
    as in the text.

    Args:
        robot: the plant, for names.
        runs: by the name of the inverse.
        inverse: whose run is drawn.
        gears: axes whose wind-up is drawn, from 0.

    References:
        [Reiner2010] figures 3.23, 3.24.
    """
    run = runs[inverse]
    command, plant = run.command, run.simulation
    predicted, actual = np.asarray(command.eta), np.asarray(plant.eta)
    content = []
    for title, members in _groups(robot.elastic_names):
        names = [robot.elastic_names[k] for k in members]
        if predicted.shape != actual.shape:
            raise ValueError(
                f'`inverse` must predict deformations, but "{inverse}" does not'
            )
        content.append((title, names, predicted[:, members], actual[:, members]))
    wanted = [k for k in gears if k < robot.axes]
    content.append(
        (
            "gears: wind-up, joint minus motor angle",
            [robot.axis_names[k] for k in wanted],
            (np.asarray(command.q) - np.asarray(command.theta))[:, wanted],
            (np.asarray(plant.q) - np.asarray(plant.theta))[:, wanted],
        )
    )
    rows = -(-len(content) // 2)
    columns = min(2, len(content))
    title = f"Deformations of the plant under {label_of(inverse)} feed-forward"
    height = 1.2 + 2.5 * rows
    figure, panels = new_figure(title, rows, columns, height, width=9.4)
    panels = np.ravel(panels)
    sides = {
        "plant": {"alpha": 0.45, "lw": 3.2},
        label_of(inverse): {"lw": 1.3, "ls": "--"},
    }
    for axes, (name, labels, left, right) in zip(panels, content):
        for k, label in enumerate(labels):
            colour = CYCLE[k % len(CYCLE)]
            for values, times, style in zip(
                (right, left), (plant.times, command.times), sides.values()
            ):
                axes.plot(times, 1e3 * values[:, k], color=colour, **style)
            axes.plot([], [], color=colour, lw=2.2, label=label)
        axes.set_title(name, fontsize=9.5, loc="left", color=INK)
        modal = {robot.elastic_names[k] for k in robot.modal_coordinates}
        is_modal = set(labels) <= modal and len(labels) > 0
        axes.set_ylabel("amplitude [$10^{-3}$]" if is_modal else "angle [mrad]")
        axes.legend(fontsize=8, ncols=2, loc="upper right", **FRAME)
        low, high = axes.get_ylim()
        axes.set_ylim(top=high + (0.25 if len(labels) > 2 else 0.15) * (high - low))
        mark_window(axes, runs)
        _relative_scale(axes, 1e3 * float(np.max(np.abs(right), initial=0.0)))
    for axes in panels[len(content) :]:
        axes.set_visible(False)
    for axes in panels[: len(content)][-columns:]:
        axes.set_xlabel("time [s]")
    handles = [Line2D([], [], color=INK, **style) for style in sides.values()]
    add_legend(figure, handles, list(sides))
    return figure


def plot_torques(
    robot: ElasticRobot, runs: Mapping[str, Run], *, axes: Sequence[int] = (0, 1, 2)
) -> Figure:
    """Motor torques on the motor side and gear torques on the output side.

    Args:
        robot: the plant, for names and gear ratios.
        runs: by the name of the inverse.
        axes: which are drawn, from 0.
    """
    wanted = [k for k in axes if k < robot.axes]
    figure, panels = new_figure(
        "Torques of the plant", len(wanted), 2, 1.2 + 1.7 * len(wanted), sharex=True
    )
    panels = np.reshape(panels, (len(wanted), 2))
    ratio = np.asarray(robot.drives.ratio)
    for row, k in zip(panels, wanted):
        for name, run in runs.items():
            times = run.simulation.times
            motor = np.asarray(run.simulation.tau_m)[:, k] / ratio[k]
            gear = 1e-3 * np.asarray(run.simulation.tau_gear)[:, k]
            row[0].plot(times, motor, **line_of(name), label=label_of(name))
            row[1].plot(times, gear, **line_of(name))
        row[0].set_ylabel(f"{robot.axis_names[k]} [N m]")
        row[1].set_ylabel(f"{robot.axis_names[k]} [kN m]")
        for panel in row:
            mark_window(panel, runs)
    for column, text in enumerate(
        ("motor torque, motor side", "gear torque, output side")
    ):
        panels[0, column].set_title(text, fontsize=9.5, loc="left", color=INK)
        panels[-1, column].set_xlabel("time [s]")
    add_legend(figure, *legend_of(panels[0, 0]))
    return figure


def _groups(names: Sequence[str]) -> list[tuple[str, list[int]]]:
    """Coordinates whose names share the first word, under the words they all share."""
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        groups.setdefault(name.split()[0], []).append(k)
    titled = []
    for members in groups.values():
        words = [names[k].split() for k in members]
        shared = 0
        while all(len(w) > shared and w[shared] == words[0][shared] for w in words):
            shared += 1
        titled.append((" ".join(words[0][:shared]), members))
    return titled


def _relative_scale(axes: Axes, largest: float) -> None:
    if largest <= 0:
        return
    second = axes.secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) / largest,
            lambda y: np.asarray(y) * largest,
        ),
    )
    second.set_ylabel("relative [-]", fontsize=8.5)
    second.tick_params(labelsize=8, color="#999999")
    second.spines["right"].set_color("#cccccc")
