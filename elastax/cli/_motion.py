"""From what the user typed to a filtered reference of the joints."""

import dataclasses
import math
import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..dynamics import ElasticRobot
from ..kinematics import (
    SphericalWrist,
    forward_kinematics,
    inverse_kinematics_path,
    transform,
)
from ..signals import BesselFilter, Reference
from ..trajectory import PointToPoint, StraightPath, rectangle
from ._arguments import FeedforwardConfig


DT = 1e-3  # [s], rate of the reference
ORDER = 4  # derivatives of the reference for motors without a lag
HOLD = 0.95  # [s] at rest after the motion, for the window of the criterion
OVERSAMPLING = 8
PATH_SPEED, PATH_ACCELERATION, PATH_JERK = 0.5, 3.0, 30.0  # m/s, m/s^2, m/s^3
RECTANGLE = (0.4, 0.3)  # [m], width across and height; figure 6.5 prints no dimensions


@dataclasses.dataclass(frozen=True)
class Motion:
    """A reference and what it is made of.

    Attributes:
        reference: filtered joint angles of the chain with derivatives.
        start: pose in the maker's angles [deg].
        move: angles moved by [deg], signs reversed where a limit forbids; `None` for a
            path.
        waypoints: of the Cartesian path [m], `None` for a move.
        notes: remarks to print.
    """

    reference: Reference
    start: np.ndarray
    move: np.ndarray | None
    waypoints: np.ndarray | None
    notes: tuple[str, ...]


def reference_order(robot: ElasticRobot) -> int:
    """Derivatives of the reference that every inverse of the robot can have."""
    return ORDER + robot.drives.extra_order


def reference_filter(config: FeedforwardConfig, order: int = ORDER) -> BesselFilter:
    """Filter that delivers the derivatives of the reference.

    Raises:
        ValueError: its order is too low for the inverses.
    """
    if config.filter_order < order:
        raise ValueError(
            f"the filter order must be at least {order}, for as many derivatives of "
            f"the reference, but is {config.filter_order}: give --filter-order 6"
        )
    return BesselFilter(config.filter_order, config.cutoff)


def resolve_pose(robot: ElasticRobot, words: tuple[str, ...]) -> np.ndarray:
    """Pose in the maker's angles [deg].

    Raises:
        ValueError: neither a named pose nor one number per axis.
    """
    if len(words) == 1 and words[0] in robot.poses:
        return np.rad2deg(np.asarray(robot.poses[words[0]]))
    try:
        angles = np.array([float(word) for word in words])
    except ValueError:
        raise ValueError(
            f"--pose must be one of {', '.join(sorted(robot.poses))} or {robot.axes} "
            f"angles in degrees, but is `{' '.join(words)}`"
        ) from None
    if angles.shape != (robot.axes,):
        raise ValueError(
            f"--pose must give one angle per axis: {robot.name} has {robot.axes} axes, "
            f"but there are {angles.size} angles"
        )
    return angles


def check_limits(robot: ElasticRobot, angles: np.ndarray, what: str) -> None:
    """Refuse maker's angles [deg] outside the limits.

    Raises:
        ValueError: names the axis, the angle and the limits.
    """
    lower = np.rad2deg(np.asarray(robot.limits.lower))
    upper = np.rad2deg(np.asarray(robot.limits.upper))
    for k, name in enumerate(robot.axis_names):
        if not lower[k] - 1e-9 <= angles[k] <= upper[k] + 1e-9:
            raise ValueError(
                f"{what} takes {name} to {angles[k]:g} deg, outside its limits "
                f"{lower[k]:g} to {upper[k]:g} deg: choose another pose or move"
            )


def allowed_move(
    robot: ElasticRobot, start: np.ndarray, move: np.ndarray
) -> tuple[np.ndarray, list[str]]:
    """Move [deg] with signs reversed where a limit forbids it, and remarks."""
    lower = np.rad2deg(np.asarray(robot.limits.lower))
    upper = np.rad2deg(np.asarray(robot.limits.upper))
    move, notes = move.copy(), []
    for k, name in enumerate(robot.axis_names):
        end, back = start[k] + move[k], start[k] - move[k]
        if not lower[k] <= end <= upper[k] and lower[k] <= back <= upper[k]:
            notes.append(
                f"{name} moves by {-move[k]:g} instead of {move[k]:g} deg: a limit "
                f"forbids {end:g} deg"
            )
            move[k] = -move[k]
    return move, notes


