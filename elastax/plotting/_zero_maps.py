"""Figures of zeros over the workspace and along a link."""

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from ..analysis import LinkZeros, ZeroMap
from ._style import INK, new_figure


def plot_zero_map(
    found: ZeroMap, *, axes: tuple[int, int] = (1, 2), title: str = "Zeros"
) -> Figure:
    """Largest real part of a zero, and the slowest zero on the right, over two axes.

    Every pose is a cell; poses without a relative degree are grey, poses whose zeros
    all lie on the left are white.

    Args:
        found: map over a grid of the two axes.
        axes: over which it is drawn, from 0.
        title: of the figure.
    """
    figures = found.figures
    regular = np.asarray(figures.regular)
    worst = np.asarray(figures.largest_real)
    slowest = np.asarray(figures.slowest_right)
    panels = [
        ("largest real part of a zero [1/s]", np.where(worst > 0, worst, np.nan)),
        (
            "right zero nearest to the origin [1/s]",
            np.where(np.isfinite(slowest), slowest, np.nan),
        ),
    ]
    return _maps(found, axes, title, panels, regular, logarithmic=True)


def plot_frequency_map(
    found: ZeroMap, *, axes: tuple[int, int] = (1, 2), title: str = "Locked motors"
) -> Figure:
    """First eigenfrequency with the motors locked, and its damping, over two axes.

    Args:
        found: map over a grid of the two axes.
        axes: over which it is drawn, from 0.
        title: of the figure.
    """
    panels = [
        ("first eigenfrequency [Hz]", np.asarray(found.figures.frequency)),
        ("damping ratio [%]", 100.0 * np.asarray(found.figures.damping_ratio)),
    ]
    return _maps(found, axes, title, panels, None, logarithmic=False)


def _maps(found: ZeroMap, axes, title, panels, regular, *, logarithmic: bool) -> Figure:
    angles = np.rad2deg(np.asarray(found.poses))
    first, second = axes
    across, up = np.unique(angles[:, first]), np.unique(angles[:, second])
    column = np.searchsorted(across, angles[:, first])
    row = np.searchsorted(up, angles[:, second])
    figure, drawn = new_figure(title, 1, len(panels), 4.3, sharey=True)
    for panel, (label, values) in zip(drawn, panels):
        grid = np.full((len(up), len(across)), np.nan)
        grid[row, column] = values
        panel.grid(False)
        if regular is not None:
            mask = np.full(grid.shape, np.nan)
            mask[row[~regular], column[~regular]] = 1.0
            grid = np.where(np.isfinite(mask), np.nan, grid)
            panel.pcolormesh(
                across,
                up,
                mask,
                cmap="Greys",
                norm=Normalize(0.0, 2.0),
                shading="nearest",
            )
        some = grid[np.isfinite(grid)]
        if some.size:
            low, high = np.percentile(some, [1, 99])
            norm = LogNorm(low, high) if logarithmic else Normalize(low, high)
            image = panel.pcolormesh(
                across, up, grid, cmap="viridis", norm=norm, shading="nearest"
            )
            figure.colorbar(
                image, ax=panel, location="bottom", label=label, extend="both"
            )
        panel.set_xlabel(f"A{first + 1} [deg]")
    drawn[0].set_ylabel(f"A{second + 1} [deg]")
    return figure


def plot_zeros_along_link(
    found: LinkZeros, *, title: str = "Zeros over the place of the output"
) -> Figure:
    """Zeros in the complex plane, coloured by the place of the output, and over it.

    Args:
        found: zeros for outputs along a link.
        title: of the figure.

    References:
        [Reiner2010] figures 3.4, 3.5.
    """
    place = np.asarray(found.positions)
    share = place / place[-1]
    zeros, poles = np.asarray(found.zeros), np.asarray(found.poles)
    figure, (plane, over) = new_figure(title, 1, 2, 4.6)
    colour = np.repeat(share[:, None], zeros.shape[1], axis=1)
    limit = 1.6 * np.abs(poles).max()
    image = plane.scatter(
        np.real(zeros), np.imag(zeros), c=colour, cmap="turbo", s=9, vmin=0.0, vmax=1.0
    )
    plane.plot(np.real(poles), np.imag(poles), "x", color=INK, ms=7, label="poles")
    plane.set_xlim(-limit, limit)
    plane.set_ylim(-limit, limit)
    plane.locator_params(axis="x", nbins=5)  # labels of thousands are long
    plane.set_xlabel("real part [1/s]")
    plane.set_ylabel("imaginary part [rad/s]")
    plane.legend(fontsize=9, frameon=False, loc="upper left")
    figure.colorbar(image, ax=plane, location="bottom", label="place over length [-]")
    for k in range(zeros.shape[1]):
        over.plot(share, np.real(zeros[:, k]), ".", color="#4477aa", ms=3)
    critical = found.critical_position() / place[-1]
    if np.isfinite(critical):
        over.axvline(critical, color="#cc3311", linewidth=1.2)
        over.annotate(
            f"first right zero at {critical:.3f}",
            (critical, 0.97),
            (5 if critical < 0.6 else -5, 0),
            ha="left" if critical < 0.6 else "right",
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=9,
            va="top",
            color="#cc3311",
        )
    over.set_ylim(-limit, limit)
    over.axhline(0.0, color=INK, linewidth=0.8)
    over.set_xlabel("place of the output over the length [-]")
    over.set_ylabel("real parts of the zeros [1/s]")
    return figure
