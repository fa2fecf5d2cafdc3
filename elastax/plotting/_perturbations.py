"""Figures of feed-forward with wrong parameters."""

from collections.abc import Mapping

import numpy as np
from jax.typing import ArrayLike
from matplotlib.figure import Figure

from ._style import COLOURS, INK, add_legend, legend_of, new_figure


def plot_perturbations(
    ratios: Mapping[str, ArrayLike], *, limit: float | int | None = None
) -> Figure:
    """Path error of ASIM over that of the flexible-joint inverse, by wrong parameters.

    Args:
        ratios: by the name of the case, the nominal one first.
        limit: marked if given.
    """
    values = np.array([float(np.asarray(value)) for value in ratios.values()])
    height = 1.4 + 0.36 * len(values)
    title = "Path error when the model is wrong: ASIM over flexible joint (RLFJ)"
    figure, axes = new_figure(title, 1, 1, height)
    places = np.arange(len(values))
    shades = [COLOURS["asim"]] + ["#e59a87"] * (len(values) - 1)
    axes.barh(places, values, color=shades, height=0.62, zorder=2)
    for place, value in zip(places, values):
        axes.annotate(
            f"{value:.3g}",
            (value, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=9,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        )
    blue = COLOURS["flexible_joint"]
    axes.axvline(1, color=blue, lw=1.4, label="RLFJ = 1", zorder=1)
    if limit is not None:
        axes.axvline(
            limit, color=INK, lw=1.0, ls="--", label=f"limit {limit:g}", zorder=3
        )
    axes.set_yticks(places, list(ratios))
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlim(0, 1.12 * max(1.0, float(np.nanmax(values))))
    axes.set_xlabel("ratio of the integrated path errors [-]")
    add_legend(figure, *legend_of(axes))
    return figure
