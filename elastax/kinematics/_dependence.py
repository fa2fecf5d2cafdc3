"""Which columns of a Jacobian depend linearly on the columns in front of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Dependence(NamedTuple):
    """Columns of a matrix, told apart by whether they add to its range.

    Attributes:
        independent: indices of the columns that span the range, ascending.
        dependent: indices of the others.
        combination: shape (independent, dependent): each dependent column as a sum of
            independent ones.
        condition: of the independent columns, each scaled to length one.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    combination: np.ndarray
    condition: float


def dependent_columns(
    matrix: ArrayLike, tolerance: float = 1e-8, *, rounding: float = 0.0
) -> Dependence:
    """Keep the first columns that are independent, and name the others.

    Columns are scaled to length one, and go in their order: of two that say the same
    the first is kept. Put in front what must be kept.

    Args:
        matrix: concrete numbers, shape (rows, columns).
        tolerance: a column depends on those kept in front of it if no more than this
            share of it is left outside their range. A zero column always does.
        rounding: columns up to this share of the longest count as zero; for columns of
            one unit, such as those of a scaled Jacobian.

    Raises:
        ValueError: the matrix is not finite.
    """
    columns = np.asarray(matrix, float)
    if not np.all(np.isfinite(columns)):
        raise ValueError("`matrix` must be finite, but holds NaN or infinity")
    norms = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(norms > 0, norms, 1.0)
    basis = np.zeros((columns.shape[0], 0))
    kept, left = [], []
    present = norms > rounding * norms.max(initial=0.0)
    for k in range(columns.shape[1]):
        rest = scaled[:, k]
        for _ in range(2):  # the second projection removes what rounding left
            rest = rest - basis @ (basis.T @ rest)
        length = np.linalg.norm(rest)
        if present[k] and length > tolerance:
            kept.append(k)
            basis = np.column_stack([basis, rest / length])
        else:
            left.append(k)
    values = np.linalg.svd(scaled[:, kept], compute_uv=False)
    condition = float(values[0] / values[-1]) if kept else 0.0
    # of scaled columns: their units do not count
    combination = np.linalg.lstsq(scaled[:, kept], scaled[:, left], rcond=None)[0]
    combination *= norms[left] / norms[kept][:, None]
    combination[:, ~present[left]] = 0.0
    return Dependence(tuple(kept), tuple(left), combination, condition)
