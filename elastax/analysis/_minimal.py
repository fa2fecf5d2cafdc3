"""Minimal realisation: the part of a system that inputs reach and outputs see."""

import numpy as np

from ._balancing import balanced


def minimal_matrices(A, B, C, D, *, tolerance: float | None = None):
    """Controllable and observable part of a system.

    Args:
        A, B, C, D: the system.
        tolerance: below which singular values of the balanced matrices count as zero,
            over the norm of A.

    Returns:
        A, B, C and the columns of the old state that the new state multiplies,
        shape (n, new n).

    References:
        Staircase algorithm [VanDooren1981].
    """
    A, B, C, D = (np.asarray(x, float) for x in (A, B, C, D))
    scaled = balanced(A, B, C, D)
    a, b, c = (np.asarray(x) for x in scaled[:3])
    if tolerance is None:
        tolerance = 100.0 * max(len(a), 1) * np.finfo(float).eps
    reach = _reachable(a, b, tolerance)
    a, b, c = reach.T @ a @ reach, reach.T @ b, c @ reach
    seen = _reachable(a.T, c.T, tolerance)
    a, b, c = seen.T @ a @ seen, seen.T @ b, c @ seen
    columns = np.asarray(scaled.state)[:, None] * (reach @ seen)
    inputs, outputs = np.asarray(scaled.inputs), np.asarray(scaled.outputs)
    return a, b / inputs[None], c * outputs[:, None], columns


def _reachable(a: np.ndarray, b: np.ndarray, tolerance: float) -> np.ndarray:
    """Orthonormal basis of what b reaches through a, step by step."""
    size = max(np.linalg.norm(a, 2) if a.size else 0.0, np.linalg.norm(b))
    found = np.zeros((len(a), 0))
    new = b
    while found.shape[1] < len(a) and new.shape[1]:
        new = new - found @ (found.T @ new)
        new = new - found @ (found.T @ new)
        left, values, _ = np.linalg.svd(new, full_matrices=False)
        new = left[:, values > tolerance * size]
        found = np.concatenate([found, new], axis=1)
        new = a @ new
    return found
