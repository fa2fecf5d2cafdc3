"""Inverse kinematics of any chain by iteration from one start, within limits."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .._checks import check_values
from .._custom_types import PerJoint, Scalar, Transform, as_real
from ._chain import SerialChain
from ._ik_dls import (
    PoseResults,
    check_indices,
    row_weights,
    smallest_singular_value,
)
from ._ik_evaluate import attached, errors_of, evaluate
from ._ik_steps import AbstractStep, ErrorDampedStep, limit_step
from ._manipulability import scaled_jacobian


class NumericSolution(eqx.Module):
    """Outcome of an iteration from one start.

    Attributes:
        value: joint coordinates [rad] or [m], shape (joints,).
        result: `PoseResults.successful`, or why not.
        position_error: distance of the tool from the target [m].
        rotation_error: angle between tool and target [rad].
        smallest_singular_value: of the scaled Jacobian at `value` [m]: the distance
            from a singular posture.
        steps: number of corrections made.
    """

    value: PerJoint
    result: PoseResults
    position_error: Scalar
    rotation_error: Scalar
    smallest_singular_value: Scalar
    steps: Int[Array, ""]


def singular_distance(
    chain: SerialChain,
    q: PerJoint,
    *,
    characteristic_length: Scalar | float = 1.0,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
) -> Scalar:
    """Smallest singular value of the scaled Jacobian [m]; zero at a singular posture.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).
        characteristic_length: length that turns 1 rad into a distance [m].
        rows: the rows of the pose that count; (0, 1, 2) leaves the orientation free.

    References:
        [Reiner2010] (3.64), [KinModell] (3-42), with rows of one unit.
    """
    check_indices("rows", rows, 6)
    return smallest_singular_value(
        scaled_jacobian(chain, q, characteristic_length, rows)
    )


def solve_pose(
    chain: SerialChain,
    target: Transform,
    q: PerJoint,
    *,
    step: AbstractStep | None = None,
    lower: PerJoint | None = None,
    upper: PerJoint | None = None,
    largest_step: Scalar | PerJoint | float | None = 1.0,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
    max_steps: int = 100,
    position_tolerance: Scalar | float = 1e-9,
    rotation_tolerance: Scalar | float = 1e-9,
    throw: bool = True,
) -> NumericSolution:
    r"""Joint coordinates at which the tool has a pose, by iterated corrections.

    Joints at a limit rest as long as the error pushes them outwards, and no joint
    passes its limit. An arm with too few joints comes to rest at the pose of the
    smallest error, with `PoseResults.out_of_reach`. A target farther away than the arm
    reaches needs a `DampedStep` whose damping, squared, exceeds half the missing
    distance times the length of the arm, or `minimise_pose`: else the arm swings about
    the stretched posture until `max_steps`.

    The solution is differentiable with respect to `chain` and `target` by the implicit
    function theorem; for a redundant arm the derivative is the one of the smallest
    change, although the solution depends on the start as well.

    Args:
        chain: the chain.
        target: pose of the tool in the base frame, shape (4, 4) [m].
        q: start [rad] or [m], shape (joints,).
        step: how corrections follow from Jacobian and error; `ErrorDampedStep` unless
            given.
        lower, upper: limits [rad] or [m], shape (joints,); none unless given.
        largest_step: of a joint in one correction [rad] or [m]; `None` for any.
        rows: rows of the pose that count; (0, 1, 2) leaves the orientation free.
        characteristic_length: length that turns 1 rad into a distance [m].
        max_steps: largest number of corrections.
        position_tolerance: largest distance in the rows that count [m].
        rotation_tolerance: largest angle in the rows that count [rad].
        throw: raise an error if the pose is not reached; otherwise see `result`.

    Raises:
        ValueError: `rows` are not distinct indices, or a lower limit is above the upper
            one.

    References:
        [Berns] "Optimierung: Algorithmus"; [KinModell] (3-43), (3-130), with the
        bracket that the text lacks; [Reiner2010] (3.57), (3.58).
    """
    check_indices("rows", rows, 6)
    counted = np.array(rows)
    step = ErrorDampedStep() if step is None else step
    free = jnp.full_like(q, jnp.inf)
    lower = -free if lower is None else lower
    upper = free if upper is None else upper
    check_values("`lower` must not be above `upper`", lower, lower <= upper)
    largest = None if largest_step is None else as_real(largest_step)
    weights = row_weights(characteristic_length, rows)
    numbers = as_real(position_tolerance), as_real(rotation_tolerance)
    # the iteration itself is not differentiated
    fixed_chain, wanted, start, step, low, high, largest, scales, tolerances = (
        jax.lax.stop_gradient(
            (chain, target, q, step, lower, upper, largest, weights, numbers)
        )
    )
    keep = np.isin(np.arange(6), counted)

    def look(q):
        matrix, difference = evaluate(fixed_chain, wanted, q)
        distance, angle = errors_of(jnp.where(keep, difference, 0.0))
        reached = (distance <= tolerances[0]) & (angle <= tolerances[1])
        scaled = scales[:, None] * matrix[counted], scales * difference[counted]
        return *scaled, distance, angle, reached

    def unfinished(state):
        _, seen, stalled, steps = state
        return ~seen[-1] & ~stalled & (steps < max_steps)

    def correct(state):
        q, (matrix, error, *_), _, steps = state
        push = error @ matrix
        resting = ((q <= low) & (push < 0)) | ((q >= high) & (push > 0))
        change = step(jnp.where(resting[None], 0.0, matrix), error, q)
        change = jnp.where(resting, 0.0, change)
        if largest is not None:
            change = limit_step(change, largest)
        new = jnp.clip(q + change, low, high)
        seen = look(new)
        # nothing moves by more than what would matter
        still = 1e-2 * jnp.minimum(*tolerances)
        return new, seen, jnp.all(jnp.abs(new - q) <= still) & ~seen[-1], steps + 1

    start = jnp.clip(start, low, high)
    state = start, look(start), jnp.array(False), jnp.array(0)
    found, seen, stalled, steps = jax.lax.while_loop(unfinished, correct, state)
    matrix, _, distance, angle, reached = seen

    found = attached(rows, chain, target, found, weights)
    result = PoseResults.where(
        reached,
        PoseResults.successful,
        PoseResults.where(
            stalled, PoseResults.out_of_reach, PoseResults.max_steps_reached
        ),
    )
    if throw:
        found = result.error_if(found, ~reached)
    smallest = smallest_singular_value(matrix)
    return NumericSolution(found, result, distance, angle, smallest, steps)
