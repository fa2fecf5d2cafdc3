"""Serial chains and their forward kinematics."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import PerJoint, Transform, as_real
from .._kernel import kernel
from .._taylor import (
    Series,
    concatenate,
    leading,
    product,
    sin_cos,
    skew,
)
from ._joints import AbstractJoints, DHJoints, FrameJoints, JointKind, RPYJoints
from ._link_conventions import HayatiJoints, ModifiedDHJoints, VeitscheggerWuJoints
from ._se3 import transform


class SerialChain(eqx.Module):
    """Open chain of revolute and prismatic joints.

    Attributes:
        joints: placement of the joints in the convention that they were given in.
        base: pose of the chain's first frame in the base frame [m].
        tool: pose of the tool in the last link's frame [m].
        kinds: what each joint does.
    """

    joints: AbstractJoints
    base: Transform = eqx.field(converter=as_real)
    tool: Transform = eqx.field(converter=as_real)
    kinds: tuple[JointKind, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        if len(self.kinds) != self.joints.number():
            raise ValueError(
                "`kinds` must name one kind per joint: there are "
                f"{self.joints.number()} joints, but {len(self.kinds)} kinds"
            )

    @property
    def number(self) -> int:
        """Number of joints."""
        return len(self.kinds)

    @staticmethod
    def from_dh(theta, d, a, alpha, *, kinds=None, base=None, tool=None):
        """Chain from a standard Denavit-Hartenberg table.

        Args:
            theta: joint offsets [rad], shape (joints,).
            d: offsets along z [m].
            a: lengths along x [m].
            alpha: twists about x [rad].
            kinds: `JointKind` of each joint; all revolute unless given.
            base: pose of the first frame in the base frame, identity unless given.
            tool: pose of the tool in the last frame, identity unless given.

        References:
            [KinModell] table 3-2.
        """
        return _chain(DHJoints(theta, d, a, alpha), kinds, base, tool)

    @staticmethod
    def from_modified_dh(alpha, a, theta, d, *, kinds=None, base=None, tool=None):
        """Chain from a modified Denavit-Hartenberg table, in Craig's order.

        Args:
            alpha: twists about x in front of each axis [rad], shape (joints,).
            a: lengths along x in front of each axis [m].
            theta: joint offsets [rad].
            d: offsets along z [m].
            kinds, base, tool: as for `from_dh`.
        """
        return _chain(ModifiedDHJoints(alpha, a, theta, d), kinds, base, tool)

    @staticmethod
    def from_hayati(theta, a, alpha, beta, *, kinds=None, base=None, tool=None):
        """Chain of Hayati-Mirmirani joints, for parallel axes.

        Args:
            theta: joint offsets [rad], shape (joints,).
            a: lengths along x [m].
            alpha, beta: tilts about x and y of the next axis [rad].
            kinds, base, tool: as for `from_dh`.

        References:
            [KinModell] table 3-3.
        """
        return _chain(HayatiJoints(theta, a, alpha, beta), kinds, base, tool)

    @staticmethod
    def from_veitschegger_wu(
        theta, d, a, alpha, beta, *, kinds=None, base=None, tool=None
    ):
        """Chain of Veitschegger-Wu joints.

        Args:
            theta: joint offsets [rad], shape (joints,).
            d: offsets along z [m].
            a: lengths along x [m].
            alpha, beta: tilts about x and y of the next axis [rad].
            kinds, base, tool: as for `from_dh`.

        References:
            [KinModell] table 3-4.
        """
        joints = VeitscheggerWuJoints(theta, d, a, alpha, beta)
        return _chain(joints, kinds, base, tool)

    @staticmethod
    def from_joints(joints, *, kinds=None, base=None, tool=None):
        """Chain of joints in any convention, mixed ones included.

        Args:
            joints: `AbstractJoints`, such as `MixedJoints`.
            kinds, base, tool: as for `from_dh`.
        """
        return _chain(joints, kinds, base, tool)

    @staticmethod
    def from_frames(rotation, position, axis, *, kinds=None, base=None, tool=None):
        """Chain from the frame of each joint in its predecessor.

        Args:
            rotation: orientation of the joint frames, shape (joints, 3, 3).
            position: their origins [m], shape (joints, 3).
            axis: unit axes in the joint frames, shape (joints, 3).
            kinds, base, tool: as for `from_dh`.
        """
        return _chain(FrameJoints(rotation, position, axis), kinds, base, tool)

    @staticmethod
    def from_rpy(position, rpy, axis, *, kinds=None, base=None, tool=None):
        """Chain from positions [m] and roll-pitch-yaw angles [rad] of the joint frames.

        Args:
            position: shape (joints, 3).
            rpy: shape (joints, 3), about x, y, z.
            axis: unit axes in the joint frames, shape (joints, 3).
            kinds, base, tool: as for `from_dh`.

        References:
            [KinModell] (3-11).
        """
        return _chain(RPYJoints(position, rpy, axis), kinds, base, tool)


def _chain(joints, kinds, base, tool) -> SerialChain:
    kinds = (JointKind.REVOLUTE,) * joints.number() if kinds is None else tuple(kinds)
    base = np.eye(4) if base is None else base
    tool = np.eye(4) if tool is None else tool
    return SerialChain(joints, base, tool, kinds)


class MovingFrames(eqx.Module):
    """Frames behind the motion of each joint, in the base frame.

    The fields are arrays, or `Series` where the coordinates were.

    Attributes:
        rotation: shape (joints, 3, 3).
        position: shape (joints, 3) [m].
        axis: shape (joints, 3), joint axes.
        tool_rotation: shape (3, 3).
        tool_position: shape (3,) [m].
    """

    rotation: Float[Array, "joints 3 3"] | Series
    position: Float[Array, "joints 3"] | Series
    axis: Float[Array, "joints 3"] | Series
    tool_rotation: Float[Array, "3 3"] | Series
    tool_position: Float[Array, "3"] | Series


def joint_steps(chain: SerialChain, q: PerJoint | Series):
    """Rotation and offset from each moving frame to the one behind the next joint.

    Args:
        chain: the chain.
        q: joint coordinates, array or series.

    Returns:
        Rotations (joints, 3, 3) of the coordinates' kind; offsets (joints, 3) [m] in
        the frame in front of the joint, of that kind if a joint slides; joint axes in
        the frames behind them, (joints, 3).

    References:
        [Reiner2010] (2.26); Rodrigues' formula for the turn about a joint's axis.
    """
    frames = chain.joints.frames()
    # constant transform from one moving frame to the next joint
    previous = jnp.concatenate([chain.base[None], frames.after[:-1]])
    fixed = previous @ frames.before
    turn = skew(frames.axis)
    rotation, offset = fixed[:, :3, :3], fixed[:, :3, 3]
    sliding = np.array([kind is JointKind.PRISMATIC for kind in chain.kinds])

    angle = product("k,k->k", q, jnp.asarray(~sliding, offset.dtype))
    sine, cosine = sin_cos(angle)
    # Rodrigues' formula behind the constant rotation
    step = (
        product("k,kab->kab", sine, rotation @ turn)
        - product("k,kab->kab", cosine - 1.0, rotation @ turn @ turn)
        + rotation
    )
    if sliding.any():
        slide = product("k,k->k", q, jnp.asarray(sliding, offset.dtype))
        along = jnp.einsum("kab,kb->ka", rotation, frames.axis)
        offset = product("k,ka->ka", slide, along) + offset
    return step, offset, frames.axis


def moving_frames(chain: SerialChain, q: PerJoint | Series) -> MovingFrames:
    """Frames behind the motion of each joint, of coordinates or of their series.

    References:
        [Reiner2010] (2.26).
    """
    frames = chain.joints.frames()
    step, offset, _ = joint_steps(chain, q)
    rotations = [step[0]]
    for k in range(1, chain.number):
        rotations.append(product("ab,bc->ac", rotations[-1], step[k]))
    rotation = concatenate([r[None] for r in rotations])
    axis = product("kab,kb->ka", rotation, frames.axis)

    # origins: sums of the offsets, each turned by the link in front of it
    ahead = product("kab,kb->ka", rotation[:-1], offset[1:])
    first = offset[:1]
    if isinstance(ahead, Series) and not isinstance(first, Series):
        constant = jnp.zeros((ahead.order + 1, 1, 3), first.dtype)
        first = Series(constant.at[0].set(first))
    increment = concatenate([first, ahead])
    sums = jnp.asarray(np.tri(chain.number), leading(offset).dtype)
    position = product("jk,ka->ja", sums, increment)

    last = frames.after[-1] @ chain.tool
    tool_rotation = product("ab,bc->ac", rotation[-1], last[:3, :3])
    tool_position = position[-1] + product("ab,b->a", rotation[-1], last[:3, 3])
    return MovingFrames(rotation, position, axis, tool_rotation, tool_position)


@kernel
def forward_kinematics(chain: SerialChain, q: PerJoint) -> Transform:
    """Pose of the tool in the base frame [m].

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Homogeneous matrix, shape (4, 4).

    References:
        [Reiner2010] (2.26), [KinModell] (3-8).
    """
    frames = moving_frames(chain, q)
    return transform(leading(frames.tool_rotation), leading(frames.tool_position))


@kernel
def link_poses(chain: SerialChain, q: PerJoint) -> Float[Array, "joints 4 4"]:
    """Pose of every link's frame in the base frame [m], shape (joints, 4, 4).

    For a Denavit-Hartenberg chain these are the distal frames of the table.
    """
    frames = moving_frames(chain, q)
    moving = transform(leading(frames.rotation), leading(frames.position))
    return moving @ chain.joints.frames().after
