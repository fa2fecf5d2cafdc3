"""What iterative inverses ask at a posture, and the derivative of what they find."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import Matrix3, PerJoint, Scalar, Transform, Vector3
from .._kernel import kernel
from .._taylor import leading
from ._chain import SerialChain, moving_frames
from ._ik_dls import damped_least_squares
from ._jacobian import tool_jacobian
from ._logarithm import pose_difference
from ._se3 import inverse_transform, transform
from ._structured import JointStructure, StructuredJoints


Difference = Float[Array, "6"]
Geometric = Float[Array, "6 joints"]

_ROUNDING = 1e-12  # damping squared over squared size: above rounding, below accuracy


@kernel
def evaluate(
    chain: SerialChain, target: Transform, q: PerJoint
) -> tuple[Geometric, Difference]:
    """Geometric Jacobian at a posture and what its pose lacks to the target."""
    frames = moving_frames(chain, q)
    actual = transform(leading(frames.tool_rotation), leading(frames.tool_position))
    return leading(tool_jacobian(chain, frames)), pose_difference(target, actual)


def without_base(
    chain: SerialChain, target: Transform
) -> tuple[SerialChain, Transform]:
    """Chain and target seen from the chain's first frame.

    What does not move is computed here, once, in front of the loop over postures: the
    joints stand in their predecessors with their axes along z, unless their structure
    is known, which saves more.
    """
    target = inverse_transform(chain.base) @ target
    identity = np.eye(4)
    if isinstance(chain.joints, StructuredJoints):
        return dataclasses.replace(chain, base=identity), target
    frames = chain.joints.frames()
    first = jnp.asarray(identity, frames.before.dtype)[None]
    fixed = jnp.concatenate([first, frames.after[:-1]]) @ frames.before
    turned = transform(jax.vmap(_basis)(frames.axis), jnp.zeros_like(frames.axis))
    back = jax.vmap(inverse_transform)(turned)
    before = jnp.concatenate([first, back[:-1]]) @ fixed @ turned
    none = jnp.zeros((0, 3), before.dtype)
    structure = (JointStructure(None, (0, 0, 1), True),) * chain.number
    joints = StructuredJoints(before[:, :3, :3], before[:, :3, 3], none, structure)
    tool = back[-1] @ frames.after[-1] @ chain.tool
    return SerialChain(joints, identity, tool, chain.kinds), target


def _basis(axis: Vector3) -> Matrix3:
    """A rotation that maps z onto `axis`, without a singular direction."""
    x, y, z = axis
    sign = jnp.where(z < 0, -1.0, 1.0)
    a = -1 / (sign + z)
    b = x * y * a
    columns = [
        [1 + sign * x * x * a, sign * b, -sign * x],
        [b, sign + y * y * a, -y],
        [x, y, z],
    ]
    return jnp.stack([jnp.stack(c) for c in columns], axis=1)


@kernel
def least_norm(
    matrix: Float[Array, "rows joints"], error: Float[Array, " rows"]
) -> PerJoint:
    """Pseudo-inverse times `error`, finite where the matrix loses rank.

    Least squares with a damping near rounding, and once more for what is left: the
    relative error is the square of that damping over the singular values.
    """
    size = jnp.sum(matrix**2)
    damping = jnp.sqrt(_ROUNDING * size + jnp.finfo(matrix.dtype).tiny)
    first = damped_least_squares(matrix, error, damping)
    return first + damped_least_squares(matrix, error - matrix @ first, damping)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def attached(
    rows: tuple[int, ...],
    chain: SerialChain,
    target: Transform,
    found: PerJoint,
    weights: Float[Array, " rows"],
) -> PerJoint:
    """`found`, with its derivative by chain and target, as an implicit function.

    Where more joints than rows move, or fewer, the derivative is the least-squares one
    of smallest norm.

    Args:
        rows: of the pose difference that vanish at `found`.
        chain, target: on which it depends.
        found: joint coordinates that are not differentiated themselves.
        weights: of the rows, which matter where fewer joints than rows move.
    """
    return found


@attached.defjvp
def _attached_jvp(rows, primals, tangents):
    chain, target, found, weights = primals
    # with the derivative attached, for those who differentiate once more
    found = attached(rows, chain, target, found, weights)
    counted = np.array(rows)
    matrix, _ = evaluate(chain, target, found)
    lacking = lambda chain, target: evaluate(chain, target, found)[1]
    moved = jax.jvp(lacking, (chain, target), tuple(tangents[:2]))[1]
    scaled = weights[:, None] * matrix[counted]
    return found, least_norm(scaled, weights * moved[counted])


def errors_of(difference: Difference) -> tuple[Scalar, Scalar]:
    """Distance [m] and angle [rad] that a pose difference stands for."""
    return _norm(difference[:3]), _norm(difference[3:])


def _norm(vector):
    return jnp.sqrt(jnp.sum(vector**2))
