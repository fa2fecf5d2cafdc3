"""Damped least squares: corrections near singular poses, and an iterative inverse."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._custom_types import PerJoint, Scalar, Transform, as_real
from .._taylor import Series, leading, product, solve_positive
from ._chain import SerialChain, forward_kinematics
from ._damping import AbstractDamping
from ._jacobian import jacobian
from ._se3 import rotation_error
from ._singular_values import singular_values


class PoseResults(eqx.Enumeration):
    """How an iterative inverse ended."""

    successful = ""
    out_of_reach = (
        "the corrections died out away from `target`, which is out of reach of the "
        "moving joints: move `target`, or start from another `q`"
    )
    max_steps_reached = (
        "`target` was not reached: raise `max_steps`, lower the damping or widen the "
        "limits, or start from a `q` nearer to it"
    )


class PoseSolution(eqx.Module):
    """Outcome of an iterative inverse.

    Attributes:
        value: joint coordinates [rad] or [m], shape (joints,).
        result: `PoseResults.successful`, or why not.
        error: norm of the remaining scaled error [m].
        steps: number of corrections made.
    """

    value: PerJoint
    result: PoseResults
    error: Scalar
    steps: Int[Array, ""]


def pose_error(target: Transform, actual: Transform) -> Float[Array, "6"]:
    """Error of a pose, target minus actual, translation above rotation.

    The text prints actual minus target in (3.85), which doubles the error instead of
    removing it, and takes absolute orientations, see `rotation_error`.

    Args:
        target: pose to reach, shape (4, 4) [m].
        actual: pose at hand, shape (4, 4) [m].

    Returns:
        Shape (6,): [m] and [rad], in the base frame.

    References:
        [Reiner2010] (3.57a), (3.85).
    """
    rotation = rotation_error(target[:3, :3], actual[:3, :3])
    return jnp.concatenate([target[:3, 3] - actual[:3, 3], rotation])


def row_weights(
    characteristic_length: Scalar | float, rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
) -> Float[Array, " rows"]:
    """Weights that give rotation rows the unit of length.

    Args:
        characteristic_length: length that turns 1 rad into a distance [m].
        rows: the rows of the pose that are kept; 0 to 2 are translations.

    Returns:
        1 for translation rows, the length [m] for rotation rows.
    """
    length = as_real(characteristic_length)
    return jnp.where(np.array(rows) < 3, jnp.ones_like(length), length)


def damped_least_squares(jacobian, error, damping, weights=None):
    r"""Correction that trades the remaining error against its own size.

    $\Delta\varphi = (J^T J + \lambda^2 I)^{-1} J^T \Delta r
    = J^T (J J^T + \lambda^2 I)^{-1} \Delta r$; the smaller system is solved.

    Every operand is an array, or a `Series`, which gives the correction together with
    its time derivatives.

    Args:
        jacobian: J, shape (rows, joints) [m/rad] and [rad/rad].
        error: target minus actual, shape (rows,) [m] and [rad].
        damping: lambda > 0, scalar, in the unit of the weighted rows.
        weights: factors for the rows, shape (rows,), such as `row_weights`.

    Returns:
        Correction [rad], shape (joints,); a `Series` of the lowest order among the
        operands that are series.

    References:
        [Reiner2010] (3.63b), (3.65), (3.70), (3.86), (3.87).
    """
    if weights is not None:
        jacobian = product("ij,i->ij", jacobian, weights)
        error = product("i,i->i", error, weights)
    # operands of equal kind and order
    series = [x for x in (jacobian, error, damping) if isinstance(x, Series)]
    if series:
        order = min(x.order for x in series)
        jacobian, error, damping = (
            _as_series(x, order) for x in (jacobian, error, damping)
        )
    rows, joints = jacobian.shape
    dtype = leading(jacobian).dtype
    identity = jnp.eye(min(rows, joints), dtype=dtype)
    square = product(",ij->ij", product(",->", damping, damping), identity)
    if rows <= joints:
        gram = product("ik,jk->ij", jacobian, jacobian)
        return product("ji,j->i", jacobian, solve_positive(gram + square, error))
    gram = product("ki,kj->ij", jacobian, jacobian)
    return solve_positive(gram + square, product("ji,j->i", jacobian, error))


def _as_series(x, order: int) -> Series:
    """`x` with derivatives up to `order`; those of an array vanish."""
    if isinstance(x, Series):
        return x.truncated(order)
    x = jnp.asarray(x)
    return Series(jnp.zeros((order + 1, *x.shape), x.dtype).at[0].set(x))


def smallest_singular_value(
    jacobian: Float[Array, "rows joints"], count: int | None = None
) -> Scalar:
    r"""Smallest singular value of a Jacobian, a measure of its distance from singular.

    Of all min(rows, joints) values including zero; (3.64c) of the text counts positive
    ones only, which misses the singular pose itself.

    Args:
        jacobian: shape (rows, joints), in one unit, see `row_weights`.
        count: number of singular values that the structure allows to be non-zero, where
            it is less than min(rows, joints); the smallest of these is returned.

    Returns:
        Scalar in the unit of `jacobian`. Its derivative is $u^T\dot J v$ while it is
        simple and positive.

    Raises:
        ValueError: `count` is not between 1 and min(rows, joints).

    References:
        [Reiner2010] (3.64).
    """
    available = min(jacobian.shape)
    count = available if count is None else count
    if not 1 <= count <= available:
        raise ValueError(f"`count` must be from 1 to {available}, but is {count}")
    return singular_values(jacobian)[count - 1]


def solve_damped(
    chain: SerialChain,
    target: Transform,
    q: PerJoint,
    *,
    damping: AbstractDamping,
    limiter: Callable[[PerJoint], PerJoint] | None = None,
    axes: tuple[int, ...] | None = None,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
    max_steps: int = 100,
    tolerance: float = 1e-10,
    throw: bool = True,
) -> PoseSolution:
    r"""Joint coordinates at which the tool has a pose, by damped least squares.

    Works for any chain, tilted axes included. Of a pose slightly out of reach the
    nearest one is found; the damping at singular poses, squared, has to exceed half the
    missing distance times the length of the arm, or the corrections overshoot. The
    solution is differentiable with respect to `chain`, `target` and the
    coordinates of the resting joints, by the implicit function theorem; the derivative
    is the least-squares one with the smallest change of the moving joints.

    Args:
        chain: the chain.
        target: pose of the tool in the base frame, shape (4, 4) [m].
        q: start [rad] or [m], shape (joints,).
        damping: damping [m] from the smallest singular value [m] of the scaled
            Jacobian.
        limiter: limits every correction [rad], such as `CorrectionLimiter`; none unless
            given.
        axes: indices of the joints that may move; all unless given.
        rows: rows of the pose error that count; (0, 1, 2) leaves the orientation free.
        characteristic_length: length that turns 1 rad into a distance [m].
        max_steps: largest number of corrections.
        tolerance: largest norm of the scaled error [m].
        throw: raise an error if the pose is not reached; otherwise see `result`.

    Returns:
        Coordinates, result, error and number of steps.

    Raises:
        ValueError: `axes` or `rows` are not distinct indices.

    References:
        [Reiner2010] (3.57), (3.70), (3.71).
    """
    axes = tuple(range(chain.number)) if axes is None else tuple(axes)
    check_indices("axes", axes, chain.number)
    check_indices("rows", rows, 6)
    moving, counted = np.array(axes), np.array(rows)
    length = jnp.asarray(characteristic_length, q.dtype)
    weights = jax.lax.stop_gradient(row_weights(length, rows))

    def scaled(chain, target, q):
        """Weighted Jacobian and error, and whether no axis is half a turn away."""
        actual = forward_kinematics(chain, q)
        error = weights * pose_error(target, actual)[counted]
        matrix = weights[:, None] * jacobian(chain, q)[counted][:, moving]
        # the rotation error vanishes at half a turn as well
        near = jnp.sum(target[:3, :3] * actual[:3, :3]) > 1
        return matrix, error, near if set(rows) >= {3, 4, 5} else jnp.array(True)

    def evaluate(q):
        matrix, error, near = scaled(fixed_chain, fixed_target, q)
        norm = jnp.sqrt(jnp.sum(error**2))
        return matrix, error, norm, (norm <= tolerance) & near

    def unfinished(state):
        _, _, reached, stalled, steps = state
        return ~reached & ~stalled & (steps < max_steps)

    def correct(state):
        q, (matrix, error), _, _, steps = state
        value = damping(smallest_singular_value(matrix))
        step = leading(damped_least_squares(matrix, error, value))
        step = step if limiter is None else limiter(step)
        q = q.at[moving].add(step)
        matrix, error, _, reached = evaluate(q)
        stalled = jnp.all(jnp.abs(step) <= 0.01 * tolerance) & ~reached
        return q, (matrix, error), reached, stalled, steps + 1

    # the iteration itself is not differentiated
    fixed_chain, fixed_target, start, damping, limiter = jax.tree.map(
        lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x,
        (chain, target, q, damping, limiter),
    )
    matrix, error, _, reached = evaluate(start)
    state = (start, (matrix, error), reached, jnp.array(False), jnp.array(0))
    found, _, reached, stalled, steps = jax.lax.while_loop(unfinished, correct, state)

    # derivative of the implicit function; the value of the term is zero
    matrix, _, norm, _ = evaluate(found)
    found = found + _resting(q, moving)
    _, moved_error, _ = scaled(chain, target, found)
    largest = singular_values(matrix)[0]
    rounding = float(np.sqrt(jnp.finfo(q.dtype).eps))
    value = jnp.where(
        reached, rounding * largest, damping(smallest_singular_value(matrix))
    )
    correction = damped_least_squares(matrix, moved_error, value)
    found = found.at[moving].add(correction - jax.lax.stop_gradient(correction))

    result = PoseResults.where(
        reached,
        PoseResults.successful,
        PoseResults.where(
            stalled, PoseResults.out_of_reach, PoseResults.max_steps_reached
        ),
    )
    if throw:
        found = result.error_if(found, ~reached)
    return PoseSolution(found, result, norm, steps)


def _resting(q: PerJoint, moving: np.ndarray) -> PerJoint:
    """Zero, with the derivative of `q` for the joints that do not move."""
    change = q - jax.lax.stop_gradient(q)
    return change.at[moving].set(0.0)


def check_indices(name: str, indices: tuple[int, ...], number: int) -> None:
    """Raise `ValueError` unless the indices are distinct and below `number`."""
    distinct = len(set(indices)) == len(indices) > 0
    if not (distinct and all(0 <= index < number for index in indices)):
        raise ValueError(
            f"`{name}` must be distinct indices from 0 to {number - 1}, but is "
            f"{indices}"
        )
