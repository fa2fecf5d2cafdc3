"""Axes and points of a chain in NumPy, for tables: nothing is compiled."""

import dataclasses

import numpy as np

from ..kinematics import JointKind, SerialChain


# a length below this fraction of the arm counts as none
SAME = 1e-6


@dataclasses.dataclass(frozen=True)
class Geometry:
    """Axes and points of a chain at given coordinates, in the base frame.

    Attributes:
        origins: of the joints [m], shape (joints, 3).
        axes: unit vectors, shape (joints, 3).
        tool: pose of the tool [m], shape (4, 4).
    """

    origins: np.ndarray
    axes: np.ndarray
    tool: np.ndarray


def geometry(chain: SerialChain, q) -> Geometry:
    """Axes and points at the coordinates q, in NumPy: nothing is compiled."""
    frames = chain.joints.frames()
    before, axis, after = map(np.asarray, (frames.before, frames.axis, frames.after))
    pose, origins, axes = np.asarray(chain.base), [], []
    for k, kind in enumerate(chain.kinds):
        pose = pose @ before[k]
        origins.append(pose[:3, 3])
        axes.append(pose[:3, :3] @ axis[k])
        pose = pose @ _motion(kind, axis[k], float(q[k])) @ after[k]
    tool = pose @ np.asarray(chain.tool)
    return Geometry(np.array(origins), np.array(axes), tool)


def jacobian_of(chain: SerialChain, here: Geometry) -> np.ndarray:
    """Geometric Jacobian of the tool, translation above rotation."""
    columns = [
        np.concatenate([np.cross(z, here.tool[:3, 3] - p), z])
        if kind is JointKind.REVOLUTE
        else np.concatenate([z, np.zeros(3)])
        for kind, p, z in zip(chain.kinds, here.origins, here.axes)
    ]
    return np.stack(columns, axis=1)


def angle_between(start: np.ndarray, end: np.ndarray, axis: np.ndarray) -> float:
    """Angle about `axis` from one vector to another, both seen along it [rad]."""
    return float(
        np.arctan2(
            axis @ np.cross(start, end), _across(start, axis) @ _across(end, axis)
        )
    )


def distance(p, a, other, b) -> float:
    """Distance of two lines through points along unit vectors."""
    normal = np.cross(a, b)
    length = np.linalg.norm(normal)
    if length < SAME:
        return float(np.linalg.norm(np.cross(a, other - p)))
    return float(abs(normal @ (other - p)) / length)


def meet(p, a, size: float) -> bool:
    """Whether lines meet in one point, within a millionth of a size."""
    system = np.concatenate([np.eye(3) - np.outer(x, x) for x in a])
    target = np.concatenate([x - y * (y @ x) for x, y in zip(p, a)])
    point, *_ = np.linalg.lstsq(system, target, rcond=None)
    return bool(np.linalg.norm(system @ point - target) < SAME * size)


def _across(vector: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return vector - axis * (axis @ vector)


def _motion(kind: JointKind, axis: np.ndarray, q: float) -> np.ndarray:
    pose = np.eye(4)
    if kind is JointKind.PRISMATIC:
        pose[:3, 3] = q * axis
        return pose
    x, y, z = axis
    turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose[:3, :3] += np.sin(q) * turn + (1 - np.cos(q)) * turn @ turn
    return pose
