"""Low-discrepancy sequences of postures, from which searches start."""

import jax.numpy as jnp
import numpy as np


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
