"""The chain between two links of a URDF's tree."""

import dataclasses
from typing import Any

import numpy as np

from .._rpy import pose_of, rotation_of, rpy_of
from ..kinematics import JointKind
from ._urdf_file import UrdfFile
from ._urdf_notes import left_out


# limits of a continuous joint, which need not have any: two turns [rad]; speed [rad/s]
FREE, FREE_SPEED = 2 * np.pi, np.pi


@dataclasses.dataclass(frozen=True)
class Moving:
    """A joint that moves, with the fixed joints in front of it folded in.

    Attributes:
        joint: record of yourdfpy.
        kind: what it does.
        axis: unit vector in its frame.
        position: of its frame in that of the moving joint in front [m].
        rpy: orientation of that frame [rad].
        links: the link behind it and those fixed to it, each with its pose in the frame
            of the joint.
    """

    joint: Any
    kind: JointKind
    axis: np.ndarray
    position: np.ndarray
    rpy: np.ndarray
    links: tuple[tuple[Any, np.ndarray], ...]

    def rotation(self) -> np.ndarray:
        """Orientation of its frame in that of the moving joint in front."""
        return rotation_of(self.rpy)


@dataclasses.dataclass(frozen=True)
class UrdfChain:
    """Joints from a base link to a tip link.

    Attributes:
        file: where they stand.
        base: pose of the first frame, behind leading fixed joints, in the base link.
        moving: the joints that move.
        tool: pose of the tip link in the frame of the last moving joint.
        tip: name of that link.
        notes: what is left out, put in, or looks wrong.
    """

    file: UrdfFile
    base: np.ndarray
    moving: tuple[Moving, ...]
    tool: np.ndarray
    tip: str
    notes: tuple[str, ...]


def read_chain(file: UrdfFile, base: str | None, tip: str | None) -> UrdfChain:
    """The chain between two links.

    Args:
        file: the URDF.
        base: first link; the root of the tree unless given.
        tip: last link. Unless given, the chain with the most moving joints, of those
            the one with the most joints, of those the first in the file.

    Raises:
        ValueError: no such link, no way between them, no moving joint, or a joint that
            is neither revolute, continuous, prismatic nor fixed.
    """
    notes: list[str] = []
    path = _path(file, base, tip, notes)
    start = pose = np.eye(4)
    folded, printed, moving = True, np.zeros(3), []
    for joint in path:
        placed = pose @ _origin(file, joint)
        if joint.type == "fixed":
            pose, folded = placed, True
            continue
        if joint.type in ("planar", "floating"):
            raise file.refuse(
                "joint", joint.name, f"is {joint.type}: choose `base` behind it"
            )
        if not moving:
            # leading fixed joints are the base, so that the row stays as printed
            start, pose, folded = pose, np.eye(4), False
            placed = _origin(file, joint)
        printed = rpy_of(placed[:3, :3]) if folded else file.rpy("joint", joint.name)
        moving.append(
            Moving(
                joint,
                JointKind.PRISMATIC
                if joint.type == "prismatic"
                else JointKind.REVOLUTE,
                _unit(file, joint, notes),
                placed[:3, 3],
                printed,
                tuple(_rigid(file, joint.child, np.eye(4))),
            )
        )
        pose, folded = np.eye(4), False
    if not moving:
        raise ValueError(
            f"{file.label}: no joint moves between `{path[0].parent}` and "
            f"`{path[-1].child}`"
        )
    end = path[-1].child
    notes += left_out(file, path)
    return UrdfChain(file, start, tuple(moving), pose, end, tuple(notes))


