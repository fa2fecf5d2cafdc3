"""Inverse kinematics as a minimisation, for singular poses and their surroundings."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .._checks import check_values
from .._custom_types import PerJoint, Scalar, Transform, as_real, require_float64
from ._chain import SerialChain
from ._ik_dls import PoseResults, row_weights, smallest_singular_value
from ._ik_evaluate import attached, errors_of, evaluate
from ._ik_numeric import NumericSolution
from ._starts import low_discrepancy


_ROWS = (0, 1, 2, 3, 4, 5)


def minimise_pose(
    chain: SerialChain,
    target: Transform,
    q: PerJoint,
    *,
    lower: PerJoint | None = None,
    upper: PerJoint | None = None,
    neighbours: int = 4,
    spread: Scalar | PerJoint | float = 0.05,
    characteristic_length: Scalar | float = 1.0,
    solver: optx.AbstractLeastSquaresSolver | None = None,
    max_steps: int = 100,
    position_tolerance: Scalar | float = 1e-6,
    rotation_tolerance: Scalar | float = 1e-6,
    throw: bool = True,
) -> NumericSolution:
    r"""Joint coordinates of the smallest pose error, from `q` and from around it.

    $\min_\theta |W\,\Delta x(\theta)|^2$, by Levenberg-Marquardt, needs no inverse of
    the Jacobian: it does not fail where that is singular. Started at a posture near a
    singular pose and at neighbours of it, it enters the pose with the smallest change
    of the joints among the solutions found. Limits enter as a penalty, zero within
    them.

    The solution has the derivative of `solve_pose`, finite at singular poses.

    Args:
        chain: the chain.
        target: pose of the tool in the base frame, shape (4, 4) [m].
        q: posture to stay near [rad] or [m], shape (joints,).
        lower, upper: limits [rad] or [m], shape (joints,); none unless given.
        neighbours: number of further starts, zero for none.
        spread: largest distance of their coordinates from `q` [rad] or [m], one for all
            joints or shape (joints,).
        characteristic_length: length that turns 1 rad into a distance [m].
        solver: of least squares; `optimistix.LevenbergMarquardt` unless given.
        max_steps: of each start.
        position_tolerance: largest distance from the target [m].
        rotation_tolerance: largest angle [rad].
        throw: raise an error if the pose is not reached; otherwise see `result`.

    Returns:
        The solution; `steps` are those of the start that it came from.

    Raises:
        ValueError: `neighbours` is negative, a lower limit is above the upper one, or
            JAX runs in single precision.

    References:
        [KinModell] (3-44) and the end of section 3.4.2.
    """
    require_float64("the minimisation of a pose error")
    if neighbours < 0:
        raise ValueError(f"`neighbours` must be 0 or more, but is {neighbours}")
    free = jnp.full_like(q, jnp.inf)
    lower = -free if lower is None else lower
    upper = free if upper is None else upper
    check_values("`lower` must not be above `upper`", lower, lower <= upper)
    if solver is None:
        solver = optx.LevenbergMarquardt(rtol=1e-12, atol=1e-12)
    weights = row_weights(characteristic_length)
    constants = (chain, target, q, lower, upper, weights)
    fixed, wanted, near, low, high, scales = jax.lax.stop_gradient(constants)
    spread = jax.lax.stop_gradient(as_real(spread))

    def residual(q, _):
        _, difference = evaluate(fixed, wanted, q)
        length = scales[-1]
        return scales * difference, length * (q - jnp.clip(q, low, high))

    def descend(start):
        found = optx.least_squares(
            residual,
            solver,
            jnp.clip(start, low, high),
            max_steps=max_steps,
            throw=False,
        )
        value = jnp.clip(found.value, low, high)
        _, difference = evaluate(fixed, wanted, value)
        return value, difference, found.stats["num_steps"]

    starts = _around(near, spread, neighbours)
    values, differences, steps = jax.vmap(descend)(starts)
    distances, angles = jax.vmap(errors_of)(differences)
    reached = (distances <= position_tolerance) & (angles <= rotation_tolerance)
    changes = jnp.sum((values - near[None]) ** 2, axis=1)
    errors = jnp.sum((scales[None] * differences) ** 2, axis=1)
    # the smallest change among what reaches the pose, or else the smallest error
    cost = jnp.where(jnp.any(reached), jnp.where(reached, changes, jnp.inf), errors)
    best = jnp.argmin(cost)

    found, is_reached = values[best], reached[best]
    matrix, _ = evaluate(fixed, wanted, found)
    smallest = smallest_singular_value(scales[:, None] * matrix)
    found = attached(_ROWS, chain, target, found, weights)
    result = PoseResults.where(
        is_reached,
        PoseResults.successful,
        PoseResults.where(
            steps[best] < max_steps,
            PoseResults.out_of_reach,
            PoseResults.max_steps_reached,
        ),
    )
    if throw:
        found = result.error_if(found, ~is_reached)
    return NumericSolution(
        found, result, distances[best], angles[best], smallest, steps[best]
    )


def _around(
    q: PerJoint, spread: Scalar | PerJoint, count: int
) -> Float[Array, "starts joints"]:
    """`q` and postures around it."""
    places = low_discrepancy(q.shape[0], np.arange(1.0, count + 1))
    others = q[None] + (spread * jnp.ones_like(q))[None] * (2 * places - 1)
    return jnp.concatenate([q[None], others])
