r"""Generalised Taylor series of a pose in deviations of its parameters.

Along the line $p_0 + s h$ every factor of the product is a power series in s, and so is
the product: truncated Taylor arithmetic gives all differentials $d^k T$ at once.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar, Transform
from .._kernel import kernel
from .._taylor import Series
from ._elementary import (
    ElementaryProduct,
    ElementKind,
    Values,
    elementary_product,
)


Poses = Float[Array, "terms 4 4"]


class TaylorRemainder(eqx.Module):
    """What a Taylor polynomial of a pose leaves out, element by element.

    Attributes:
        estimate: magnitude of the next term, shape (4, 4), rotation and translation
            [m]. No bound: later terms may be larger where it happens to vanish.
        bound: never less than the true remainder but for rounding, shape (4, 4).
    """

    estimate: Transform
    bound: Transform


@kernel
def pose_differentials(
    factors: ElementaryProduct, deviation: Values, order: int, q: PerJoint | None = None
) -> Poses:
    r"""Differentials $d^k T$ of the pose for a deviation of the variables.

    $d^k T = \left(\sum_i h_i \frac{\partial}{\partial p_i}\right)^k T(p_0)
    = \frac{d^k}{ds^k} T(p_0 + s h)|_{s=0}$.

    Args:
        factors: the product, at $p_0$.
        deviation: h of all variables [m] or [rad], shape (variables,).
        order: highest k, not negative.
        q: coordinates of the joints at $p_0$, zero unless given.

    Returns:
        Shape (order + 1, 4, 4); entry 0 is the pose, the last row of the others zero.

    Raises:
        ValueError: `order` is negative.

    References:
        [KinModell] (3-35.2), which equals the sum (3-36) over `multi_indices`.
    """
    return _series(factors, deviation, order, q).derivatives()


def _series(factors, deviation, order, q) -> Series:
    """The pose along the line, as a power series."""
    if order < 0:
        raise ValueError(f"`order` must not be negative, but is {order}")
    start = factors.values_at(q)
    rest = jnp.zeros((max(order - 1, 0), *start.shape), start.dtype)
    line = jnp.concatenate([jnp.stack([start, deviation])[: order + 1], rest])
    return elementary_product(factors, Series(line))


def taylor_polynomials(
    factors: ElementaryProduct, deviation: Values, order: int, q: PerJoint | None = None
) -> Poses:
    r"""Taylor polynomials of the pose, of all orders up to `order`.

    $P_0 = T(p_0)$, $P_m = P_{m-1} + \frac{1}{m!} d^m T(p_0)$: a higher accuracy takes
    one more term and none of the others again.

    Args:
        factors: the product, at $p_0$.
        deviation: h of all variables [m] or [rad], shape (variables,).
        order: highest order m.
        q: coordinates of the joints at $p_0$, zero unless given.

    Returns:
        Shape (order + 1, 4, 4); entry m approximates $T(p_0 + h)$ to order m.

    References:
        [KinModell] (3-35), (3-37); the print of the recursion mixes the polynomial with
        and without its remainder.
    """
    differentials = pose_differentials(factors, deviation, order, q)
    factorials = [float(math.factorial(k)) for k in range(order + 1)]
    scale = jnp.asarray(factorials, differentials.dtype)[:, None, None]
    return jnp.cumsum(differentials / scale, axis=0)


def taylor_majorant(
    factors: ElementaryProduct, sizes: Values, order: int, q: PerJoint | None = None
) -> Transform:
    r"""Bound of the remainder for every deviation up to given sizes.

    No derivative of a rotation is larger than one. With H the sum of the sizes of all
    rotations, the remainder of the rotation is at most $H^{m+1}/(m+1)!$. A length l
    with the deviation $|h|$ behind rotations of the sum $H_l$ adds
    $|l| H_l^{m+1}/(m+1)! + |h| H_l^m/m!$ to that of the position. The norms are met
    when all axes are parallel, all arms stretched and the deviations add up; each
    element is bounded by the norm of its block.

    Args:
        factors: the product, at $p_0$.
        sizes: largest magnitudes of the deviations [m] or [rad], shape (variables,).
        order: m of the polynomial.
        q: coordinates of the joints at $p_0$, zero unless given.

    Returns:
        Shape (4, 4): rotation and translation [m]; the last row is zero.

    References:
        [KinModell] (3-35.5), whose intermediate point is unknown, and differs from
        element to element.
    """
    values, sizes = jnp.abs(factors.values_at(q)), jnp.abs(sizes)
    low, high = math.factorial(order), math.factorial(order + 1)
    angle = jnp.zeros((), values.dtype)
    position = jnp.zeros((), values.dtype)
    variable = constant = 0
    for place in factors.places:
        if place.kind is ElementKind.FIXED:
            length = _length(factors.constants[constant, :3, 3])
            position += length * angle ** (order + 1) / high
            constant += 1
            continue
        size = sizes[variable]
        if place.kind is ElementKind.ABOUT:
            angle += size
        else:
            position += values[variable] * angle ** (order + 1) / high
            position += size * angle**order / low
        variable += 1
    rotation = jnp.full((3, 3), 1.0, values.dtype) * angle ** (order + 1) / high
    top = jnp.concatenate([rotation, jnp.broadcast_to(position, (3, 1))], axis=1)
    return jnp.concatenate([top, jnp.zeros_like(top[:1])])


def _length(vector: Float[Array, "3"]) -> Scalar:
    """Norm whose gradient is finite at zero."""
    square = jnp.sum(vector**2)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def taylor_remainder(
    factors: ElementaryProduct,
    deviation: Values,
    order: int,
    q: PerJoint | None = None,
    *,
    terms: int = 3,
) -> TaylorRemainder:
    r"""What the Taylor polynomial leaves out for a given deviation.

    The remainder is the sum of the next terms plus the remainder behind them, which the
    majorant bounds: $|R_m| \le |\sum_{k=m+1}^{m+r} d^k T/k!| + \hat R_{m+r}$. The bound
    is the smaller of that and of $\hat R_m$; three terms are enough for some degrees in
    each of the twenty angles of an arm.

    Args:
        factors: the product, at $p_0$.
        deviation: h of all variables [m] or [rad], shape (variables,).
        order: m of the polynomial.
        q: coordinates of the joints at $p_0$, zero unless given.
        terms: r >= 1, next terms that are summed for the bound.

    Raises:
        ValueError: `order` is negative, or there are no terms.

    References:
        [KinModell] (3-35.5).
    """
    if terms < 1:
        raise ValueError(f"`terms` must be at least one, but is {terms}")
    # as it is written: for a kernel this is too much to compile
    series = _series(factors, deviation, order + terms, q)
    following = series.coefficients[order + 1 :]
    rest = taylor_majorant(factors, deviation, order + terms, q)
    later = jnp.abs(jnp.sum(following, axis=0)) + rest
    bound = jnp.minimum(taylor_majorant(factors, deviation, order, q), later)
    return TaylorRemainder(jnp.abs(following[0]), bound)
