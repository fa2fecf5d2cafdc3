"""Chains in which some joints are locked at zero."""

import jax.numpy as jnp
import numpy as np

from .._checks import is_concrete
from ..kinematics import SAME, SerialChain, placement, placements, structured


def locked_chain(chain: SerialChain, keep: tuple[int, ...]):
    """The chain with only the joints `keep`; the others stay at zero for good.

    Args:
        chain: the chain.
        keep: indices of the joints that go on moving, in order.

    Returns:
        The new chain (frames; what was structure stays structure) and the placement of
        the old links: for every old joint the new joint that carries it (-1 for the
        ground), and the pose of the old moving frame in the frame behind that joint,
        shape (joints, 4, 4).
    """
    dtype = chain.base.dtype
    carriers, poses, joints = [], [], []
    # of the current frame in the frame behind the last kept joint
    base, tool = (
        np.asarray(x) if is_concrete(x) else x for x in (chain.base, chain.tool)
    )
    place = placement(base)
    carrier = -1
    for k, (before, axis, after) in enumerate(placements(chain.joints)):
        place = place.then(before)
        if k in keep:
            joints.append((place, axis))
            place = SAME
            carrier += 1
        carriers.append(carrier)
        poses.append(place.matrix(dtype))
        place = place.then(after)
    new = SerialChain(
        structured(joints),
        np.eye(4, dtype=dtype),
        place.matrix(dtype) @ tool,
        tuple(chain.kinds[k] for k in keep),
    )
    stack = np.stack if is_concrete(*poses) else jnp.stack
    return new, (tuple(carriers), stack(poses))
