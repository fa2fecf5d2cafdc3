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

from .._checks import check_fields, is_concrete
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
        places, n, dtype = self._places(), self.number(), self.position.dtype
        before, axis = np.tile(np.eye(4), (n, 1, 1)), np.zeros((n, 3))
        for k, known in enumerate(self.structure):
            if known.rotation is not None:
                before[k, :3, :3] = known.rotation
            if known.axis is not None:
                axis[k] = known.axis
        after = np.tile(np.eye(4), (n, 1, 1))
        before = _set(before, (places["rotation"], np.s_[:3], np.s_[:3]), self.rotation)
        before = _set(before, (places["position"], np.s_[:3], 3), self.position)
        axis = _set(axis, (places["axis"],), self.axis)
        return JointFrames(*(jnp.asarray(x, dtype) for x in (before, axis, after)))

    def number(self) -> int:
        return len(self.structure)


def _set(array: Any, index: tuple, values: Any) -> Any:
    """`array` with values; NumPy as long as it can be, JAX takes 20 ms an operation."""
    index = tuple(np.array(i, int) if isinstance(i, list) else i for i in index)
    if not len(values):
        return array
    if not is_concrete(array, values):
        return jnp.asarray(array, values.dtype).at[index].set(values)
    array[index] = np.asarray(values)
    return array


class Placement(NamedTuple):
    """Frame in another one.

    Attributes:
        rotation: shape (3, 3), of NumPy if it is structure or its numbers are known.
        position: [m], shape (3,), or `None` for the same origin.
        is_structure: whether the rotation is made of right angles for good.
    """

    rotation: Any
    position: Any
    is_structure: bool = True

    def then(self, other: "Placement") -> "Placement":
        """Placement of a frame that has the placement `other` in this frame."""
        position = self.position
        if other.position is not None:
            moved = self.rotation @ other.position
            position = moved if position is None else position + moved
        both = self.is_structure and other.is_structure
        return Placement(self.rotation @ other.rotation, position, both)

    def matrix(self, dtype) -> Float[Array, "4 4"] | Float[np.ndarray, "4 4"]:
        """Homogeneous matrix."""
        pose = _set(np.eye(4, dtype=dtype), np.s_[:3, :3], self.rotation)
        if self.position is None:
            return pose
        return _set(pose, np.s_[:3, 3], self.position)


SAME = Placement(np.eye(3), None)


def placements(joints: AbstractJoints) -> list[tuple[Placement, Any, Placement]]:
    """Placement in front of every joint's motion, its axis, and placement behind it."""
    frames = joints.frames()
    arrays = (frames.before, frames.axis, frames.after)
    before, axis, after = (np.asarray(x) if is_concrete(x) else x for x in arrays)
    if not isinstance(joints, StructuredJoints):
        return [
            (placement(b), (a, False), placement(c))
            for b, a, c in zip(before, axis, after)
        ]
    found, dtype = [], joints.position.dtype
    for k, known in enumerate(joints.structure):
        place = placement(before[k])
        if known.rotation is not None:
            place = Placement(np.array(known.rotation, dtype), place.position)
        if not known.displaced:
            place = place._replace(position=None)
        direction = axis[k] if known.axis is None else np.array(known.axis, dtype)
        found.append((place, (direction, known.axis is not None), SAME))
    return found


def placement(pose: Float[Array, "4 4"] | Float[np.ndarray, "4 4"]) -> Placement:
    """A pose as a placement of which nothing is structure."""
    return Placement(pose[:3, :3], pose[:3, 3], False)


def structured(joints: Sequence[tuple[Placement, tuple[Any, bool]]]):
    """Joints from placements in front of their motions and from axes.

    Args:
        joints: placement, and axis with whether it is structure where it can be.
            Structure are right angles and axes along those of the frame; what is none
            becomes a parameter.
    """
    rotations, positions, axes, structure = [], [], [], []
    for place, (axis, is_structure) in joints:
        known = JointStructure(
            _rows(_whole(place.rotation)) if place.is_structure else None,
            _row(_whole(axis)) if is_structure else None,
            place.position is not None,
        )
        structure.append(known)
        if known.rotation is None:
            rotations.append(place.rotation)
        if known.axis is None:
            axes.append(axis)
        if known.displaced:
            positions.append(place.position)
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


def _whole(array: np.ndarray) -> np.ndarray | None:
    """Whole numbers that the array holds, but for rounding."""
    nearest = np.rint(array)
    return nearest.astype(int) if np.all(np.abs(array - nearest) < _TURNED) else None


def _row(whole: np.ndarray | None) -> tuple[int, ...] | None:
    return None if whole is None else tuple(whole.tolist())


def _rows(whole: np.ndarray | None) -> RightAngles | None:
    return None if whole is None else tuple(tuple(row) for row in whole.tolist())
