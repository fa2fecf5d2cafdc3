r"""Singular values of small matrices without LAPACK.

One-sided Jacobi rotations make the rows of a matrix orthogonal; their lengths are the
singular values, exact to rounding relative to the largest. The number of rotations is
fixed. Up to three rows they are straight-line code for a kernel, beyond that a loop.

LAPACK on a batch waits in a thread of the processor's pool for tasks that it queues to
the same pool (jaxlib 0.10): two such calls at once on two cores wait for ever.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._kernel import kernel


_UNROLLED = 3  # rows
_SWEEPS = {1: 0, 2: 1, 3: 5}  # four are enough for three rows, random and graded
_LOOP_SWEEPS = 10  # seven are enough for six rows

Values = Float[Array, " values"]


@jax.custom_jvp
def singular_values(matrix: Float[Array, "rows columns"]) -> Values:
    r"""Singular values in descending order, min(rows, columns) of them.

    The derivative is $u^T \dot A\,v$ with the singular vectors of each; it is that of
    the matrix while the value is simple. Where a value is zero but for rounding, its
    derivative is taken to be zero: it has a minimum there.

    References:
        [Reiner2010] (3.64).
    """
    return _decomposed(matrix)[1]


@singular_values.defjvp
def _singular_values_jvp(primals, tangents):
    (matrix,), (change,) = primals, tangents
    left, values, right = _decomposed(matrix)
    return values, jnp.sum((left @ change) * right, axis=1)


def _decomposed(matrix):
    """Left vectors (values, rows), values, right vectors (values, columns)."""
    rows, columns = matrix.shape
    if rows > columns:
        right, values, left = _decomposed(matrix.T)
        return left, values, right
    if rows <= _UNROLLED:
        return _unrolled(matrix)
    return _looped(matrix)


def _rotated(above, below, columns: int):
    """Pairs of rows, orthogonal in their first `columns` entries."""
    a, b = above[:, :columns], below[:, :columns]
    dot = lambda x, y: jnp.sum(x * y, axis=1, keepdims=True)
    apart, product = dot(b, b) - dot(a, a), 2 * dot(a, b)
    square = apart**2 + product**2
    # a safe operand where the branch is not taken: the root has no slope at zero
    needed = square > 0
    root = jnp.sqrt(jnp.where(needed, square, 1.0))
    sign = jnp.where(apart < 0, -1.0, 1.0)
    tangent = jnp.where(needed, product * sign / (jnp.abs(apart) + root), 0.0)
    cosine = 1 / jnp.sqrt(1 + tangent**2)
    sine = cosine * tangent
    return cosine * above - sine * below, sine * above + cosine * below


@kernel
def _unrolled(matrix):
    """Rotations row by row, as straight-line code."""
    count, columns = matrix.shape
    identity = jnp.eye(count, dtype=matrix.dtype)
    turned = jnp.concatenate([matrix, identity], axis=1)
    rows = [turned[k : k + 1] for k in range(count)]
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    for i, j in pairs * _SWEEPS[count]:
        rows[i], rows[j] = _rotated(rows[i], rows[j], columns)
    squares = [jnp.sum(row[:, :columns] ** 2) for row in rows]
    for i, j in pairs:  # descending
        swap = squares[i] < squares[j]
        pick = lambda x, y: (jnp.where(swap, y, x), jnp.where(swap, x, y))
        rows[i], rows[j] = pick(rows[i], rows[j])
        squares[i], squares[j] = pick(squares[i], squares[j])
    return _vectors(jnp.concatenate(rows), jnp.stack(squares), columns)


def _looped(matrix):
    """Disjoint pairs side by side, everyone against everyone like in a tournament."""
    count, columns = matrix.shape
    identity = jnp.eye(count, dtype=matrix.dtype)
    turned = jnp.concatenate([matrix, identity], axis=1)
    even = count + count % 2
    turned = jnp.pad(turned, ((0, even - count), (0, 0)))
    # the first row stays, the others move on by one seat around the table
    seats = np.arange(even).reshape(2, -1)
    circle = np.concatenate([seats[0, 1:], seats[1, ::-1]])
    moved = dict(zip(circle, np.roll(circle, 1)))
    order = np.array([0, *(moved[k] for k in range(1, even))])

    def play(_, turned):
        half = even // 2
        above, below = _rotated(turned[:half], turned[half:], columns)
        return jnp.concatenate([above, below])[order]

    rounds = _LOOP_SWEEPS * (even - 1)
    turned = jax.lax.fori_loop(0, rounds, play, turned)
    squares = jnp.sum(turned[:, :columns] ** 2, axis=1)
    # an added row has no part in any of the given ones
    given = jnp.sum(turned[:, columns:] ** 2, axis=1) > 0.5
    descending = jnp.argsort(jnp.where(given, -squares, jnp.inf))[:count]
    return _vectors(turned[descending], squares[descending], columns)


def _vectors(turned, squares, columns: int):
    """Left vectors, values and right vectors of orthogonal rows."""
    largest = squares[0]
    rounding = (8 * jnp.finfo(squares.dtype).eps) ** 2
    positive = squares > rounding * largest
    safe = jnp.where(positive, squares, 1.0)
    root = jnp.sqrt(safe)
    # tiny values are shown as they are, with a root that has no infinite slope
    some = squares > 0
    tiny = jnp.where(some, jnp.sqrt(jnp.where(some, squares, 1.0)), 0.0)
    values = jnp.where(positive, root, tiny)
    right = jnp.where(positive, 1 / root, 0.0)[:, None] * turned[:, :columns]
    return turned[:, columns:], values, right
