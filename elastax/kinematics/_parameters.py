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
from .._taylor import leading
from ._chain import SerialChain, moving_frames
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
        joint: number of the joint, from one; 0 at the ends of the chain.
    """

    name: str
    unit: str
    place: tuple[Any, ...]
    joint: int = 0


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
        if not names:
            raise ValueError("`names` must hold at least one parameter, but is empty")
        if missing := [name for name in names if name not in known]:
            raise ValueError(
                f"the chain has no parameters {missing}: it has {', '.join(known)}"
            )
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"parameters must be named once, but {twice} are not")
        return ChainParameters(self.chain, tuple(known[name] for name in names))

    def without(self, names: Iterable[str]) -> "ChainParameters":
        """All parameters but these; the latter stay at their nominal values."""
        left_out = {entry.name for entry in self.select(names).entries}
        return self.select(name for name in self.names if name not in left_out)

    def values(self) -> Vector:
        """Nominal values [m] and [rad]; zero where a deviation is a displacement."""
        dtype = self.chain.base.dtype
        groups = joint_groups(self.chain.joints)
        return jnp.stack([_value(groups, entry, dtype) for entry in self.entries])

    def moved(self, deviation: Vector) -> SerialChain:
        """The chain whose parameters deviate from the nominal ones by `deviation`.

        Raises:
            ValueError: there is not one deviation per parameter.
        """
        if jnp.shape(deviation) != (self.number,):
            raise ValueError(
                f"`deviation` must hold one number per parameter of {self.number}, but "
                f"has the shape {jnp.shape(deviation)}"
            )
        changes: dict[tuple, list[tuple[tuple, Any]]] = {}
        for entry, amount in zip(self.entries, deviation, strict=True):
            *field, index = entry.place
            changes.setdefault(tuple(field), []).append((index, amount))
        groups = list(joint_groups(self.chain.joints))
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


def parameter_jacobian(
    parameters: ChainParameters, q: PerJoint
) -> Float[Array, "6 parameters"]:
    """Geometric Jacobian of the tool by the parameters, translation above rotation.

    A parameter moves one factor of the product of transforms, or the two of one joint;
    the slopes of the factors do not depend on q.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Shape (6, parameters), in the base frame: [m] and [rad] per unit of each
        parameter.

    References:
        [KinModell] (3-20), (3-41), (3-100).
    """
    factors, slopes = factor_slopes(parameters, q.dtype)
    fronts, tool = _fronts(parameters.chain, q)
    rotation, origin = fronts[:, :3, :3], fronts[:, :3, 3]
    turns = jnp.einsum("kijp,klj->kilp", slopes[:, :3, :3], factors[:, :3, :3])
    turn = jnp.stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]], axis=1)
    # from the origin of the moved frame to the tool, in the frame in front
    ahead = jnp.einsum("kba,kb->ka", rotation, tool[None] - origin)
    lever = ahead - factors[:, :3, 3]
    shift = slopes[:, :3, 3] + jnp.cross(turn, lever[..., None], axis=1)
    columns = [jnp.einsum("kab,kbp->ap", rotation, move) for move in (shift, turn)]
    return jnp.concatenate(columns)


def stacked_jacobian(
    parameters: ChainParameters, poses: Float[Array, "poses joints"]
) -> Float[Array, "rows parameters"]:
    """Parameter Jacobians of some poses, one below the other."""
    stack = jax.vmap(parameter_jacobian, (None, 0))(parameters, poses)
    return stack.reshape(-1, parameters.number)


def factor_slopes(parameters: ChainParameters, dtype):
    """Transforms whose product with the motions is the chain, and their slopes.

    Returns:
        The base, those in front of the motions, those behind, the tool, shape
        (2 joints + 2, 4, 4); their derivatives by the parameters, one more axis.
    """

    directions = jnp.eye(parameters.number, dtype=dtype)
    along = jax.vmap(_factor_slope, (None, 0), (0, -1))
    factors, slopes = along(parameters, directions)
    return factors[0], slopes


@kernel
def _factor_slope(parameters: ChainParameters, direction: Vector):
    """Transforms of the chain and their derivatives along a direction."""

    def factors(deviation):
        chain = parameters.moved(deviation)
        frames = chain.joints.frames()
        parts = (chain.base[None], frames.before, frames.after, chain.tool[None])
        return jnp.concatenate(parts)

    return jax.jvp(factors, (jnp.zeros_like(direction),), (direction,))


@kernel
def _fronts(chain: SerialChain, q: PerJoint):
    """Frame in front of every transform of `factor_slopes`, and the tool's position."""
    frames = moving_frames(chain, q)
    moving = transform(leading(frames.rotation), leading(frames.position))
    links = moving @ chain.joints.frames().after
    first = jnp.stack([jnp.eye(4, dtype=moving.dtype), chain.base])
    fronts = jnp.concatenate([first, links[:-1], moving, links[-1:]])
    return fronts, leading(frames.tool_position)


def _is_mixed(joints: AbstractJoints) -> bool:
    return isinstance(joints, MixedJoints)


def joint_groups(joints: AbstractJoints) -> tuple[AbstractJoints, ...]:
    """Groups of mixed joints; other joints are one group."""
    return joints.groups if isinstance(joints, MixedJoints) else (joints,)


def _joint_entries(joints: AbstractJoints) -> Iterator[Parameter]:
    """Parameters of the joints, joint by joint."""
    first = 1
    for group, part in enumerate(joint_groups(joints)):
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
            yield Parameter(f"{field.name}_{number}", unit, (*place, (k,)), number)
            continue
        for c, letter in enumerate("xyz"):
            name = f"{field.name}_{number}_{letter}"
            yield Parameter(name, unit, (*place, (k, c)), number)


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