def limits_of(chain: UrdfChain) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Lower and upper limits [rad] or [m], speeds, and notes on what was put in.

    Raises:
        ValueError: limits that leave no range, or no speed.
    """
    rows, notes = [], []
    for moving in chain.moving:
        joint, limit = moving.joint, moving.joint.limit
        speed = None if limit is None else limit.velocity
        if joint.type == "continuous":
            lower, upper = -FREE, FREE
            put_in = "limits of two turns either way"
            if not speed:
                speed, put_in = FREE_SPEED, f"{put_in} and a speed of pi rad/s"
            notes.append(
                f"{chain.file.where('joint', joint.name)} is continuous: {put_in} were "
                "put in"
            )
        else:
            assert limit is not None, "the file was checked"
            # by the specification both are zero unless given
            lower, upper = (limit.lower or 0.0, limit.upper or 0.0)
        if not upper > lower:
            raise chain.file.refuse(
                "joint",
                joint.name,
                f"must have an upper limit above the lower one, but has {upper:g} and "
                f"{lower:g}",
            )
        if not speed or speed <= 0:
            raise chain.file.refuse(
                "joint",
                joint.name,
                "must have a positive limit `velocity` [rad/s] or [m/s], but has "
                f"{'none' if speed is None else f'{speed:g}'}",
            )
        rows.append((lower, upper, speed))
    lower, upper, speed = np.array(rows).T
    return lower, upper, speed, notes


def _path(file: UrdfFile, base, tip, notes: list[str]) -> list:
    """Joints from base to tip."""
    links = [link.name for link in file.robot.links]
    for name, value in (("base", base), ("tip", tip)):
        if value is not None and value not in links:
            raise ValueError(
                f"{file.label}: `{name}` must be one of the links "
                f"{', '.join(links)}, but is `{value}`"
            )
    above = {joint.child: joint for joint in file.robot.joints}
    base = _root(file) if base is None else base

    def climb(link: str) -> list | None:
        joints = []
        while link != base:
            if link not in above:
                return None
            joints.append(above[link])
            link = above[link].parent
        return joints[::-1]

    if tip is not None:
        path = climb(tip)
        if not path:
            raise ValueError(f"{file.label}: `{tip}` must lie behind `{base}`")
        return path
    parents = {joint.parent for joint in file.robot.joints}
    paths = [climb(link) for link in links if link not in parents]
    paths = [path for path in paths if path]
    if not paths:
        raise ValueError(f"{file.label}: no joint lies behind `{base}`")
    rank = lambda path: (sum(j.type != "fixed" for j in path), len(path))
    best = max(paths, key=rank)
    rivals = [p[-1].child for p in paths if rank(p) == rank(best)]
    if len(rivals) > 1:
        notes.append(
            f"the chain ends at `{best[-1].child}`; as many joints move to "
            f"{', '.join(f'`{r}`' for r in rivals if r != best[-1].child)}: name the "
            "`tip` that is meant"
        )
    return best


def _root(file: UrdfFile) -> str:
    children = {joint.child for joint in file.robot.joints}
    (root,) = [link.name for link in file.robot.links if link.name not in children]
    return root


def _origin(file: UrdfFile, joint) -> np.ndarray:
    position = np.zeros(3) if joint.origin is None else joint.origin[:3, 3]
    return pose_of(position, rotation_of(file.rpy("joint", joint.name)))


def _unit(file: UrdfFile, joint, notes: list[str]) -> np.ndarray:
    axis = np.asarray(joint.axis, float)
    length = float(np.linalg.norm(axis))
    if abs(length - 1) > 1e-6:
        notes.append(
            f"{file.where('joint', joint.name)}: its axis has the length {length:g} "
            "and was scaled to 1"
        )
    # a unit vector stays as it is printed
    return axis if abs(length - 1) < 1e-15 else axis / length


def _rigid(file: UrdfFile, link: str, pose: np.ndarray) -> list:
    """A link and all that is fixed to it, with poses in one frame."""
    (record,) = [entry for entry in file.robot.links if entry.name == link]
    found = [(record, pose)]
    for joint in file.robot.joints:
        if joint.parent == link and joint.type == "fixed":
            found += _rigid(file, joint.child, pose @ _origin(file, joint))
    return found
