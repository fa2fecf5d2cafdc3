"""What all figures share: canvas, colours, labels, the marked window, saving."""

import pathlib
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..analysis import WINDOW
from ..control import Run


DPI = 120
WIDTH = 8.6  # [inch]
LABELS = {"rigid": "rigid", "flexible_joint": "flexible joint (RLFJ)", "asim": "ASIM"}
# distinct in lightness and for the colour blind (P. Tol, "vibrant" and "bright")
COLOURS = {"rigid": "#8c8c8c", "flexible_joint": "#0077bb", "asim": "#cc3311"}
WIDTHS = {"rigid": 2.2, "flexible_joint": 1.8, "asim": 1.3}
CYCLE = ("#4477aa", "#ee6677", "#228833", "#aa3377", "#ccbb44", "#66ccee")
INK = "#333333"
BASE_AXES = "xyz"
FRAME = {"frameon": True, "framealpha": 0.85, "edgecolor": "none", "borderpad": 0.2}


def save_figure(figure: Figure, path: str | pathlib.Path) -> None:
    """Write a figure as PNG at 120 dpi."""
    figure.savefig(path, format="png", dpi=DPI)


def new_figure(title, rows, columns, height, width=WIDTH, **options):
    """Figure with its own canvas, and its panels."""
    ratios = options.pop("width_ratios", None)
    figure = Figure((width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained", w_pad=0.08, h_pad=0.05)
    figure.suptitle(
        title, fontsize=11.5, fontweight="bold", x=0.01, ha="left", color=INK
    )
    panels = figure.subplots(rows, columns, width_ratios=ratios, **options)
    for axes in np.ravel(panels):
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color("#999999")
        axes.grid(color="#e6e6e6", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=9, color="#999999")
        axes.set_prop_cycle(color=CYCLE)
        axes.margins(x=0)
        axes.xaxis.label.set_size(9.5)
        axes.yaxis.label.set_size(9.5)
    figure.align_ylabels()
    return figure, panels


def legend_of(axes: Axes) -> tuple[list[Line2D], list[str]]:
    """Handles, of one width, and labels of what a panel shows."""
    handles, labels = axes.get_legend_handles_labels()
    lines = []
    for handle in handles:
        assert isinstance(handle, Line2D), "legends are made of lines"
        style = {"color": handle.get_color(), "linestyle": handle.get_linestyle()}
        lines.append(Line2D([], [], linewidth=2.2, **style))
    return lines, labels


def add_legend(figure: Figure, handles, labels, columns: int | None = None) -> None:
    """One legend below all panels."""
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=columns or len(labels),
        fontsize=9,
        frameon=False,
    )


def label_of(name: str) -> str:
    """Name of an inverse in legends."""
    return LABELS.get(name, name.replace("_", " "))


def short_label(name: str) -> str:
    """Name of an inverse where there is little room."""
    return "RLFJ" if name == "flexible_joint" else label_of(name)


def line_of(name: str) -> dict:
    """Colour and width of an inverse; the better ones are drawn thinner, on top."""
    return {"color": COLOURS.get(name, CYCLE[2]), "linewidth": WIDTHS.get(name, 1.3)}


def rest_time(runs: Mapping[str, Run]) -> float:
    """Time t_0 at which the reference comes to rest [s]."""
    return float(next(iter(runs.values())).judgement.rest_time)


def mark_window(axes: Axes, runs: Mapping[str, Run], *, text: bool = False) -> None:
    """Shade the window of the judgement, mark its ends, end the time axis behind it."""
    start = rest_time(runs)
    axes.axvspan(start, start + WINDOW, color="#f4f1e6", zorder=0, linewidth=0)
    ends = (
        (start, "$t_0$", "left"),
        (start + WINDOW, f"$t_0$ + {WINDOW:g} s", "right"),
    )
    last = max(float(run.simulation.times[-1]) for run in runs.values())
    axes.set_xlim(right=min(last, start + 1.05 * WINDOW))
    for time, name, side in ends:
        axes.axvline(time, color="#8a8468", linewidth=0.9, linestyle=(0, (3, 2)))
        if text:
            axes.annotate(
                name,
                (time, 1.0),
                (3 if side == "left" else -3, -2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha=side,
                va="top",
                fontsize=9,
                color="#6b664f",
            )
