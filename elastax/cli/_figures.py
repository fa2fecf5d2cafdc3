"""The pictures of a run, with titles and captions for the report."""

import numpy as np

from ..control import Run, rigid_tool_path
from ..dynamics import ElasticRobot
from ..plotting import (
    plot_cartesian_path,
    plot_deformations,
    plot_path_error,
    plot_perturbations,
    plot_pose_grid,
    plot_recording,
    plot_tool_deviation,
    plot_torques,
    plot_wrist_acceleration,
)
from ._grid import MOVES, Grid
from ._motion import Motion
from ._tables import path_error_ratios


def figures(
    robot: ElasticRobot,
    motion: Motion,
    runs: dict[str, Run],
    perturbed: dict | None,
    grid: Grid | None,
    report,
) -> list[tuple]:
    """Name, title, caption and figure of every picture of this run."""
    path = rigid_tool_path(robot, motion.reference)
    drawn = [
        (
            "path_error",
            "Path error",
            "Distance of the tool from where the rigid robot's tool would be on the "
            "same "
            "filtered reference. The dashed lines mark the end of the motion and of "
            "the criterion's window.",
            plot_path_error(runs),
        ),
        (
            "wrist_acceleration",
            "Acceleration after the stop",
            "Acceleration of the wrist centre in the base frame; criterion C "
            "integrates it over the shaded window.",
            plot_wrist_acceleration(runs),
        ),
        (
            "tool_deviation",
            "Deviation of the tool",
            "Components of the deviation in the base frame.",
            plot_tool_deviation(runs, path),
        ),
    ]
    if motion.waypoints is not None:
        drawn.append(
            (
                "cartesian_path",
                "Cartesian path",
                "The tool's path with magnified deviations, the sag at rest "
                "subtracted.",
                plot_cartesian_path(runs, path),
            )
        )
    if "asim" in runs and robot.elastic:
        drawn.append(
            (
                "deformations",
                "Deformations, predicted and simulated",
                "What ASIM computes from the rigid parallel model (dashed) against the "
                "elastic plant (solid), as in figures 3.23 and 3.24 of the text.",
                plot_deformations(robot, runs),
            )
        )
    drawn.append(
        (
            "torques",
            "Torques",
            "Motor torques on the motor side, gear torques on the output side.",
            plot_torques(robot, runs),
        )
    )
    if perturbed is not None and {"asim", "flexible_joint"} <= runs.keys():
        drawn.append(
            (
                "perturbation",
                "Wrong models",
                "Integrated path error of ASIM over that of the flexible-joint "
                "feed-forward when both know wrong parameters.",
                plot_perturbations(path_error_ratios(perturbed)),
            )
        )
    if grid is not None:
        moves = np.zeros((len(MOVES), robot.axes))
        moves[:, :3] = np.deg2rad(MOVES)[:, None]
        drawn.append(
            (
                "pose_grid",
                "Pose grid",
                "Criterion C over the start angles of A2 and A3 and the ratio of ASIM "
                "to "
                "the flexible-joint feed-forward, as in figures 6.6 and 6.7. A sign of "
                "a move is reversed where a limit forbids it.",
                plot_pose_grid(np.deg2rad(grid.poses), moves, grid.criterion),
            )
        )
    if report is not None:
        drawn.append(
            (
                "recording",
                "Recording",
                "Measured against predicted motor torque and wind-up of the gears.",
                plot_recording(**report.plot),
            )
        )
    return drawn
