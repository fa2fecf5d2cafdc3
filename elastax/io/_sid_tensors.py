"""Tensors, cross products and residuals of SID data, in NumPy."""

import numpy as np


# rows of `J`, and columns of `Oe` as all known generators write them
INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


def tensor(elements: np.ndarray, order=INERTIA) -> np.ndarray:
    """Symmetric tensors of six elements, shape (..., 6) to (..., 3, 3)."""
    full = np.zeros((*elements.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(order):
        full[..., i, j] = full[..., j, i] = elements[..., k]
    return full


def elements(full: np.ndarray, order=INERTIA) -> np.ndarray:
    """The six elements of symmetric tensors."""
    rows, columns = np.array(order).T
    return full[..., rows, columns]


def in_squares(full: np.ndarray, order=SQUARES) -> np.ndarray:
    r"""Coefficients of $\omega^T A\,\omega$ for the six products of the speeds."""
    return elements(full, order) * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


def from_squares(values: np.ndarray) -> np.ndarray:
    """Inverse of `in_squares`."""
    return tensor(values * np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]), SQUARES)


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices of the cross products, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors), -1, 0)
    zero = np.zeros_like(x)
    return np.stack(
        [
            np.stack([zero, -z, y], axis=-1),
            np.stack([z, zero, -x], axis=-1),
            np.stack([-y, x, zero], axis=-1),
        ],
        axis=-2,
    )


def largest(array: np.ndarray) -> float:
    """Largest magnitude; zero for an empty array."""
    return float(np.abs(array).max(initial=0.0))


def residual(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference over the largest element of both."""
    size = max(largest(one), largest(other))
    return largest(one - other) / size if size > 0 else 0.0


def asymmetry(array: np.ndarray) -> float:
    """Residual of the first two axes against each other."""
    return residual(array, np.swapaxes(array, 0, 1))


def symmetric(array: np.ndarray) -> np.ndarray:
    """Mean of the array and its transpose in the first two axes."""
    return 0.5 * (array + np.swapaxes(array, 0, 1))
