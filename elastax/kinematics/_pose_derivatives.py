r"""Exact partial derivatives of a pose, of any order, by joints and parameters.

Each variable occurs in one factor of the product, so that a derivative of the product
is the product of derivatives of its factors. Element (4, 4) of a derivative is zero
(`papers/notation.md`); a footnote of the text sets it to one.
"""

import math
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._checks import check_values
from .._custom_types import PerJoint, Transform
from .._kernel import kernel
from .._taylor import skew
from ._elementary import ElementaryProduct, ElementKind, elementary_matrices


class MultiIndices(NamedTuple):
    r"""All ways to share the order k of a derivative among N variables.

    Attributes:
        orders: shape (terms, N), rows sum up to k, zeros allowed.
        coefficients: multinomial coefficients $k!/(k_1!\cdots k_N!)$, shape (terms,).
    """

    orders: np.ndarray
    coefficients: np.ndarray


def multi_indices(number: int, order: int) -> MultiIndices:
    r"""Terms of the differential of order k in N variables.

    $d^k T = \sum_{k_1+\dots+k_N=k} \frac{k!}{k_1!\cdots k_N!}
    \frac{\partial^k T}{\partial p_1^{k_1}\cdots\partial p_N^{k_N}}
    h_1^{k_1}\cdots h_N^{k_N}$, which has $\binom{N+k-1}{k}$ terms.

    Args:
        number: N >= 1.
        order: k >= 0.

    Raises:
        ValueError: `number` or `order` is too small.

    References:
        [KinModell] (3-36), the sum of the $k_i$ read as k; the print says N.
    """
    if number < 1 or order < 0:
        raise ValueError(
            "`number` must be positive and `order` must not be negative, but are "
            f"{number} and {order}"
        )
    rows = np.array(list(_compositions(number, order)), int).reshape(-1, number)
    factorials = np.array([math.factorial(k) for k in range(order + 1)], float)
    shares = np.prod(factorials[rows], axis=1)
    return MultiIndices(rows, factorials[order] / shares)


def _compositions(number: int, order: int):
    if number == 1:
        yield (order,)
        return
    for first in range(order, -1, -1):
        for rest in _compositions(number - 1, order - first):
            yield (first, *rest)


def pose_derivative(
    factors: ElementaryProduct,
    orders: Int[Array, " variables"],
    q: PerJoint | None = None,
) -> Transform:
    r"""Partial derivative of the pose, of any order by every variable.

    $\frac{\partial^{|n|} T}{\partial p_1^{n_1}\cdots\partial p_N^{n_N}}
    = \prod_j T_j^{(n_j)}$. A rotation's derivative is its own formula at an angle a
    quarter turn further per order, without the part along the axis; a translation's is
    its direction, then zero.

    Args:
        factors: the product.
        orders: order of the derivative by each variable, none negative, shape
            (variables,); may be traced, so that `vmap` over the rows of `multi_indices`
            is one program.
        q: coordinates of the joints [rad] or [m], zero unless given.

    Returns:
        Shape (4, 4), in [m] and [rad] per unit of the variables; all zero in the last
        row if any order is positive.

    Raises:
        ValueError: `orders` has another shape, or is negative.

    References:
        [KinModell] (3-24) to (3-29). Of the print, (3-25) has a wrong angle in its
        second line, (3-27) shifts by $(n-1)\,\tfrac{\pi}{2}\,e_\varepsilon$, and
        (3-29) lacks its n.
    """
    orders = jnp.asarray(orders)
    if orders.shape != (factors.number,):
        raise ValueError(
            f"`orders` must hold one order per variable of {factors.number}, but has "
            f"the shape {orders.shape}"
        )
    check_values("`orders` must not be negative", orders, orders >= 0)
    along, about, direction = factors.along_and_about()
    values = factors.values_at(q)
    dtype = values.dtype
    sine, cosine = jnp.sin(values), jnp.cos(values)
    # four quarter turns, exact where the sum of angles would round
    quarter = jnp.stack([cosine, -sine, -cosine, sine])
    shifted = lambda n: jnp.take_along_axis(quarter, (n % 4)[None], axis=0)[0]
    whole = (orders == 0).astype(dtype)
    once = (orders == 1).astype(dtype)

    identity = jnp.eye(3, dtype=dtype)[None]
    parallel = jnp.einsum("va,vb->vab", direction, direction)
    turning = jnp.asarray(about, dtype)[:, None, None]
    across, turn = turning * (identity - parallel), turning * skew(direction)
    each = lambda x: x[:, None, None]
    rotation = (
        each(shifted(orders)) * across
        + each(shifted(orders + 3)) * turn  # sin x = cos(x - pi/2)
        + each(whole) * (identity - across)
    )
    length = (whole * values + once) * jnp.asarray(along, dtype)
    position = length[:, None] * direction
    top = jnp.concatenate([rotation, position[:, :, None]], axis=2)
    bottom = whole[:, None, None] * jnp.asarray([[[0.0, 0.0, 0.0, 1.0]]], dtype)
    matrices = jnp.concatenate([top, bottom], axis=1)
    return _product(jnp.stack(factors.in_order(matrices)))


