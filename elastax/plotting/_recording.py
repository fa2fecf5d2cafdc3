"""Figures of a recording against the model."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ._style import COLOURS, INK, WIDTH, add_legend, legend_of, new_figure


def plot_recording(
    times: ArrayLike,
    measured_torque: ArrayLike,
    predicted_torque: ArrayLike,
    *,
    stored_torque: ArrayLike | None = None,
    measured_windup: ArrayLike | None = None,
    predicted_windup: ArrayLike | None = None,
    torque_r2: ArrayLike | None = None,
    windup_r2: ArrayLike | None = None,
    axis_names: Sequence[str] = ("A1", "A2", "A3"),
) -> Figure:
    """A recording against the model: motor torques and wind-up of the gears.

    Args:
        times: shape (times,) [s].
        measured_torque, predicted_torque: motor side, shape (times, axes) [N m].
        stored_torque: feed-forward that the recording brings along, likewise.
        measured_windup, predicted_windup: output minus motor angle, the skew of the
            clocks removed, shape (times, axes) [rad].
        torque_r2, windup_r2: coefficients of determination, shown as given.
        axis_names: one per column of the arrays.
    """
    windup = not (measured_windup is None or predicted_windup is None)
    count = len(axis_names)
    figure, panels = new_figure(
        "Recording against model",
        count,
        1 + windup,
        1.2 + 1.8 * count,
        width=11.0 if windup else WIDTH,
        sharex=True,
    )
    panels = np.reshape(panels, (count, 1 + windup))
    signals = [("motor torque, motor side", "[N m]", 1.0, torque_r2)]
    sides: list = [(measured_torque, predicted_torque, stored_torque)]
    if windup:
        signals.append(("wind-up, skew removed", "[mrad]", 1e3, windup_r2))
        sides.append((measured_windup, predicted_windup, None))
    for column, ((title, unit, factor, r2), data) in enumerate(zip(signals, sides)):
        measured, predicted, stored = data
        panels[0, column].set_title(title, fontsize=9.5, loc="left", color=INK)
        panels[-1, column].set_xlabel("time [s]")
        for k, (axis, name) in enumerate(zip(panels[:, column], axis_names)):

            def draw(values, **style):
                axis.plot(times, factor * np.asarray(values)[:, k], **style)

            draw(measured, color="#a3a3a3", lw=1.3, label="measured")
            if stored is not None:
                draw(stored, color=COLOURS["flexible_joint"], lw=0.7, label="stored")
            draw(predicted, color=COLOURS["asim"], lw=1.1, label="predicted")
            axis.set_ylabel(f"{name} {unit}")
            if r2 is not None:
                text = f"R² = {float(np.asarray(r2)[k]):.3f}"
                axis.set_title(text, fontsize=9.5, loc="right", color=INK)
    add_legend(figure, *legend_of(panels[0, 0]))
    return figure
