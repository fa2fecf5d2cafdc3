"""Geometric Jacobians, and motions of the tool with their time derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from .._kernel import kernel
from .._taylor import concatenate, cross, from_derivatives, leading, product, stack
from ._chain import MovingFrames, SerialChain, joint_steps, moving_frames
from ._joints import JointKind


@kernel
def jacobian(chain: SerialChain, q: PerJoint) -> Float[Array, "6 joints"]:
    """Geometric Jacobian of the tool in the base frame, translation above rotation.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Shape (6, joints): rows 0 to 2 [m/rad], rows 3 to 5 [rad/rad].

    References:
        [Reiner2010] (3.54), (3.56) for the translation rows.
    """
    return leading(tool_jacobian(chain, moving_frames(chain, q)))


def tool_jacobian(chain: SerialChain, frames: MovingFrames):
    """`jacobian` from frames that are known already; arrays or series."""
    rotary = jnp.asarray(
        [[float(kind is JointKind.REVOLUTE)] for kind in chain.kinds],
        leading(frames.axis).dtype,
    )
    tool = concatenate([frames.tool_position[None]] * chain.number)
    turning = product("ka,kb->ka", frames.axis, rotary)
    lever = cross(turning, tool - frames.position)
    sliding = product("ka,kb->ka", frames.axis, 1 - rotary)
    columns = concatenate([lever + sliding, turning], axis=1)
    return product("ij,kj->ik", jnp.asarray(np.eye(6), rotary.dtype), columns)


def tool_levers(chain: SerialChain, q, joints: tuple[int, ...]):
    """Position of the tool and its derivatives by some joints, without link frames.

    From the tool to the base: a vector is turned by one joint after another. Where only
    positions are asked for, this takes a third of the operations of `moving_frames`.

    Args:
        chain: the chain.
        q: joint coordinates, array or series.
        joints: the joints whose columns are wanted.

    Returns:
        Position (3,) [m] and columns (3, len(joints)) of the Jacobian [m/rad], in the
        base frame.

    References:
        [Reiner2010] (2.26), (3.54).
    """
    step, offset, axis = joint_steps(chain, q)
    last = chain.joints.frames().after[-1] @ chain.tool
    point, columns = last[:3, 3], {}
    for k in reversed(range(chain.number)):
        turned = lambda x: product("ab,b->a", step[k], x)
        if k in joints:
            rotary = chain.kinds[k] is JointKind.REVOLUTE
            columns[k] = cross(axis[k], point) if rotary else axis[k]
        point = turned(point) + offset[k]
        columns = {j: turned(column) for j, column in columns.items()}
    return point, stack([columns[j] for j in joints], axis=1)


@kernel
def jacobian_derivatives(
    chain: SerialChain, q_derivatives: Float[Array, "terms joints"]
) -> Float[Array, "terms 6 joints"]:
    """Jacobian and its time derivatives along a motion.

    Args:
        chain: the chain.
        q_derivatives: joint coordinates and their time derivatives, shape
            (order + 1, joints).

    Returns:
        Shape (order + 1, 6, joints); entry k is the k-th time derivative.
    """
    frames = moving_frames(chain, from_derivatives(q_derivatives))
    return tool_jacobian(chain, frames).derivatives()


@kernel
def tool_motion(
    chain: SerialChain, q: PerJoint, qd: PerJoint, qdd: PerJoint
) -> tuple[Float[Array, "6"], Float[Array, "6"]]:
    """Velocity and acceleration of the tool in the base frame.

    Args:
        chain: the chain.
        q, qd, qdd: joint coordinates, velocities, accelerations, shape (joints,).

    Returns:
        Velocity (6,) [m/s, rad/s] and acceleration (6,) [m/s^2, rad/s^2].
    """
    value, rate = jax.jvp(lambda x: jacobian(chain, x), (q,), (qd,))
    return value @ qd, value @ qdd + rate @ qd
