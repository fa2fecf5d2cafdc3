"""Criterion over a grid of poses of A2 and A3, all poses of an inverse in one call."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from .._devices import over_devices
from ..control import CascadeMotorControl, run_feedforward
from ..dynamics import ElasticRobot
from ..inverse import AbstractInverse
from ._arguments import FeedforwardConfig
from ._motion import (
    allowed_move,
    move_reference,
    point_to_point,
    reference_filter,
    reference_order,
    resolve_pose,
    rounded,
    settling,
)
from ._progress import Progress


MOVES = (5.0, 20.0)  # [deg] on three axes, figures 6.1 to 6.8
SPAN = 70.0  # [deg] of A2 and of A3, from the stretched arm; the text prints no range


@dataclasses.dataclass(frozen=True)
class Grid:
    """Figures over the grid.

    Attributes:
        a2, a3: start angles [deg], shape (poses,).
        poses: start poses in the maker's angles [deg], (poses * poses, axes).
        moves: what was moved [deg], (2, poses * poses, axes).
        criterion: per inverse C [m/s], (2, poses * poses).
        path_error_integral: per inverse [m s], same shape.
    """

    a2: np.ndarray
    a3: np.ndarray
    poses: np.ndarray
    moves: np.ndarray
    criterion: dict[str, np.ndarray]
    path_error_integral: dict[str, np.ndarray]

    def ratio(self) -> np.ndarray | None:
        """C(ASIM) / C(RLFJ), shape (2, poses * poses); `None` unless both ran."""
        if not {"asim", "flexible_joint"} <= self.criterion.keys():
            return None
        return self.criterion["asim"] / self.criterion["flexible_joint"]

    def as_dict(self) -> dict:
        """For the results: angles in rad."""
        return {
            "poses": np.deg2rad(self.poses).tolist(),
            "moves": [[move] * 3 + [0.0] * 3 for move in np.deg2rad(MOVES)],
            "moves_with_signs": np.deg2rad(self.moves).tolist(),
            "criterion": {n: c.tolist() for n, c in self.criterion.items()},
            "path_error_integral": {
                n: e.tolist() for n, e in self.path_error_integral.items()
            },
        }


def run_grid(
    robot: ElasticRobot,
    config: FeedforwardConfig,
    inverses: dict[str, AbstractInverse],
    progress: Progress,
) -> Grid:
    """Every inverse over the grid, one call each, split over the cores.

    Raises:
        ValueError: the robot has fewer than three axes.
    """
    if robot.axes < 3:
        raise ValueError(f"--grid needs three axes, but {robot.name} has {robot.axes}")
    assert config.grid is not None
    base = resolve_pose(robot, config.pose)
    a2 = np.linspace(-SPAN, 0.0, config.grid)
    a3 = np.linspace(0.0, SPAN, config.grid)
    poses = np.array([[base[0], x, y, *base[3:]] for x in a2 for y in a3])
    moves = np.array([[_move(robot, pose, move) for pose in poses] for move in MOVES])
    starts = np.broadcast_to(poses, moves.shape).reshape(-1, robot.axes)
    flat = moves.reshape(-1, robot.axes)
    order = reference_order(robot)
    filter = reference_filter(config, order)
    start, move = jnp.asarray(np.deg2rad(starts)), jnp.asarray(np.deg2rad(flat))
    longest = jax.jit(
        lambda robot: jax.vmap(lambda s, m: point_to_point(robot, s, m).duration)(
            start, move
        ).max()
    )(robot)
    duration = rounded(float(longest) + settling(filter))
    controller = CascadeMotorControl()

    def case(robot, inverse, start, move):
        profile = point_to_point(robot, start, move)
        reference = move_reference(profile, filter, duration, order)
        run = run_feedforward(robot, robot, inverse, reference, controller, throw=False)
        return run.judgement.criterion, run.judgement.path_error_integral

    criterion, integral = {}, {}
    for name, inverse in inverses.items():
        progress.say(f"{name} over {len(flat)} motions of {duration:g} s ...")
        program = jax.jit(over_devices(case, in_axes=(None, None, 0, 0)))
        c, e = program(robot, inverse, start, move)
        criterion[name] = np.asarray(c).reshape(len(MOVES), -1)
        integral[name] = np.asarray(e).reshape(len(MOVES), -1)
    return Grid(a2, a3, poses, moves, criterion, integral)


def _move(robot: ElasticRobot, pose: np.ndarray, angle: float) -> np.ndarray:
    move = np.zeros(robot.axes)
    move[:3] = angle
    return allowed_move(robot, pose, move)[0]
