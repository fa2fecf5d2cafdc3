"""Figures of linear models: poles and zeros, Bode, Nyquist."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ..analysis import LinearModel
from ._style import CYCLE, INK, add_legend, new_figure


def plot_poles_and_zeros(
    models: Mapping[str, LinearModel],
    *,
    limit: float | None = None,
    title: str = "Poles and zeros",
) -> Figure:
    """Poles as crosses, zeros as circles, of several models in one plane.

    Args:
        models: by the name for the legend.
        limit: half the side of a second panel about the origin [1/s]; without one it
            shows the third of all points that is nearest to the origin.
        title: of the figure.

    References:
        [Reiner2010] figure 3.18.
    """
    points = {
        name: (np.asarray(model.poles()), model.zeros())
        for name, model in models.items()
    }
    every = np.concatenate([np.concatenate(pair) for pair in points.values()])
    if limit is None:
        size = np.sort(np.abs(every))
        limit = 1.1 * max(float(size[len(size) // 3]), 1e-9)
    figure, panels = new_figure(title, 1, 2, 4.6)
    whole, near = panels
    for k, (name, (poles, zeros)) in enumerate(points.items()):
        colour = CYCLE[k % len(CYCLE)]
        for axes in panels:
            axes.plot(np.real(poles), np.imag(poles), "x", color=colour, ms=6, mew=1.4)
            axes.plot(
                np.real(zeros),
                np.imag(zeros),
                "o",
                color=colour,
                ms=7 - 1.2 * (k % 3),
                mfc="none",
            )
    for axes in panels:
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_xlabel("real part [1/s]")
        axes.margins(x=0.05, y=0.05)
    whole.set_ylabel("imaginary part [rad/s]")
    whole.set_title("all", fontsize=10)
    near.set_title(f"within {limit:.4g} 1/s of the origin", fontsize=10)
    near.set_xlim(-limit, limit)
    near.set_ylim(-limit, limit)
    # right zeros are what one looks for
    near.axvspan(0.0, limit, color="#f7ecec", zorder=0, linewidth=0)
    lines = [
        Line2D([], [], color=CYCLE[k % len(CYCLE)], linewidth=2.2)
        for k in range(len(points))
    ]
    marks = [
        Line2D([], [], color=INK, marker=m, linestyle="", fillstyle="none")
        for m in ("x", "o")
    ]
    names = [*points] if len(points) > 1 else []
    add_legend(figure, [*lines[: len(names)], *marks], [*names, "poles", "zeros"])
    return figure


def plot_bode(
    models: Mapping[str, LinearModel], frequencies: ArrayLike, *, title: str = "Bode"
) -> Figure:
    """Magnitude and phase of every channel over the frequency.

    Args:
        models: by the name for the legend, with the same inputs and outputs.
        frequencies: [Hz].
        title: of the figure.
    """
    frequencies = np.asarray(frequencies, float)
    first = next(iter(models.values()))
    inputs, outputs = first.names.inputs, first.names.outputs
    rows, columns = 2 * len(outputs), len(inputs)
    figure, panels = new_figure(
        title, rows, columns, 1.0 + 1.75 * rows, sharex=True, squeeze=False
    )
    for k, (name, model) in enumerate(models.items()):
        response = np.asarray(model.frequency_response(2 * np.pi * frequencies))
        for i in range(len(outputs)):
            for j in range(columns):
                channel = response[:, i, j]
                size = np.where(np.abs(channel) > 0, np.abs(channel), np.nan)
                style = {"color": CYCLE[k % len(CYCLE)], "linewidth": 1.6}
                panels[2 * i, j].loglog(frequencies, size, label=name, **style)
                phase = np.rad2deg(np.unwrap(np.angle(channel)))
                panels[2 * i + 1, j].semilogx(frequencies, phase, **style)
    for i, output in enumerate(outputs):
        panels[2 * i, 0].set_ylabel(f"|{output}|", fontsize=8.5)
        panels[2 * i + 1, 0].set_ylabel("phase [deg]", fontsize=8.5)
    for j, name in enumerate(inputs):
        panels[0, j].set_title(f"from {name}", fontsize=9)
        panels[-1, j].set_xlabel("frequency [Hz]")
    if len(models) > 1:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        add_legend(figure, handles, labels)
    return figure


def plot_nyquist(
    models: Mapping[str, LinearModel], frequencies: ArrayLike, *, title: str = "Nyquist"
) -> Figure:
    """Frequency response in the complex plane, one panel per channel.

    Args:
        models: by the name for the legend, with the same inputs and outputs.
        frequencies: positive ones [Hz]; the mirrored half is drawn dashed.
        title: of the figure.
    """
    omega = 2 * np.pi * np.asarray(frequencies, float)
    first = next(iter(models.values()))
    inputs, outputs = first.names.inputs, first.names.outputs
    figure, panels = new_figure(
        title,
        len(outputs),
        len(inputs),
        1.0 + 3.4 * len(outputs),
        squeeze=False,
    )
    for k, (name, model) in enumerate(models.items()):
        response = np.asarray(model.frequency_response(omega))
        style = {"color": CYCLE[k % len(CYCLE)], "linewidth": 1.5}
        for i in range(len(outputs)):
            for j in range(len(inputs)):
                axes, z = panels[i, j], response[:, i, j]
                axes.plot(np.real(z), np.imag(z), label=name, **style)
                axes.plot(np.real(z), -np.imag(z), "--", alpha=0.6, **style)
    for i, output in enumerate(outputs):
        for j, name in enumerate(inputs):
            axes = panels[i, j]
            axes.plot(-1.0, 0.0, "+", color=INK, ms=8)
            axes.set_title(f"{name} to {output}", fontsize=9)
            axes.set_xlabel("real part")
            axes.set_ylabel("imaginary part")
            axes.margins(x=0.05, y=0.05)
    if len(models) > 1:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        add_legend(figure, handles, labels)
    return figure
