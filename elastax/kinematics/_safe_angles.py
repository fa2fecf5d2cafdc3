"""Roots and angles with finite derivatives where they are not determined."""

import jax.numpy as jnp
import numpy as np


def length(vector):
    """Euclidean length of a vector that is not zero."""
    return jnp.sqrt(jnp.sum(vector**2))


def root(x, threshold):
    """Square root, zero with zero slope up to `threshold`."""
    positive = x > threshold
    # a safe operand where the branch is not taken: the slope would be infinite
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)


def angle(y, x, kept, threshold):
    """`arctan2(y, x)`, or `kept` where the squared length is within `threshold`."""
    free = x**2 + y**2 <= threshold
    return jnp.where(
        free, kept, jnp.arctan2(jnp.where(free, 0.0, y), jnp.where(free, 1.0, x))
    )


def wrapped(value):
    """Angle in (-pi, pi] [rad]."""
    return value - 2 * np.pi * jnp.ceil((value - np.pi) / (2 * np.pi))
