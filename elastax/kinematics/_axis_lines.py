"""The axes of a chain as lines in space, in the pose where all coordinates are zero.

Lines, kinds and the tool's pose say everything about a chain: whatever frames a
convention puts on them, the tool goes the same ways.
"""

from typing import NamedTuple

import numpy as np

from .._checks import is_concrete
from ._chain import SerialChain
from ._joints import JointKind


_FAR = 10.0  # sizes of the arm beyond which an origin says nothing about an axis


class AxisLines(NamedTuple):
    """Axes and ends of a chain at q = 0, in the base frame, in double precision.

    Attributes:
        points: a point of every axis [m], shape (joints, 3): the joint's own origin, or
            where that lies far off the arm, the point that is nearest to the base's
            origin. A prismatic axis has a direction only; its point means nothing.
        directions: unit vectors, shape (joints, 3).
        turns: whether each joint is revolute.
        base, tool: poses of the ends, shape (4, 4) [m].
    """

    points: np.ndarray
    directions: np.ndarray
    turns: tuple[bool, ...]
    base: np.ndarray
    tool: np.ndarray


def axis_lines(chain: SerialChain) -> AxisLines:
    """Read the axes of a chain, in whatever convention it is given.

    Raises:
        ValueError: the chain holds traced arrays, or numbers that are not finite.
    """
    frames = chain.joints.frames()
    arrays = (frames.before, frames.axis, frames.after, chain.base, chain.tool)
    if not is_concrete(*arrays):
        raise ValueError(
            "the axes of a chain are read from its numbers, but they are traced: call "
            "this outside of `jit`, `vmap` and `grad`"
        )
    before, axis, after, base, tool = (np.asarray(x, float) for x in arrays)
    if not all(np.all(np.isfinite(x)) for x in (before, axis, after, base, tool)):
        raise ValueError("the numbers of a chain must be finite, but some are not")
    pose, points, directions = base, [], []
    for k in range(chain.number):
        pose = pose @ before[k]
        points.append(pose[:3, 3])
        directions.append(pose[:3, :3] @ axis[k] / np.linalg.norm(axis[k]))
        pose = pose @ after[k]
    turns = tuple(kind is JointKind.REVOLUTE for kind in chain.kinds)
    lines = AxisLines(np.array(points), np.array(directions), turns, base, pose @ tool)
    near = _nearest(lines, base[:3, 3])
    off = np.linalg.norm(lines.points - near, axis=1) > _FAR * _size(lines)
    return lines._replace(points=np.where(off[:, None], near, lines.points))


def characteristic_length(chain: SerialChain) -> float:
    """A length that makes translations and rotations of a chain comparable [m].

    The longest lever: distances of the tool from the revolute axes at q = 0, and
    distances between neighbouring ones; one metre where all are zero.
    """
    return _size(axis_lines(chain))


def _nearest(lines: AxisLines, origin: np.ndarray) -> np.ndarray:
    """Points of the axes that are nearest to `origin`."""
    along = np.sum((origin - lines.points) * lines.directions, axis=1, keepdims=True)
    return lines.points + along * lines.directions


def _size(lines: AxisLines) -> float:
    tool = lines.tool[:3, 3]
    levers = np.linalg.norm(_nearest(lines, tool) - tool, axis=1)[list(lines.turns)]
    which = np.flatnonzero(lines.turns)
    gaps = [
        distance(
            lines.points[i], lines.directions[i], lines.points[j], lines.directions[j]
        )
        for i, j in zip(which, which[1:])
    ]
    longest = max([*levers, *gaps], default=0.0)
    return float(longest) if longest > 1e-9 else 1.0


def distance(point, direction, other_point, other_direction) -> float:
    """Shortest distance between two lines [m]."""
    between = other_point - point
    normal = np.cross(direction, other_direction)
    sine = np.linalg.norm(normal)
    if sine > 1e-9:
        return float(abs(between @ normal) / sine)
    return float(np.linalg.norm(np.cross(between, direction)))
