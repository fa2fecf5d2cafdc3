"""Tables of the command line."""

import numpy as np

from ..dynamics import ElasticRobot
from ..io import FEEDFORWARD_COLUMNS, Column, feedforward_rows, format_table
from ._grid import MOVES, Grid


LABELS = {"rigid": "rigid", "flexible_joint": "flexible joint", "asim": "ASIM"}


def table(rows: list[list[str]], titles: list[str]) -> str:
    """Aligned table of ready texts under titles."""
    columns = [Column(title, title) for title in titles]
    return format_table([dict(zip(titles, row)) for row in rows], columns)


def runs_table(robot: ElasticRobot, result: dict) -> str:
    """Figures of every feed-forward, as in table 6.1 and with the criterion."""
    inverses = result["inverses"]
    lines = [format_table(feedforward_rows(result), FEEDFORWARD_COLUMNS)]
    if {"asim", "flexible_joint"} <= inverses.keys():
        asim, other = inverses["asim"], inverses["flexible_joint"]
        pairs = {"largest error": "path_error_max", "C": "criterion"}
        ratios = [f"{label} {asim[f] / other[f]:.3f}" for label, f in pairs.items()]
        lines.append("ASIM over flexible joint (RLFJ): " + ", ".join(ratios))
    shown = min(3, robot.axes)
    axes = ", ".join(robot.axis_names[:shown])
    for name, figures in inverses.items():
        motors = ", ".join(f"{t:.1f}" for t in figures["peak_motor_torque"][:shown])
        gears = ", ".join(f"{t:.0f}" for t in figures["peak_gear_torque"][:shown])
        lines.append(
            f"{LABELS[name]}: peak torque of {axes} at the motors {motors} N m, "
            f"at the gears {gears} N m"
        )
        if "step_median_s" in figures:
            names = ("step_median_s", "step_p99_s", "step_p999_s")
            p50, p99, p999 = (1e6 * figures[k] for k in names)
            lines.append(
                f"  streamed: median {p50:.0f} us a step, p99 {p99:.0f} us, "
                f"p99.9 {p999:.0f} us"
            )
    return "\n".join(lines)


def path_error_ratios(perturbed: dict) -> dict[str, float]:
    """Integrated path error of ASIM over that of the flexible joint, per case."""
    return {
        case: row["asim"]["path_error_integral"]
        / row["flexible_joint"]["path_error_integral"]
        for case, row in perturbed.items()
    }


def perturbation_table(perturbed: dict) -> str:
    """Path errors with wrong models."""
    names = list(next(iter(perturbed.values())))
    both = {"asim", "flexible_joint"} <= set(names)
    ratios = path_error_ratios(perturbed) if both else {}
    rows = [
        [
            case,
            *(f"{1e3 * row[name]['path_error_integral']:.3f}" for name in names),
            *(f"{row[name]['criterion']:.4f}" for name in names),
            *([f"{ratios[case]:.3f}"] if both else []),
        ]
        for case, row in perturbed.items()
    ]
    columns = ["model"]
    columns += [f"{LABELS[name]} [mm s]" for name in names]
    columns += [f"C {LABELS[name]} [m/s]" for name in names]
    columns += ["ASIM / fl. joint"] if both else []
    return table(rows, columns)


def grid_lines(grid: Grid) -> list[str]:
    """Medians of the criterion over the grid, and poses where ASIM is worse."""
    lines = []
    ratio = grid.ratio()
    for k, move in enumerate(MOVES):
        medians = ", ".join(
            f"{LABELS[n]} {np.median(c[k]):.4f}" for n, c in grid.criterion.items()
        )
        lines.append(f"grid, moves of {move:g} deg: median C [m/s] {medians}")
        if ratio is None:
            continue
        lines.append(
            f"  C(ASIM)/C(flexible joint): median {np.median(ratio[k]):.3f}, "
            f"largest {ratio[k].max():.3f}"
        )
        for pose, value in zip(grid.poses, ratio[k]):
            if value > 1:
                angles = ", ".join(f"{a:g}" for a in pose)
                lines.append(f"  above 1 at ({angles}) deg: {value:.3f}")
    return lines


def recording_table(summary: dict) -> str:
    """Skew, torque and wind-up of a recording, per axis."""
    torque, windup = summary["torque"], summary["windup"]
    rows = []
    for k, axis in enumerate(summary["axes"]):
        rows.append(
            [
                f"A{axis}",
                _number(summary["skew_s"], k, 1e3, 3),
                _number(torque["r2"], k, 1, 4),
                _number(torque["rms"], k, 1, 3),
                _number(torque["r2_raw"], k, 1, 4),
                _number(torque["stored_r2"], k, 1, 4),
                _number(torque["stored_rms"], k, 1, 3),
                _number(windup["r2"], k, 1, 3),
                _number(windup["rms"], k, 1e3, 4),
            ]
        )
    return table(
        rows,
        [
            "axis",
            "skew [ms]",
            "torque R2",
            "rms [N m]",
            "R2 raw",
            "stored R2",
            "stored rms [N m]",
            "wind-up R2",
            "rms [mrad]",
        ],
    )


def _number(values, k: int, factor: float, digits: int) -> str:
    if values is None or values[k] is None:
        return "-"
    return f"{factor * values[k]:.{digits}f}"
