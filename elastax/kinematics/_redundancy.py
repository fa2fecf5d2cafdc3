r"""Corrections of redundant arms: hard conditions met exactly, soft ones as well as
possible.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint


CUTOFF = 1e-9  # singular values below this part of the largest one count as zero


def weighted_correction(
    jacobian: Float[Array, "rows joints"],
    error: Float[Array, " rows"],
    weights: PerJoint,
    preferred: PerJoint,
) -> PerJoint:
    r"""The correction closest to a preferred one among those that remove the error.

    Minimises $\sum_i w_i (\Delta\theta_i - \Delta\theta'_i)^2$ subject to
    $J\,\Delta\theta = \Delta x$:
    $\Delta\theta = \Delta\theta' + W^{-1} J^T (J W^{-1} J^T)^{-1}
    (\Delta x - J\,\Delta\theta')$. Of an error that no correction removes, the part
    that one does is removed.

    Args:
        jacobian: J, shape (rows, joints) [m/rad].
        error: target minus actual, shape (rows,) [m].
        weights: w > 0, shape (joints,); a heavy joint keeps to its preference.
        preferred: $\Delta\theta'$ [rad], shape (joints,), such as a share of the way to
            the most natural posture; zero gives the correction of smallest norm.

    References:
        [Berns] "Unterbestimmtes System"; [Reiner2010] (3.60) for equal weights and a
        preference of zero.
    """
    scale = 1 / jnp.sqrt(weights)
    scaled = jacobian * scale[None]
    rest = error - jacobian @ preferred
    return preferred + scale * (jnp.linalg.pinv(scaled, rtol=CUTOFF) @ rest)


def hard_and_soft(
    hard: Float[Array, "rows joints"],
    hard_values: Float[Array, " rows"],
    soft: Float[Array, "wishes joints"],
    soft_values: Float[Array, " wishes"],
) -> tuple[PerJoint, Float[Array, " rows"]]:
    r"""Least squares of soft conditions under hard ones, by Lagrange multipliers.

    Minimises $|A x - q|^2$ subject to $J x = b$:
    $$\begin{pmatrix} 2A^TA & J^T \\ J & 0 \end{pmatrix}
    \begin{pmatrix} x \\ \lambda \end{pmatrix} =
    \begin{pmatrix} 2A^Tq \\ b \end{pmatrix}.$$
    Unique if J has full row rank and $A^TA$ is positive definite on its kernel, of
    which the text asks neither; otherwise the solution of smallest norm is returned.

    Args:
        hard: J, shape (rows, joints), such as the Jacobian of the tool.
        hard_values: b, shape (rows,), such as the error of the tool.
        soft: A, shape (wishes, joints), in the unit in which wishes are weighed.
        soft_values: q, shape (wishes,).

    Returns:
        Correction x, shape (joints,), and multipliers, shape (rows,).

    References:
        [Berns] "Lagrange-Multiplikatoren", with x for the unknown: the slides swap
        $\Delta x$ and $\Delta\theta$.
    """
    rows, joints = hard.shape
    upper = jnp.concatenate([2 * soft.T @ soft, hard.T], axis=1)
    lower = jnp.concatenate([hard, jnp.zeros((rows, rows), hard.dtype)], axis=1)
    right = jnp.concatenate([2 * soft.T @ soft_values, hard_values])
    matrix = jnp.concatenate([upper, lower])
    # rank-safe, with the derivative of a pseudo-inverse
    solution = jnp.linalg.pinv(matrix, rtol=CUTOFF) @ right
    return solution[:joints], solution[joints:]
