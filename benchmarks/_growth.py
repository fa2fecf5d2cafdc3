"""How cost grows with size."""

import numpy as np


def exponent(sizes, seconds) -> float:
    """Exponent p of the least-squares fit seconds = c * sizes**p.

    Raises:
        ValueError: fewer than two sizes, or values that are not positive.
    """
    sizes, seconds = np.asarray(sizes, float), np.asarray(seconds, float)
    if sizes.size < 2 or sizes.shape != seconds.shape:
        raise ValueError(
            "`sizes` and `seconds` must hold the same number of values, two or more, "
            f"but have the shapes {sizes.shape} and {seconds.shape}"
        )
    if np.any(sizes <= 0) or np.any(seconds <= 0):
        raise ValueError("`sizes` and `seconds` must be positive")
    slope, _ = np.polyfit(np.log(sizes), np.log(seconds), 1)
    return float(slope)