def _product(matrices: Float[Array, "factors 4 4"]) -> Transform:
    """Ordered product, pair by pair: a short program for many factors."""
    while matrices.shape[0] > 1:
        odd = matrices.shape[0] % 2
        paired = matrices[: matrices.shape[0] - odd]
        products = paired[0::2] @ paired[1::2]
        matrices = jnp.concatenate([products, matrices[matrices.shape[0] - odd :]])
    return matrices[0]


class _Columns(NamedTuple):
    """Effect of every variable on the tool, in the base frame.

    A factor is the exponential of a constant generator, and the factors in front of it
    turn that into one of the base frame. So all first derivatives need the products in
    front of each factor only; the products behind follow from the pose.
    """

    turning: Float[Array, "variables 3"]
    moving: Float[Array, "variables 3"]
    pose: Transform


@kernel
def _columns(factors: ElementaryProduct, q: PerJoint | None) -> _Columns:
    _, _, direction = factors.along_and_about()
    matrices = elementary_matrices(factors, factors.values_at(q))
    total = jnp.eye(4, dtype=matrices.dtype)
    axes, origins, variable = [], [], 0
    for place, matrix in zip(factors.places, factors.in_order(matrices), strict=True):
        if place.kind is not ElementKind.FIXED:
            axes.append(total[:3, :3] @ direction[variable])
            origins.append(total[:3, 3])
            variable += 1
        total = total @ matrix
    along, about, _ = factors.along_and_about()
    axis, origin = jnp.stack(axes), jnp.stack(origins)
    turning = jnp.asarray(about, axis.dtype)[:, None] * axis
    lever = jnp.cross(turning, total[None, :3, 3] - origin)
    moving = lever + jnp.asarray(along, axis.dtype)[:, None] * axis
    return _Columns(turning, moving, total)


def elementary_jacobian(
    factors: ElementaryProduct, q: PerJoint | None = None
) -> Float[Array, "6 variables"]:
    r"""Geometric Jacobian of the tool by all variables, translation above rotation.

    The columns of `factors.joint_variables` are the Jacobian $J_x$ of the drives, the
    columns of the parameters are $J_p$.

    Args:
        factors: the product.
        q: coordinates of the joints [rad] or [m], zero unless given.

    Returns:
        Shape (6, variables), in the base frame.

    References:
        [KinModell] (3-100).
    """
    columns = _columns(factors, q)
    return jnp.concatenate([columns.moving, columns.turning], axis=1).T


def pose_gradient(
    factors: ElementaryProduct, q: PerJoint | None = None
) -> Float[Array, "variables 4 4"]:
    r"""All first derivatives of the pose.

    A rotation changes the pose $(R, t)$ to $(R_a D' R_b,\ R_a D' t_b)$, which is
    $(\tilde w R,\ w \times l)$ with its axis w in the base frame and the lever l from
    it to the tool; a translation to $(0,\ R_a e)$. Here a stands for the factors in
    front, b for those behind.

    Args:
        factors: the product.
        q: coordinates of the joints [rad] or [m], zero unless given.

    Returns:
        Shape (variables, 4, 4); entry k is the derivative by variable k.

    References:
        [KinModell] (3-20), (3-30), (3-31); the print of the last two is lost.
    """
    _, slopes = _slopes(_columns(factors, q))
    return jnp.pad(slopes, ((0, 0), (0, 1), (0, 0)))


def pose_hessian(
    factors: ElementaryProduct, q: PerJoint | None = None
) -> Float[Array, "variables variables 4 4"]:
    r"""All second derivatives of the pose.

    With variable i in front of variable j, or i = j, the derivative is
    $\tilde w_i\,(\partial R/\partial p_j,\ \partial t/\partial p_j)$, zero if i is a
    translation.

    Args:
        factors: the product.
        q: coordinates of the joints [rad] or [m], zero unless given.

    Returns:
        Shape (variables, variables, 4, 4), symmetric in the first two axes.

    References:
        [KinModell] (3-28) to (3-31).
    """
    turn, slopes = _slopes(_columns(factors, q))
    second = jnp.einsum("iab,jbc->ijac", turn, slopes)
    in_front = np.tri(factors.number).T.astype(bool)[:, :, None, None]
    second = jnp.where(in_front, second, jnp.swapaxes(second, 0, 1))
    return jnp.pad(second, ((0, 0), (0, 0), (0, 1), (0, 0)))


def _slopes(columns: _Columns) -> tuple[Any, Any]:
    """Cross products with the turning axes, and the upper rows of all derivatives."""
    turn = skew(columns.turning)
    rotation = turn @ columns.pose[None, :3, :3]
    return turn, jnp.concatenate([rotation, columns.moving[:, :, None]], axis=2)
