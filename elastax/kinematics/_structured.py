"""Joints whose placement is partly structure: right angles and common origins.

Most joints of an arm stand parallel or perpendicular to their predecessor, turn about
an axis of their own frame, and many lie in one place with it (a hinge at its axis). A
program that knows so has a third of the operations; a placement that is a number may be
any number, and is a parameter.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import as_real
from ._joints import AbstractJoints, JointFrames


_TURNED = 1e-12  # rounding of sines and cosines of right angles

RightAngles = tuple[tuple[int, ...], ...]  # rotation of zeros and plus or minus ones


class JointStructure(NamedTuple):
    """What is structure in the placement of a joint; `None` where it is a parameter.

    Attributes:
        rotation: matrix of zeros and plus or minus ones.
        axis: unit vector along an axis of the joint's frame.
        displaced: whether its origin has a place of its own, which is a parameter.
    """

    rotation: RightAngles | None
    axis: tuple[int, ...] | None
    displaced: bool


class StructuredJoints(AbstractJoints):
    """Joints given by frames, with structure told apart from parameters.

    Attributes:
        rotation: orientations that are parameters, shape (turned, 3, 3).
        position: origins of the displaced joints [m], shape (displaced, 3).
        axis: unit axes that are parameters, shape (inclined, 3).
        structure: of every joint, in order.
    """

    rotation: Float[Array, "turned 3 3"] = eqx.field(converter=as_real)
    position: Float[Array, "displaced 3"] = eqx.field(converter=as_real)
    axis: Float[Array, "inclined 3"] = eqx.field(converter=as_real)
    structure: tuple[JointStructure, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        for name, places in self._places().items():
            if getattr(self, name).shape[0] != len(places):
                raise ValueError(
                    f"`{name}` must have one row for each of the {len(places)} joints "
                    f"that need it, but has {getattr(self, name).shape[0]}"
                )

    def _places(self) -> dict[str, list[int]]:
        """Joints to which the rows of each field belong."""
        which = {
            "rotation": [s.rotation is None for s in self.structure],
            "position": [s.displaced for s in self.structure],
            "axis": [s.axis is None for s in self.structure],
        }
        return {n: [k for k, yes in enumerate(w) if yes] for n, w in which.items()}

    def frames(self) -> JointFrames:
        places, n = self._places(), self.number()
        before, axis = np.tile(np.eye(4), (n, 1, 1)), np.zeros((n, 3))
        for k, known in enumerate(self.structure):
            if known.rotation is not None:
                before[k, :3, :3] = known.rotation
            if known.axis is not None:
                axis[k] = known.axis
        after = np.tile(np.eye(4), (n, 1, 1))
        before, axis, after = (
            jnp.asarray(x, self.position.dtype) for x in (before, axis, after)
        )
        if places["rotation"]:
            rows = np.array(places["rotation"])
            before = before.at[rows, :3, :3].set(self.rotation)
        if places["position"]:
            rows = np.array(places["position"])
            before = before.at[rows, :3, 3].set(self.position)
        if places["axis"]:
            axis = axis.at[np.array(places["axis"])].set(self.axis)
        return JointFrames(before, axis, after)

    def number(self) -> int:
        return len(self.structure)


class Placement(NamedTuple):
    """Frame in another one, structure as far as it is known.

    Attributes:
        rotation: NumPy array if it is made of right angles, else of JAX, (3, 3).
        position: [m], shape (3,), or `None` for the same origin.
    """

    rotation: Any
    position: Any

    def then(self, other: "Placement") -> "Placement":
        """Placement of a frame that has the placement `other` in this frame."""
        position = self.position
        if other.position is not None:
            moved = self.rotation @ other.position
            position = moved if position is None else position + moved
        return Placement(self.rotation @ other.rotation, position)

    def matrix(self, dtype) -> Float[Array, "4 4"]:
        """Homogeneous matrix."""
        pose = jnp.eye(4, dtype=dtype).at[:3, :3].set(jnp.asarray(self.rotation, dtype))
        if self.position is None:
            return pose
        return pose.at[:3, 3].set(self.position)


SAME = Placement(np.eye(3), None)


def placements(joints: AbstractJoints) -> list[tuple[Placement, Any, Placement]]:
    """Placement in front of every joint's motion, its axis, and placement behind it."""
    frames = joints.frames()
    if not isinstance(joints, StructuredJoints):
        return [
            (_placement(before), axis, _placement(after))
            for before, axis, after in zip(frames.before, frames.axis, frames.after)
        ]
    found, dtype = [], joints.position.dtype
    for k, known in enumerate(joints.structure):
        rotation, position = _placement(frames.before[k])
        if known.rotation is not None:
            rotation = np.array(known.rotation, dtype)
        axis = frames.axis[k] if known.axis is None else np.array(known.axis, dtype)
        place = Placement(rotation, position if known.displaced else None)
        found.append((place, axis, SAME))
    return found


def _placement(pose: Float[Array, "4 4"]) -> Placement:
    return Placement(pose[:3, :3], pose[:3, 3])


def structured(pairs: Sequence[tuple[Placement, Any]]) -> StructuredJoints:
    """Joints from placements in front of their motions, and axes.

    What is a NumPy array of right angles becomes structure, everything else a
    parameter.
    """
    rotations, positions, axes, structure = [], [], [], []
    for placement, axis in pairs:
        known = JointStructure(
            _right_angles(placement.rotation),
            _along_an_axis(axis),
            placement.position is not None,
        )
        structure.append(known)
        if known.rotation is None:
            rotations.append(placement.rotation)
        if known.axis is None:
            axes.append(axis)
        if known.displaced:
            positions.append(placement.position)
    return StructuredJoints(
        _stack(rotations, (3, 3)),
        _stack(positions, (3,)),
        _stack(axes, (3,)),
        tuple(structure),
    )


def _stack(rows: list, shape: tuple[int, ...]):
    if not rows:
        return np.zeros((0, *shape))
    if all(isinstance(row, np.ndarray) for row in rows):
        return np.stack(rows).astype(float)
    return jnp.stack([jnp.asarray(row) for row in rows])


def _whole(array: Any) -> np.ndarray | None:
    """A NumPy array of whole numbers but for rounding."""
    if not isinstance(array, np.ndarray):
        return None
    nearest = np.rint(array)
    return nearest.astype(int) if np.all(np.abs(array - nearest) < _TURNED) else None


def _right_angles(rotation: Any) -> RightAngles | None:
    whole = _whole(rotation)
    return None if whole is None else tuple(tuple(row) for row in whole.tolist())


def _along_an_axis(axis: Any) -> tuple[int, ...] | None:
    whole = _whole(axis)
    return None if whole is None else tuple(whole.tolist())
