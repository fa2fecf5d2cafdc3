"""The parameters of a chain by name, as one vector of deviations."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from .._kernel import kernel
from ._chain import SerialChain, forward_kinematics
from ._exponential import rotation_from_vector
from ._joints import AbstractJoints
from ._link_conventions import MixedJoints
from ._se3 import transform


Vector = Float[Array, " parameters"]
_UNITS = {"a": "m", "d": "m", "position": "m"}
_POSE = ("x", "y", "z", "rx", "ry", "rz")


class Parameter(NamedTuple):
    """One parameter of a chain.

    Attributes:
        name: such as `alpha_2` or `position_3_x`, joints counted from one; `base_rx`
            and `tool_z` for the poses at the ends.
        unit: "m" or "rad".
        place: group of joints (0 unless conventions are mixed), field, and position in
            the field, or the end of the chain and the number of the coordinate.
    """

    name: str
    unit: str
    place: tuple[Any, ...]


class ChainParameters(eqx.Module):
    """Some of the parameters of a chain, as deviations from its nominal values.

    Lengths and angles deviate by addition. Rotation matrices, and the poses of base and
    tool, deviate by a displacement in their own frame, which has a translation and a
    rotation vector and is singular nowhere near zero. Directions of axes are no
    parameters: the rotations in front of them do the same.

    Attributes:
        chain: the nominal chain.
        entries: the parameters, in the order of the vector.
    """

    chain: SerialChain
    entries: tuple[Parameter, ...] = eqx.field(static=True)

    @staticmethod
    def of(
        chain: SerialChain, *, base: bool = True, tool: bool = True
    ) -> "ChainParameters":
        """All parameters of a chain.

        Args:
            chain: the nominal chain.
            base, tool: whether the mounting pose and the tool pose are among them.
        """
        entries = list(_joint_entries(chain.joints))
        for name, yes in (("base", base), ("tool", tool)):
            if yes:
                entries += [
                    Parameter(f"{name}_{c}", "m" if k < 3 else "rad", (name, k))
                    for k, c in enumerate(_POSE)
                ]
        return ChainParameters(chain, tuple(entries))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(entry.name for entry in self.entries)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(entry.unit for entry in self.entries)

    @property
    def number(self) -> int:
        return len(self.entries)

    def select(self, names: Iterable[str]) -> "ChainParameters":
        """The parameters of these names, in this order.

        Raises:
            ValueError: there is no such parameter.
        """
        known = {entry.name: entry for entry in self.entries}
        names = list(names)
        if missing := [name for name in names if name not in known]:
            raise ValueError(
                f"the chain has no parameters {missing}: it has {', '.join(known)}"
            )
        return ChainParameters(self.chain, tuple(known[name] for name in names))

    def without(self, names: Iterable[str]) -> "ChainParameters":
        """All parameters but these; the latter stay at their nominal values."""
        left_out = {entry.name for entry in self.select(names).entries}
        return self.select(name for name in self.names if name not in left_out)

    def values(self) -> Vector:
        """Nominal values [m] and [rad]; zero where a deviation is a displacement."""
        dtype = self.chain.base.dtype
        groups = _groups(self.chain.joints)
        return jnp.stack([_value(groups, entry, dtype) for entry in self.entries])

    def moved(self, deviation: Vector) -> SerialChain:
        """The chain whose parameters deviate from the nominal ones by `deviation`."""
        changes: dict[tuple, list[tuple[tuple, Any]]] = {}
        for entry, amount in zip(self.entries, deviation, strict=True):
            *field, index = entry.place
            changes.setdefault(tuple(field), []).append((index, amount))
        groups = list(_groups(self.chain.joints))
        ends = {"base": self.chain.base, "tool": self.chain.tool}
        for field, amounts in changes.items():
            if len(field) == 1:
                (end,) = field
                ends[end] = ends[end] @ _displacement(amounts, deviation.dtype)
                continue
            group, name = field
            groups[group] = _deviate(groups[group], name, amounts)
        joints = self.chain.joints
        joints = MixedJoints(tuple(groups)) if _is_mixed(joints) else groups[0]
        return SerialChain(joints, ends["base"], ends["tool"], self.chain.kinds)


@kernel
def parameter_jacobian(
    parameters: ChainParameters, q: PerJoint
) -> Float[Array, "6 parameters"]:
    """Geometric Jacobian of the tool by the parameters, translation above rotation.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Shape (6, parameters), in the base frame: [m] and [rad] per unit of each
        parameter.

    References:
        [KinModell] (3-41), (3-100).
    """
    pose = lambda x: forward_kinematics(parameters.moved(x), q)
    zero = jnp.zeros((parameters.number,), q.dtype)
    rotation = pose(zero)[:3, :3]
    slopes = jax.jacfwd(pose)(zero)
    turns = jnp.einsum("ijk,lj->ilk", slopes[:3, :3], rotation)
    vee = jnp.stack([turns[2, 1], turns[0, 2], turns[1, 0]])
    return jnp.concatenate([slopes[:3, 3], vee])


def _is_mixed(joints: AbstractJoints) -> bool:
    return isinstance(joints, MixedJoints)


def _groups(joints: AbstractJoints) -> tuple[AbstractJoints, ...]:
    return joints.groups if isinstance(joints, MixedJoints) else (joints,)


def _joint_entries(joints: AbstractJoints) -> Iterator[Parameter]:
    """Parameters of the joints, joint by joint."""
    first = 1
    for group, part in enumerate(_groups(joints)):
        if _is_mixed(part):
            raise ValueError("groups of mixed joints must not be mixed themselves")
        for k in range(part.number()):
            yield from _entries_of_joint(part, group, k, first + k)
        first += part.number()


def _entries_of_joint(part, group: int, k: int, number: int) -> Iterator[Parameter]:
    for field in dataclasses.fields(part):
        if field.metadata.get("static", False) or field.name == "axis":
            continue
        shape = getattr(part, field.name).shape
        if shape[:1] != (part.number(),):
            raise ValueError(
                f"{type(part).__name__} keep parts of their placement as structure: "
                "convert the chain to a convention whose parameters are all numbers"
            )
        unit, place = _UNITS.get(field.name, "rad"), (group, field.name)
        if len(shape) == 1:
            yield Parameter(f"{field.name}_{number}", unit, (*place, (k,)))
            continue
        for c, letter in enumerate("xyz"):
            yield Parameter(f"{field.name}_{number}_{letter}", unit, (*place, (k, c)))


def _value(groups, entry: Parameter, dtype):
    if len(entry.place) == 2:
        return jnp.zeros((), dtype)
    group, name, index = entry.place
    array = getattr(groups[group], name)
    return jnp.zeros((), dtype) if array.ndim == 3 else array[index]


def _displacement(amounts, dtype):
    """Pose from coordinates of a displacement."""
    vector = _filled((6,), [((k,), x) for k, x in amounts], dtype)
    return transform(rotation_from_vector(vector[3:]), vector[:3])


def _deviate(part: AbstractJoints, name: str, amounts) -> AbstractJoints:
    array = getattr(part, name)
    if array.ndim == 3:
        vectors = _filled((array.shape[0], 3), amounts, array.dtype)
        moved = array @ jax.vmap(rotation_from_vector)(vectors)
    else:
        moved = array + _filled(array.shape, amounts, array.dtype)
    return eqx.tree_at(lambda p: getattr(p, name), part, moved)


def _filled(shape, amounts, dtype):
    places = tuple(np.array([index for index, _ in amounts]).T)
    values = jnp.stack([jnp.asarray(x, dtype) for _, x in amounts])
    return jnp.zeros(shape, dtype).at[places].set(values)
