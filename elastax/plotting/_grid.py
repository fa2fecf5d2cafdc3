"""Figures of the criterion over the workspace."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from ._style import INK, WIDTH, label_of, line_of, new_figure, short_label


_MOST_NUMBERS = 42  # poses up to which the ratios are written beside the circles


def plot_pose_grid(
    poses: ArrayLike,
    moves: ArrayLike,
    criterion: Mapping[str, ArrayLike],
    *,
    axes: tuple[int, int] = (1, 2),
    numerator: str = "asim",
    denominator: str = "flexible_joint",
) -> Figure:
    """Criterion C over the start angles of two axes, and the ratio of two inverses.

    One row per move; between the computed poses (circles) C is interpolated. The
    inverses of a row share one scale, and all ratios share one: blue is better than
    one, red is worse.

    Args:
        poses: start poses in the maker's angles, shape (poses, axes) [rad].
        moves: differences of the maker's angles, shape (moves, axes) [rad].
        criterion: C by the name of the inverse, shape (moves, poses) [m/s].
        axes: over which C is drawn, from 0.
        numerator, denominator: inverses of the ratio; it is left out if one is absent.

    Raises:
        ValueError: shapes that contradict each other.

    References:
        [Reiner2010] figures 6.6, 6.7.
    """
    poses, moves = np.asarray(poses, float), np.rad2deg(np.asarray(moves, float))
    points = np.rad2deg(poses[:, list(axes)])
    values = {name: np.asarray(c, float) for name, c in criterion.items()}
    for name, c in values.items():
        if c.shape != (len(moves), len(points)):
            raise ValueError(
                f"`criterion` must have the shape (moves, poses) = "
                f"{(len(moves), len(points))}, but that of {name} is {c.shape}"
            )
    if not values:
        raise ValueError("`criterion` must hold at least one inverse, but is empty")
    with_ratio = numerator in values and denominator in values
    columns = len(values) + with_ratio
    figure, panels = new_figure(
        "Criterion C over the start pose",
        len(moves),
        columns,
        1.0 + 2.6 * len(moves),
        width=max(WIDTH, 3.0 * columns),
        sharex=True,
        sharey=True,
    )
    panels = np.reshape(panels, (len(moves), columns))
    for row, line in enumerate(panels):
        norm = _log_norm(np.stack([c[row] for c in values.values()]))
        levels = np.geomspace(*_ends(norm), 19)
        drawn = [
            _contours(panel, points, c[row], levels, norm, "cividis")
            for panel, c in zip(line, values.values())
        ]
        _colour_bar(figure, drawn[0], line[: len(values)], "C [m/s]")
        line[0].set_ylabel(f"{_move_name(moves[row])}\nA{axes[1] + 1} [deg]")
    for panel, name in zip(panels[0], values):
        panel.set_title(label_of(name), fontsize=10, color=line_of(name)["color"])
    if with_ratio:
        ratios = values[numerator] / values[denominator]
        _draw_ratios(figure, panels[:, -1], points, ratios)
        text = f"C, {short_label(numerator)} over {short_label(denominator)}"
        panels[0, -1].set_title(text, fontsize=10, color=INK)
    for panel in panels[-1]:
        panel.set_xlabel(f"A{axes[0] + 1} [deg]")
    return figure


def _draw_ratios(figure: Figure, panels, points, ratios) -> None:
    top = float(np.nanmax(ratios, initial=0.0))
    if top > 1:
        norm, colours = TwoSlopeNorm(1.0, 0.0, top), "RdBu_r"
        levels = np.concatenate([np.linspace(0, 1, 11), np.linspace(1, top, 6)[1:]])
    else:
        norm, colours = Normalize(0.0, top or 1.0), "Blues_r"
        levels = np.linspace(0.0, top or 1.0, 13)
    for panel, ratio in zip(panels, ratios):
        drawn = _contours(panel, points, ratio, levels, norm, colours)
        _colour_bar(figure, drawn, [panel], "ratio [-]")
        if len(points) > _MOST_NUMBERS:
            continue
        for point, value in zip(points, ratio):
            if np.isfinite(value):
                _number(panel, point, f"{value:.2f}", points)


def _number(panel: Axes, point, text: str, points) -> None:
    """Number beside a circle, on the side that lies inside the panel."""
    low, high = points.min(axis=0), points.max(axis=0)
    left, right = np.isclose(point[0], low[0]), np.isclose(point[0], high[0])
    below = np.isclose(point[1], high[1])
    panel.annotate(
        text,
        point,
        (5 * (int(left) - int(right)), -5 if below else 5),
        textcoords="offset points",
        ha="left" if left else "right" if right else "center",
        va="top" if below else "bottom",
        fontsize=7,
        color=INK,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6},
        zorder=4,
    )


def _ends(norm: Normalize) -> tuple[float, float]:
    """Values at the ends of a scale."""
    if norm.vmin is None or norm.vmax is None:
        raise ValueError("the scale must have both ends, but lacks one")
    return float(norm.vmin), float(norm.vmax)


def _log_norm(values: np.ndarray) -> LogNorm:
    positive = values[np.isfinite(values) & (values > 0)]
    if not positive.size:
        return LogNorm(0.1, 1.0)
    low, high = float(positive.min()), float(positive.max())
    return LogNorm(low / 1.05, max(high, 1.2 * low) * 1.05)


def _contours(panel: Axes, points, values, levels, norm, colours):
    """Contours through scattered points; circles alone where these span no area."""
    known = np.isfinite(values)
    x, y = points[known].T
    values = values[known]
    style = {"norm": norm, "cmap": colours}
    centred = points[known] - points[known].mean(axis=0) if known.any() else points[:0]
    if len(centred) > 2 and np.linalg.matrix_rank(centred, tol=1e-6) == 2:
        panel.tricontourf(x, y, values, levels=levels, extend="both", **style)
        thin = {"colors": "white", "linewidths": 0.4}
        panel.tricontour(x, y, values, levels=levels[1:-1], **thin)
        panel.set_xlim(x.min(), x.max())
        panel.set_ylim(y.min(), y.max())
    else:
        panel.margins(0.1)
    circles = {"s": 22, "edgecolors": "black", "linewidths": 0.7, "clip_on": False}
    return panel.scatter(x, y, c=values, zorder=3, **circles, **style)


def _colour_bar(figure: Figure, drawn, panels, label: str) -> None:
    bar = figure.colorbar(drawn, ax=list(panels), pad=0.02, aspect=18)
    bar.set_label(label, fontsize=9.5)
    low, high = _ends(drawn.norm)
    if isinstance(drawn.norm, LogNorm):
        ticks = np.geomspace(1.05 * low, high / 1.05, 5)
    elif isinstance(drawn.norm, TwoSlopeNorm):
        ticks = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 0.5 + 0.5 * high, high])
    else:
        ticks = np.asarray(MaxNLocator(5).tick_values(low, high))
        ticks = ticks[ticks <= high]
    bar.minorticks_off()
    bar.set_ticks(ticks.tolist(), labels=[f"{tick:.2g}" for tick in ticks])
    bar.ax.tick_params(labelsize=8.5)


def _move_name(move: np.ndarray) -> str:
    """Such as "A1 to A3: +5 deg"; equal differences are told once."""
    moving = [k for k, value in enumerate(move) if abs(value) > 1e-6]
    if not moving:
        return "no move"
    if len(moving) > 1 and np.ptp(move[moving]) < 1e-6:
        consecutive = moving[-1] - moving[0] == len(moving) - 1
        names = (
            f"A{moving[0] + 1} to A{moving[-1] + 1}"
            if consecutive
            else ", ".join(f"A{k + 1}" for k in moving)
        )
        return f"{names}: {move[moving[0]]:+.4g}°"
    return ", ".join(f"A{k + 1} {move[k]:+.4g}°" for k in moving)
