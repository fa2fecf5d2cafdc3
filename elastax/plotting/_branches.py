"""Figures of the branches of an inverse: stick figures, and angles along a path."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ._style import CYCLE, INK, add_legend, new_figure


_HAND = 0.45  # length of the arrow along an axis [m]
_REFUSED = "#b0b0b0"


def plot_branches(
    points: ArrayLike,
    arrows: ArrayLike,
    angles: ArrayLike,
    allowed: ArrayLike,
    *,
    names: Sequence[str],
    view: tuple[float, float] = (-20.0, 18.0),
    title: str = "Branches of one pose",
) -> Figure:
    """Arms that all hold the same pose, one panel each.

    Args:
        points: along each arm, from the base to the tool, shape (branches, k, 3) [m].
        arrows: axis that tells flipped wrists apart, drawn from the last point but
            one, shape (branches, 3).
        angles: in the maker's sense [rad], shape (branches, axes).
        allowed: whether the limits hold, shape (branches,); others are drawn in grey.
        names: of the branches.
        view: azimuth and height of the eye [deg].
        title: of the figure.
    """
    points, arrows = np.asarray(points, float), np.asarray(arrows, float)
    degrees = np.rad2deg(np.asarray(angles, float))
    onto = _projection(*view)
    flat = points @ onto.T
    columns = 4
    rows = -(-len(points) // columns)
    figure, panels = new_figure(title, rows, columns, 0.9 + 3.4 * rows, width=11.0)
    panels = np.ravel(panels)
    span = flat.reshape(-1, 2)
    for k, panel in enumerate(panels):
        if k >= len(points):
            panel.set_visible(False)
            continue
        colour = CYCLE[k // 2 % len(CYCLE)] if np.asarray(allowed)[k] else _REFUSED
        _ground(panel, onto, float(np.abs(points[..., :2]).max()))
        panel.plot(*flat[k].T, "-", color=colour, lw=3.5, solid_capstyle="round")
        panel.plot(*flat[k].T, "o", color="white", mec=colour, ms=5, mew=1.4)
        centre = points[k, -2]
        tip = (centre + _HAND * arrows[k]) @ onto.T
        arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.4, "shrinkA": 0}
        panel.annotate("", tuple(tip), tuple(flat[k, -2]), arrowprops=arrow)
        panel.plot(*flat[k, -1:].T, "*", color=INK, ms=9)
        panel.set_title(names[k], fontsize=9, loc="left", color=INK)
        note = "  ".join(f"{angle + 0.0:.0f}°" for angle in np.round(degrees[k]))
        suffix = " " if np.asarray(allowed)[k] else "beyond a limit"
        panel.set_xlabel(f"{note}\n{suffix}", fontsize=8.5)
        panel.set_aspect("equal")
        panel.set_xlim(span[:, 0].min() - 0.3, span[:, 0].max() + 0.3)
        panel.set_ylim(span[:, 1].min() - 0.3, span[:, 1].max() + 0.3)
        panel.set_xticks([])
        panel.set_yticks([])
        panel.spines[["left", "bottom"]].set_visible(False)
    arrow = Line2D([], [], color=INK, lw=1.4, marker=">", markevery=[1], ms=6)
    arrow.set_data([0, 1], [0, 0])
    star = Line2D([], [], color=INK, marker="*", ls="", ms=9)
    add_legend(figure, [arrow, star], ["axis 5", "tool"])
    return figure


def plot_branch_path(
    way: ArrayLike,
    angles: ArrayLike,
    allowed: ArrayLike,
    limits: ArrayLike,
    *,
    axis_names: Sequence[str],
    branch_names: Sequence[str],
    title: str = "Branches along a path",
) -> Figure:
    """Angles of every branch along a path; dashed where a limit is broken.

    Args:
        way: length of the path so far [m], shape (times,).
        angles: in the maker's sense [rad], shape (branches, times, axes); NaN where the
            path is not reached.
        allowed: whether all limits hold, shape (branches, times).
        limits: lower and upper [rad], shape (2, axes).
        axis_names: of the axes.
        branch_names: of the branches.
        title: of the figure.
    """
    way, allowed = np.asarray(way, float), np.asarray(allowed, bool)
    degrees = np.rad2deg(np.asarray(angles, float))
    limits = np.rad2deg(np.asarray(limits, float))
    number = degrees.shape[2]
    columns = 3
    rows = -(-number // columns)
    figure, panels = new_figure(
        title, rows, columns, 1.4 + 2.4 * rows, width=10.5, sharex=True
    )
    panels = np.ravel(panels)
    for axis, panel in enumerate(panels[:number]):
        for k, branch in enumerate(degrees):
            style = {"color": _colour(k), "lw": 2.0 if k % 2 == 0 else 1.2}
            inside = np.where(allowed[k], branch[:, axis], np.nan)
            panel.plot(way, branch[:, axis], ls=(0, (1, 2)), alpha=0.6, **style)
            panel.plot(way, inside, **style)
        low, high = panel.get_ylim()
        for limit in limits[:, axis]:
            if low - 60 < limit < high + 60:
                panel.axhline(limit, color=INK, lw=0.8, ls=(0, (5, 3)))
        panel.set_title(axis_names[axis], fontsize=9.5, loc="left", color=INK)
        panel.set_ylabel("angle [deg]")
    for panel in panels[number:]:
        panel.set_visible(False)
    for panel in panels[max(0, number - columns) : number]:
        panel.set_xlabel("way along the path [m]")
    handles = [
        Line2D([], [], color=_colour(k), lw=2.0 if k % 2 == 0 else 1.2)
        for k in range(len(degrees))
    ]
    handles.append(Line2D([], [], color=INK, lw=0.8, ls=(0, (5, 3))))
    add_legend(figure, handles, [*branch_names, "limit"], columns=5)
    return figure


def _colour(branch: int) -> str:
    """Pairs of wrists share their hue; the second is lighter."""
    return _SECOND[branch // 2 % 4] if branch % 2 else CYCLE[branch // 2 % 4]


_SECOND = ("#a3bad6", "#f6b3bc", "#8fc199", "#d499b9")


def _projection(azimuth: float, height: float) -> np.ndarray:
    """Rows: directions to the right and upwards in the picture."""
    a, h = np.deg2rad([azimuth, height])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.array([-np.sin(h) * np.cos(a), -np.sin(h) * np.sin(a), np.cos(h)])
    return np.stack([right, up])


def _ground(panel: Axes, onto: np.ndarray, size: float) -> None:
    """Lines of the floor, a metre apart."""
    edge = np.ceil(size)
    for at in np.arange(-edge, edge + 1):
        for line in (
            [[at, -edge, 0.0], [at, edge, 0.0]],
            [[-edge, at, 0.0], [edge, at, 0.0]],
        ):
            panel.plot(*(np.array(line) @ onto.T).T, color="#ececec", lw=0.7, zorder=0)
    panel.grid(False)
