r"""Motion of the joints along a damped law, with the derivatives of the law itself."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_values
from .._custom_types import PerJoint, Scalar, as_real
from .._kernel import kernel
from .._taylor import Series, from_derivatives, product, solve_positive
from ._chain import SerialChain, moving_frames
from ._ik_dls import row_weights
from ._inverse_motion import checked_rows
from ._jacobian import tool_jacobian


def resolved_motion(
    chain: SerialChain,
    q: PerJoint,
    twists: Float[Array, "order rows"],
    *,
    damping: Scalar | float,
    weights: PerJoint | float = 1.0,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
) -> Float[Array, "terms joints"]:
    r"""Derivatives of the motion that follows a damped law.

    $\dot x = W^{-1}J^T(JW^{-1}J^T + \lambda^2 I)^{-1}\,\dot y$ is a differential
    equation for the joints; its solution through `q` is returned as its derivatives.
    Unlike those of `inverse_motion` they belong to one motion for damped and redundant
    arms too: $\ddot x$ is the derivative of $\dot x$, null space included. For a square
    regular Jacobian and little damping both agree.

    Args:
        chain: the chain.
        q: joint coordinates, shape (joints,) [rad] or [m].
        twists: derivatives of the tool's twist from order 0 on, of the chosen rows;
            shape (order, rows).
        damping: $\lambda > 0$ [m], constant along the motion; 1e-6 is as good as none
            away from singular poses, and what is finite at them is large with it.
        weights: of the squared rates, diagonal of W, positive, one for all joints or
            shape (joints,).
        rows: rows of the twist that are given.
        characteristic_length: length that turns 1 rad into a distance [m].

    Returns:
        Shape (order + 1, joints), row 0 the coordinates [rad/s^k] or [m/s^k].

    Raises:
        ValueError: shapes or rows do not fit, damping or weights are not positive.

    References:
        [Reiner2010] (3.65), [Berns] for the weights; the recursion is the one by which
        the coefficients of a differential equation's solution follow from each other.
    """
    rows = checked_rows(rows, twists)
    damping, weights = as_real(damping), as_real(weights)
    check_values("`damping` must be positive", damping, damping > 0)
    check_values("`weights` must be positive", weights, weights > 0)
    length = jnp.asarray(characteristic_length, q.dtype)
    return _law(chain, q, twists, damping, weights, length, rows)


@kernel
def _law(chain, q, twists, damping, weights, length, rows):
    """The solution's derivatives, one order after the other."""
    given, order = np.array(rows), twists.shape[0]
    scale = row_weights(length, rows)
    mobility = jnp.ones_like(q) / weights
    square = damping**2 * jnp.eye(len(rows), dtype=q.dtype)
    wanted = product("ki,i->ki", twists, scale)
    coefficients = [q]
    for k in range(order):
        motion = Series(jnp.stack(coefficients))
        matrix = tool_jacobian(chain, moving_frames(chain, motion))
        matrix = product("ij,i->ij", matrix[given], scale)
        light = product("ij,j->ij", matrix, mobility)
        gram = product("ik,jk->ij", light, matrix) + square
        wrench = solve_positive(gram, from_derivatives(wanted[: k + 1]))
        rates = product("ji,j->i", light, wrench)
        coefficients.append(rates.coefficients[k] / (k + 1))
    return Series(jnp.stack(coefficients)).derivatives()
