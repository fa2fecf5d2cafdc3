"""Chains in which some joints are locked at zero."""

import jax.numpy as jnp

from ..kinematics import FrameJoints, SerialChain


def locked_chain(chain: SerialChain, keep: tuple[int, ...]):
    """The chain with only the joints `keep`; the others stay at zero for good.

    Args:
        chain: the chain.
        keep: indices of the joints that go on moving, in order.

    Returns:
        The new chain (joint frames) and the placement of the old links: for every old
        joint the new joint that carries it (-1 for the ground), and the pose of the old
        moving frame in the frame behind that joint, shape (joints, 4, 4).
    """
    frames = chain.joints.frames()
    joints, poses, before = [], [], []
    pose = chain.base  # of the current frame in the frame behind the last kept joint
    carrier = -1
    for k in range(chain.number):
        pose = pose @ frames.before[k]
        if k in keep:
            before.append(pose)
            pose = jnp.eye(4, dtype=pose.dtype)
            carrier += 1
        joints.append(carrier)
        poses.append(pose)
        pose = pose @ frames.after[k]
    before = jnp.stack(before)
    index = jnp.array(keep)
    new = SerialChain(
        FrameJoints(before[:, :3, :3], before[:, :3, 3], frames.axis[index]),
        jnp.eye(4, dtype=pose.dtype),
        pose @ chain.tool,
        tuple(chain.kinds[k] for k in keep),
    )
    return new, (tuple(joints), jnp.stack(poses))
