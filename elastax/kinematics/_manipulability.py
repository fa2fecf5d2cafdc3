r"""How well a chain moves and pushes in a pose: measures of its Jacobian.

All of them act on a Jacobian in one unit: `scaled_jacobian` multiplies rotations by a
characteristic length. Singular values are taken where the text inverts J; they are
finite in singular poses too, and have first derivatives there: of the branch that the
factorisation returns where two of them meet.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar
from ._chain import SerialChain
from ._ik_dls import row_weights
from ._jacobian import jacobian
from ._singular_values import singular_values


Scaled = Float[Array, "rows joints"]


def scaled_jacobian(
    chain: SerialChain,
    q: PerJoint,
    characteristic_length: Scalar | float = 1.0,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
) -> Scaled:
    """Rows of the geometric Jacobian in the unit of length.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).
        characteristic_length: length that turns 1 rad into a distance [m].
        rows: those of the pose that count; 0 to 2 are translations.

    Returns:
        Shape (rows, joints), in the base frame [m/rad].
    """
    weights = row_weights(jnp.asarray(characteristic_length, q.dtype), rows)
    return weights[:, None] * jacobian(chain, q)[np.array(rows)]


def manipulability(jacobian: Scaled) -> Scalar:
    r"""Yoshikawa's measure, $\sqrt{\det(JJ^T)}$: the product of the singular values.

    Proportional to the volume of the ellipsoid of velocities; zero in singular poses.
    With fewer joints than rows it is $\sqrt{\det(J^TJ)}$, the volume in the directions
    that can move.

    Args:
        jacobian: shape (rows, joints), in one unit.
    """
    # not `singular_values`, whose zeros have no slope: here it is that of a branch
    return jnp.prod(jnp.linalg.svd(jacobian, compute_uv=False))


def inverse_condition_number(jacobian: Scaled) -> Scalar:
    """Smallest over largest singular value: 1 in isotropic, 0 in singular poses.

    Args:
        jacobian: shape (rows, joints), in one unit.
    """
    values = singular_values(jacobian)
    # a matrix of zeros is singular too
    return values[-1] / jnp.where(values[0] > 0, values[0], 1.0)


def condition_number(jacobian: Scaled) -> Scalar:
    """Largest over smallest singular value; infinite, without slope, where that is 0.

    Args:
        jacobian: shape (rows, joints), in one unit.
    """
    inverse = inverse_condition_number(jacobian)
    singular = inverse <= 0
    return jnp.where(singular, jnp.inf, 1 / jnp.where(singular, 1.0, inverse))


class Ellipsoid(NamedTuple):
    """Velocities of the tool with joint velocities of length one.

    Attributes:
        axes: unit vectors along the axes, shape (rows, rows), one in each column.
        lengths: of the half axes, descending, shape (rows,); zero in directions that
            cannot move.
    """

    axes: Float[Array, "rows rows"]
    lengths: Float[Array, " rows"]


def velocity_ellipsoid(jacobian: Scaled) -> Ellipsoid:
    r"""Axes of the ellipsoid $v^T (JJ^T)^{-1} v \le 1$ of velocities.

    That of the forces under joint torques of length one has the same axes and the
    inverse lengths. The directions are not differentiated, as equal axes have none of
    their own; the lengths are, and so is the matrix $JJ^T$ itself.

    Args:
        jacobian: shape (rows, joints), in one unit.
    """
    fixed = jax.lax.stop_gradient(jacobian)
    axes = jnp.linalg.svd(fixed, full_matrices=True)[0]
    lengths = singular_values(jacobian)
    short = jacobian.shape[0] - lengths.shape[0]
    return Ellipsoid(axes, jnp.concatenate([lengths, jnp.zeros(short, axes.dtype)]))


def directional_reach(jacobian: Scaled, direction: Float[Array, " rows"]) -> Scalar:
    r"""Length of the velocity ellipsoid along a direction, $(u^T(JJ^T)^{-1}u)^{-1/2}$.

    Its inverse is the length of the force ellipsoid. Zero where no motion is possible
    in that direction alone.

    Args:
        jacobian: shape (rows, joints), in one unit.
        direction: of any length but zero, shape (rows,).
    """
    unit = direction / jnp.sqrt(jnp.sum(direction**2))
    inverse = jnp.linalg.pinv(jacobian, rtol=1e-10)
    speed = inverse @ unit
    possible = jnp.sum((jacobian @ speed - unit) ** 2) < 1e-12
    # a safe operand where the direction is blocked
    square = jnp.where(possible, jnp.sum(speed**2), 1.0)
    return jnp.where(possible, 1 / jnp.sqrt(square), 0.0)
