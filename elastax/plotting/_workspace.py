"""Figures of the workspace in the plane through axis 1."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ._style import CYCLE, INK, add_legend, legend_of, new_figure


_REACH = "#dce6f2"
_GROUND = "#b5ad9d"


def plot_reach_section(
    points: ArrayLike,
    edges: Mapping[str, ArrayLike],
    *,
    sticks: Mapping[str, ArrayLike] | None = None,
    point: str = "wrist centre",
) -> Figure:
    """What a point of the arm reaches in the x-z plane, and what bounds it.

    Args:
        points: positions for every pair of angles of axes 2 and 3, shape (n, m, 2): x
            and z [m].
        edges: curves at which the arm is stretched, folded or at a limit, by what they
            are, each of shape (k, 2) [m].
        sticks: arm in some poses, by what they are, each of shape (k, 2) [m].
        point: of the arm that reaches there.
    """
    points = np.asarray(points, float)
    lines = [np.asarray(line, float) for line in (sticks or {}).values()]
    figure, axes = _section(
        f"Reach of the {point}, section y = 0",
        np.concatenate([points.reshape(-1, 2), *lines]),
        legend=0.7,
    )
    # one colour for all cells: the fold of the map at the stretched arm does not show
    axes.pcolormesh(
        points[..., 0],
        points[..., 1],
        np.zeros(points.shape[:2]),
        cmap=ListedColormap([_REACH]),
        shading="gouraud",
        rasterized=True,
    )
    _edges(axes, edges)
    for k, (name, line) in enumerate((sticks or {}).items()):
        x, z = np.asarray(line, float).T
        shade = 0.25 + 0.2 * k
        axes.plot(x, z, "-o", color=str(shade), lw=2.6, ms=5, mec="white", label=name)
    add_legend(figure, *legend_of(axes), columns=3)
    return figure


def plot_dexterity_section(
    x: ArrayLike,
    z: ArrayLike,
    value: ArrayLike,
    *,
    edges: Mapping[str, ArrayLike] | None = None,
    notes: Mapping[str, tuple[float, float]] | None = None,
    label: str,
    title: str,
) -> Figure:
    """A measure of dexterity over positions in the x-z plane; white where it is NaN.

    Args:
        x, z: positions [m], shapes (n,) and (m,).
        value: measure, shape (m, n); NaN where nothing is reached.
        edges: curves, by what they are, each of shape (k, 2) [m].
        notes: remarks, by the text, and where they point to, x and z [m].
        label: of the measure, with its unit.
        title: of the figure.
    """
    value = np.ma.masked_invalid(np.asarray(value, float))
    columns, rows = np.meshgrid(x, z)
    known = ~np.ma.getmaskarray(value)
    places = np.stack([columns[known], rows[known]], axis=1)
    figure, axes = _section(title, places, legend=0.4 if edges else 0.0, bar=1.1)
    top = float(value.max()) if value.count() else 1.0
    drawn = axes.pcolormesh(
        np.asarray(x),
        np.asarray(z),
        value,
        cmap="viridis",
        vmin=0.0,
        vmax=top or 1.0,
        shading="nearest",
        rasterized=True,
    )
    if value.count() > 4 and top > 0:
        levels = np.linspace(0.0, top, 9)[1:-1]
        axes.contour(x, z, value, levels=levels, colors="white", linewidths=0.5)
    _edges(axes, edges or {})
    for text, place in (notes or {}).items():
        axes.annotate(
            text,
            place,
            (22, 26),
            textcoords="offset points",
            fontsize=8.5,
            color=INK,
            bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.5},
            arrowprops={"arrowstyle": "-", "color": INK, "lw": 0.8, "shrinkB": 0},
        )
    bar = figure.colorbar(drawn, ax=axes, pad=0.02, aspect=30)
    bar.set_label(label, fontsize=9.5)
    bar.ax.tick_params(labelsize=8.5)
    if edges:
        add_legend(figure, *legend_of(axes), columns=3)
    return figure


def _edges(axes: Axes, edges: Mapping[str, ArrayLike]) -> None:
    for k, (name, curve) in enumerate(edges.items()):
        x, z = np.asarray(curve, float).T
        axes.plot(x, z, color=CYCLE[k % len(CYCLE)], lw=1.8, label=name)


def _section(
    title: str,
    points: np.ndarray,
    *,
    legend: float | int = 0.0,
    bar: float | int = 0.0,
) -> tuple[Figure, Axes]:
    """Figure of the x-z plane of the size of its content: axis 1, floor, one scale.

    Args:
        title: of the figure.
        points: that must be inside, shape (k, 2) [m].
        legend, bar: room for what stands below and beside [inch].
    """
    inside = np.concatenate([points, np.zeros((1, 2))])
    low, high = inside.min(axis=0), inside.max(axis=0)
    room = 0.05 * float(np.max(high - low)) + 1e-3
    wide, tall = high - low + 2 * room
    width = float(np.clip(5.6 * wide / tall, 4.0, 8.5))
    figure, axes = new_figure(
        title, 1, 1, width * tall / wide + 0.9 + legend, width=width + 0.8 + bar
    )
    axes.axvline(0.0, color=INK, lw=0.7, ls=(0, (6, 3, 1, 3)))
    axes.axhline(0.0, color=_GROUND, lw=1.2, zorder=0.5)
    axes.set_aspect("equal", adjustable="box")
    axes.set_autoscale_on(False)
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("z [m]")
    return figure, axes
