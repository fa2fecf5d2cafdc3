"""Postures to start from: random ones, and sequences that fill a range evenly."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_values
from .._custom_types import PerJoint, as_real


def low_discrepancy(dimensions: int, number):
    r"""Points of the unit cube that fill it evenly, however many are taken.

    $u_k = k\,(\varphi^{-1}, \ldots, \varphi^{-d}) \bmod 1$ with
    $\varphi^{d+1} = \varphi + 1$, the golden ratio for d = 1.

    Args:
        dimensions: d.
        number: k, a number, or shape (points,).

    Returns:
        Shape (dimensions,) or (points, dimensions).
    """
    ratio = 2.0
    for _ in range(60):  # a contraction by 1/2 at least
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    number = jnp.asarray(number)
    place = jnp.multiply.outer(number, jnp.asarray(steps, number.dtype))
    return place - jnp.floor(place)


def random_joints(
    lower: PerJoint, upper: PerJoint, number: int, *, key: Array
) -> Float[Array, "number joints"]:
    """Independent joint coordinates, uniform between the limits.

    Args:
        lower, upper: limits [rad] or [m], shape (joints,), such as those of an `Arm`.
        number: how many.
        key: of the random numbers.

    Raises:
        ValueError: a limit is not finite, or `upper` not above `lower`.
    """
    lower, upper = as_real(lower), as_real(upper)
    check_values("limits must be finite", upper - lower, jnp.isfinite(upper - lower))
    check_values("`upper` limits must lie above `lower`", upper, upper > lower)
    share = jax.random.uniform(key, (number, lower.shape[0]), lower.dtype)
    return lower[None] + share * (upper - lower)[None]