def build_motion(robot: ElasticRobot, config: FeedforwardConfig) -> Motion:
    """Reference of the move or of the path.

    Raises:
        ValueError: pose or move outside the limits, unreachable path, wrong file.
    """
    filter = reference_filter(config, reference_order(robot))
    start = resolve_pose(robot, config.pose)
    check_limits(robot, start, "the pose")
    if config.path is not None:
        return _path_motion(robot, config, filter, start)
    move = np.zeros(robot.axes)
    if len(config.move) > robot.axes:
        raise ValueError(
            f"--move must give at most one angle per axis: {robot.name} has "
            f"{robot.axes} axes, but there are {len(config.move)} angles"
        )
    move[: len(config.move)] = config.move
    if not np.any(move):
        raise ValueError("--move must move at least one axis, but all angles are zero")
    move, notes = allowed_move(robot, start, move)
    check_limits(robot, start + move, "the move")
    profile = point_to_point(
        robot, jnp.asarray(np.deg2rad(start)), jnp.asarray(np.deg2rad(move))
    )
    duration = rounded(float(profile.duration) + settling(filter))
    order = reference_order(robot)
    reference = eqx.filter_jit(move_reference)(profile, filter, duration, order)
    return Motion(reference, start, move, None, tuple(notes))


def point_to_point(robot: ElasticRobot, start, move) -> PointToPoint:
    """Profile of a move in the maker's angles [rad]."""
    limits = robot.limits
    return PointToPoint(
        robot.from_maker(start),
        robot.from_maker(start + move),
        limits.velocity,
        limits.acceleration,
        limits.jerk,
    )


def move_reference(
    profile: PointToPoint, filter: BesselFilter, duration: float, order: int
) -> Reference:
    """Filtered reference of a profile over `duration` [s]."""
    return Reference.from_position_function(
        profile.position,
        duration,
        DT,
        filter=filter,
        order=order,
        oversampling=OVERSAMPLING,
    )


def settling(filter: BesselFilter) -> float:
    """Time from the end of a motion to the end of the criterion's window [s]."""
    return 4 * float(filter.delay()) + HOLD


def rounded(duration: float) -> float:
    """Next quarter of a second, so that few lengths are compiled."""
    return math.ceil(duration * 4 - 1e-9) / 4


def _path_motion(robot, config, filter, start) -> Motion:
    arm = SphericalWrist.from_chain(robot.flexible_joint().chain)
    q = robot.from_maker(jnp.asarray(np.deg2rad(start)))
    pose = forward_kinematics(arm.chain, q)
    waypoints = _waypoints(config.path, np.asarray(pose[:3, 3]))
    path = StraightPath(waypoints, PATH_SPEED, PATH_ACCELERATION, PATH_JERK)
    fine = DT / OVERSAMPLING
    duration = rounded(float(path.duration) + settling(filter))
    times = np.arange(round(duration / fine) + 1) * fine

    @jax.jit
    def solve(path, times, pose, q):
        points = jax.vmap(path.position)(times)
        rotations = jnp.broadcast_to(pose[:3, :3], (points.shape[0], 3, 3))
        joints, valid = inverse_kinematics_path(arm, transform(rotations, points), q)
        return points, joints, valid

    points, joints, valid = solve(path, jnp.asarray(times), pose, q)
    if not np.all(valid):
        k = int(np.argmin(np.asarray(valid)))
        where = ", ".join(f"{x:.3f}" for x in np.asarray(points)[k])
        raise ValueError(
            f"the path is out of reach {times[k]:.3f} s after its start, at ({where}) "
            "m: move the way-points closer or choose another pose"
        )
    maker = np.rad2deg(np.asarray(jax.vmap(robot.to_maker)(joints)))
    check_limits(robot, maker.min(axis=0), "the path")
    check_limits(robot, maker.max(axis=0), "the path")

    @jax.jit
    def filtered(joints):
        dense = filter.apply(joints, fine, reference_order(robot))
        return dense[:, ::OVERSAMPLING]

    reference = Reference(times[::OVERSAMPLING], filtered(joints))
    return Motion(reference, start, None, waypoints, ())


def _waypoints(path: str, origin: np.ndarray) -> np.ndarray:
    if path == "rectangle":
        axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(rectangle(origin, *RECTANGLE, axes))
    file = pathlib.Path(path)
    if not file.is_file():
        raise ValueError(f"--path must be `rectangle` or a CSV file, but is `{path}`")
    try:
        points = np.loadtxt(file, delimiter=",", ndmin=2, comments="#")
    except ValueError as error:
        raise ValueError(
            f"{path} must hold lines `x, y, z` in metres: {error}"
        ) from None
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 1:
        raise ValueError(
            f"{path} must hold three numbers per line, x, y, z [m], but has the shape "
            f"{points.shape}"
        )
    if not np.all(np.isfinite(points)):
        raise ValueError(f"{path} must hold finite numbers")
    if np.linalg.norm(points[0] - origin) > 1e-9:
        points = np.concatenate([origin[None], points])
    return points
