r"""Finite zeros and infinite structure of a state-space system.

The system matrix $P(s) = [A - sI, B;\, C, D]$ is reduced by orthogonal
transformations to one whose D is square and regular: rows and columns that belong to
the infinite structure are split off step by step, by ranks. What is left is a regular
pencil with finite eigenvalues only, for the QZ algorithm. A plain QZ of P would smear
an infinite zero of order k over a circle of radius $\varepsilon^{-1/k}$, which for
elastic robots (k = 3 to 5) lies among the finite zeros.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg

from ._balancing import balanced


# of ranks, over the norm: rounding grows with every step of the reduction, by the
# inverse of the singular values that were kept
_TOLERANCE = 1e-11


class ZeroStructure(NamedTuple):
    """Zeros of a state-space system.

    Attributes:
        finite: the invariant zeros [1/s], sorted by their real parts, shape (zeros,).
        infinite: orders of the infinite zeros, ascending; for a square system with
            relative degrees r_i these are the r_i > 0.
        normal_rank: rank of the transfer matrix, but for some s.
        states: number of states.
        tolerance: singular values of the balanced matrices below it counted as zero.
        kept: the smallest singular value that counted, over the tolerance.
        dropped: the largest that did not, over the tolerance.
    """

    finite: np.ndarray
    infinite: tuple[int, ...]
    normal_rank: int
    states: int
    tolerance: float
    kept: float
    dropped: float


class _Ranks:
    """Decides ranks and remembers how clear they were."""

    def __init__(self, tolerance: float):
        self.tolerance, self.kept, self.dropped = tolerance, np.inf, 0.0

    def split(self, matrix: np.ndarray) -> tuple[np.ndarray, int]:
        """Left singular vectors, and the rank."""
        if 0 in matrix.shape:
            return np.eye(matrix.shape[0]), 0
        left, values, _ = np.linalg.svd(matrix)
        rank = int(np.sum(values > self.tolerance))
        if rank:
            self.kept = min(self.kept, values[rank - 1] / self.tolerance)
        if rank < len(values):
            self.dropped = max(self.dropped, values[rank] / self.tolerance)
        return left, rank


def zero_structure(A, B, C, D, *, tolerance: float | None = None) -> ZeroStructure:
    """Invariant zeros and infinite zeros, of square and of other systems.

    For systems that are not square, and have fast and slow parts, the ranks can drown
    in rounding: look at `kept` and `dropped`, which should be far above and below one.

    Args:
        A, B, C, D: real matrices, shapes (n, n), (n, m), (p, n), (p, m).
        tolerance: below which singular values of the balanced system matrix count as
            zero, over its norm.

    References:
        [EmamiNaeini1982]; QZ: [MolerStewart1973].
    """
    A, B, C, D = (np.asarray(x, float) for x in (A, B, C, D))
    if not all(np.isfinite(x).all() for x in (A, B, C, D)):
        raise ValueError(
            "the matrices of the system must be finite, but hold NaN or inf"
        )
    n = A.shape[0]
    scaled = balanced(A, B, C, D)
    A, B, C, D = (np.asarray(x) for x in scaled[:4])
    whole = np.block([[A, B], [C, D]])
    size = float(np.linalg.norm(whole, 2)) if whole.size else 1.0
    if tolerance is None:
        tolerance = _TOLERANCE
    ranks = _Ranks(tolerance * max(size, 1e-300))
    A, B, C, D, counts = _reduced(A, B, C, D, ranks)
    # the same from the other side makes D square
    A, C, B, D, _ = _reduced(A.T, C.T, B.T, D.T, ranks)
    A, B, C, D = A.T, B.T, C.T, D.T
    rank = D.shape[0]
    return ZeroStructure(
        _finite(A, B, C, D),
        _orders(counts),
        rank,
        n,
        ranks.tolerance,
        ranks.kept,
        ranks.dropped,
    )


def _reduced(A, B, C, D, ranks: _Ranks):
    """The part with a D of full row rank; how many rows every step brought in."""
    counts = []
    while True:
        left, rank = ranks.split(D)
        counts.append(rank)
        if rank == D.shape[0]:
            return A, B, C, D, counts
        C, D = left.T @ C, left.T @ D
        C_1, D_1, C_2 = C[:rank], D[:rank], C[rank:]
        # directions of the state that the other outputs see
        right, seen = ranks.split(C_2.T)
        if seen == 0:
            return A, B, C_1, D_1, counts
        turn = np.concatenate([right[:, seen:], right[:, :seen]], axis=1)
        n = A.shape[0] - seen
        A, B, C_1 = turn.T @ A @ turn, turn.T @ B, C_1 @ turn
        A, B, C, D = (
            A[:n, :n],
            B[:n],
            np.concatenate([A[n:, :n], C_1[:, :n]]),
            np.concatenate([B[n:], D_1]),
        )


def _orders(counts: list[int]) -> tuple[int, ...]:
    """Orders of the infinite zeros: the ranks grow by one for each of that order."""
    orders: list[int] = []
    for order, (before, after) in enumerate(zip(counts, counts[1:]), 1):
        orders += [order] * (after - before)
    return tuple(orders)


def _finite(A, B, C, D) -> np.ndarray:
    n, m = A.shape[0], D.shape[1]
    if n == 0:
        return np.zeros(0, complex)
    if m:
        # directions of state and input that no output sees: those of [C D] to zero
        rows = np.concatenate([C, D], axis=1)
        _, _, right = np.linalg.svd(rows)
        hidden = right[m:].T
        left = np.concatenate([A, B], axis=1) @ hidden
        zeros = scipy.linalg.eigvals(left, hidden[:n])
    else:
        zeros = scipy.linalg.eigvals(A)
    return np.sort_complex(zeros)
