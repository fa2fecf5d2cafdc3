"""Relative degrees of linear systems from their Markov parameters."""

import numpy as np


# of sums of products in 64 bits, over the sum of their magnitudes
_ROUNDING = 1e-12


def linear_relative_degree(model):
    r"""Relative degree of every output, and the rows $c_i A^{r_i - 1} B$.

    A Markov parameter counts as zero where it is rounding of its own products.

    Raises:
        ValueError: no input reaches an output.

    References:
        [Reiner2010] (3.2), (3.15), (3.16).
    """
    A, B, C, D = (np.asarray(x) for x in (model.A, model.B, model.C, model.D))
    degrees, rows = [], []
    for i, name in enumerate(model.names.outputs):
        if np.any(np.abs(D[i]) > _ROUNDING * np.abs(D).max()):
            degrees.append(0)
            rows.append(D[i])
            continue
        c, size = C[i], np.abs(C[i])
        for degree in range(1, len(A) + 1):
            row = c @ B
            if np.any(np.abs(row) > _ROUNDING * (size @ np.abs(B))):
                degrees.append(degree)
                rows.append(row)
                break
            c, size = c @ A, size @ np.abs(A)
        else:
            raise ValueError(
                f"no input reaches the output `{name}`: its relative degree is not "
                "defined"
            )
    return tuple(degrees), np.array(rows)
