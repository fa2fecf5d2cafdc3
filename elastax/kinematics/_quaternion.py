r"""Unit quaternions (w, x, y, z), scalar part first.

$q = (\cos\tfrac\varphi2,\; a\sin\tfrac\varphi2)$ turns by $\varphi$ about the unit
vector a; the product of quaternions has the order of that of matrices. Both q and -q
are the same rotation: here $w \ge 0$, and where w is zero the first of x, y, z that is
none is positive, unless a quaternion from before says which.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import Matrix3
from .._kernel import kernel
from .._taylor import LEVI_CIVITA, leading, product, skew


Quaternion = Float[Array, "4"]


def _hamilton() -> np.ndarray:
    """Tensor H with $(a b)_i = H_{ijk} a_j b_k$."""
    tensor = np.zeros((4, 4, 4))
    tensor[0] = np.diag([1.0, -1.0, -1.0, -1.0])
    tensor[1:, 1:, 1:] = LEVI_CIVITA
    for k in (1, 2, 3):
        tensor[k, 0, k] = tensor[k, k, 0] = 1.0
    return tensor


HAMILTON = _hamilton()
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def quaternion_product(left, right):
    """Product of two quaternions: the turn `right`, then the turn `left`.

    Args:
        left, right: arrays of shape (4,), or `Series`.
    """
    tensor = jnp.asarray(HAMILTON, leading(left).dtype)
    return product("ik,k->i", product("ijk,j->ik", tensor, left), right)


@kernel
def rotation_from_quaternion(quaternion: Quaternion) -> Matrix3:
    r"""Rotation of a quaternion of any length but zero.

    $R = I + \tfrac{2}{q^Tq}(w\,\tilde v + \tilde v\tilde v)$. A quaternion of the
    length zero gives the identity.

    Args:
        quaternion: (w, x, y, z), shape (4,).
    """
    turn, square = skew(quaternion[1:]), jnp.sum(quaternion**2)
    # a safe operand for the length zero
    scale = 2 / jnp.where(square > 0, square, 1.0)
    identity = jnp.eye(3, dtype=turn.dtype)
    return identity + scale * (quaternion[0] * turn + turn @ turn)


@kernel
def quaternion_from_rotation(
    rotation: Matrix3, previous: Quaternion | None = None
) -> Quaternion:
    """Unit quaternion of a rotation.

    From the row of the matrix 4 q q^T with the largest diagonal element: nothing
    cancels, and derivatives are finite for all angles. At half a turn the sign jumps,
    the derivative is that of the sign that is returned.

    Args:
        rotation: shape (3, 3).
        previous: quaternion to stay close to: of q and -q the nearer one is returned.

    Returns:
        (w, x, y, z), shape (4,).
    """
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    rows = [
        [1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [None, 1 + 2 * r[0, 0] - trace, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [None, None, 1 + 2 * r[1, 1] - trace, r[1, 2] + r[2, 1]],
        [None, None, None, 1 + 2 * r[2, 2] - trace],
    ]
    outer = jnp.stack(
        [jnp.stack([rows[min(i, j)][max(i, j)] for j in range(4)]) for i in range(4)]
    )
    row, largest = outer[0], outer[0, 0]
    for k in (1, 2, 3):
        larger = outer[k, k] > largest
        row = jnp.where(larger, outer[k], row)
        largest = jnp.where(larger, outer[k, k], largest)
    quaternion = row / jnp.sqrt(jnp.sum(row**2))
    if previous is not None:
        return quaternion * jnp.where(jnp.sum(quaternion * previous) < 0, -1.0, 1.0)
    first = quaternion[3]
    for k in (2, 1, 0):
        first = jnp.where(quaternion[k] == 0, first, quaternion[k])
    return quaternion * jnp.where(first < 0, -1.0, 1.0)


def continuous_quaternions(
    quaternions: Float[Array, "times 4"], start: Quaternion | None = None
) -> Float[Array, "times 4"]:
    """The same rotations along a path without jumps of the sign.

    Every quaternion has the sign that brings it closer to the one in front of it, which
    is the shorter arc.

    Args:
        quaternions: along a path, shape (times, 4).
        start: quaternion in front of the first one, itself unless given.
    """
    start = quaternions[0] if start is None else start
    ahead = jnp.concatenate([start[None], quaternions[:-1]])
    turns = jnp.where(jnp.sum(ahead * quaternions, axis=1) < 0, -1.0, 1.0)
    signs = jnp.cumprod(jax.lax.stop_gradient(turns).astype(quaternions.dtype))
    return signs[:, None] * quaternions
