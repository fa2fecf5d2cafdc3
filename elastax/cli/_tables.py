"""Tables of the command line."""

import numpy as np

from ..control import Run
from ..dynamics import ElasticRobot
from ..io import format_table
from ._grid import MOVES, Grid


LABELS = {"rigid": "rigid", "flexible_joint": "flexible joint", "asim": "ASIM"}


def runs_table(robot: ElasticRobot, runs: dict[str, Run], cost: dict) -> str:
    """Figures of every feed-forward, as in table 6.1 and with the criterion."""
    shown = min(3, robot.axes)
    columns = [
        "feed-forward",
        "path error [mm s]",
        "less offset [mm s]",
        "largest [mm]",
        "C [m/s]",
        "settling [s]",
        f"motor torque {' '.join(robot.axis_names[:shown])} [N m]",
        "us/sample",
    ]
    rows = []
    for name, run in runs.items():
        j = run.judgement
        rows.append(
            [
                LABELS[name],
                f"{1e3 * float(j.path_error_integral):.3f}",
                f"{1e3 * float(j.path_error_integral_relative):.3f}",
                f"{1e3 * float(j.path_error_max):.3f}",
                f"{float(j.criterion):.4f}",
                f"{float(j.settling_time):.3f}",
                " ".join(f"{float(t):.1f}" for t in j.peak_motor_torque[:shown]),
                f"{1e6 * cost[name]['seconds_per_sample']:.0f}",
            ]
        )
    lines = [format_table(rows, columns)]
    if {"asim", "flexible_joint"} <= runs.keys():
        asim, other = runs["asim"].judgement, runs["flexible_joint"].judgement
        fields = {
            "path error": "path_error_integral",
            "less offset": "path_error_integral_relative",
            "largest": "path_error_max",
            "C": "criterion",
        }
        ratios = [
            f"{label} {float(getattr(asim, f)) / float(getattr(other, f)):.3f}"
            for label, f in fields.items()
        ]
        lines.append("ASIM over flexible joint: " + ", ".join(ratios))
    for name in runs:
        if "step_median_s" in cost[name]:
            median, p99 = (1e6 * cost[name][k] for k in ("step_median_s", "step_p99_s"))
            lines.append(
                f"one step of {LABELS[name]}: median {median:.0f} us, p99 {p99:.0f} us"
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
    return format_table(rows, columns)


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
    return format_table(
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
