r"""The planar arm with two links: position, Jacobian, both inverses in closed form.

The tool's direction $\varphi = \theta_1 + \theta_2$ follows from its position: the
text's third condition is no free one.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real
from ._safe_angles import angle, root, wrapped


Pair = Float[Array, "2"]
_ROUNDING = 1e5  # in units of the type's epsilon: what counts as zero


class PlanarArm(eqx.Module):
    r"""Two links in a plane, both joints about the plane's normal.

    Attributes:
        first: $l_1 > 0$, from joint 1 to joint 2 [m].
        second: $l_2 > 0$, from joint 2 to the tool [m].

    References:
        [Berns], planar arm with two links.
    """

    first: Scalar = eqx.field(converter=as_real)
    second: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`first` must be positive", self.first, self.first > 0)
        check_values("`second` must be positive", self.second, self.second > 0)

    def position(self, q: Pair) -> Pair:
        r"""Position of the tool [m]: $x = l_1 c_1 + l_2 c_{12}$, $y = l_1 s_1 + ...$"""
        turned = jnp.stack([q[0], q[0] + q[1]])
        lengths = self._lengths()
        return jnp.stack([lengths @ jnp.cos(turned), lengths @ jnp.sin(turned)])

    def jacobian(self, q: Pair) -> Float[Array, "2 2"]:
        """Derivative of `position` by the joint angles [m/rad].

        References:
            [Berns], two-joint arm.
        """
        l1, l2 = self._lengths()
        s1, s12 = jnp.sin(q[0]), jnp.sin(q[0] + q[1])
        c1, c12 = jnp.cos(q[0]), jnp.cos(q[0] + q[1])
        return jnp.stack(
            [
                jnp.stack([-l1 * s1 - l2 * s12, -l2 * s12]),
                jnp.stack([l1 * c1 + l2 * c12, l2 * c12]),
            ]
        )

    def inverse_jacobian(self, q: Pair) -> tuple[Float[Array, "2 2"], Bool[Array, ""]]:
        r"""Inverse of `jacobian` [rad/m], and whether there is one.

        $J^{-1} = \frac{1}{l_1 l_2 s_2}
        \begin{pmatrix} l_2 c_{12} & l_2 s_{12}\\
        -l_1 c_1 - l_2 c_{12} & -l_1 s_1 - l_2 s_{12}\end{pmatrix}$; the text prints
        $l_1$ in front of $c_{12}$ and $s_{12}$ in the second row. Zero where
        $\theta_2$ is 0 or half a turn.

        References:
            [Berns], two-joint arm, corrected.
        """
        l1, l2 = self._lengths()
        s1, s12 = jnp.sin(q[0]), jnp.sin(q[0] + q[1])
        c1, c12 = jnp.cos(q[0]), jnp.cos(q[0] + q[1])
        s2 = jnp.sin(q[1])
        regular = jnp.abs(s2) > _ROUNDING * float(jnp.finfo(q.dtype).eps)
        adjugate = jnp.stack(
            [
                jnp.stack([l2 * c12, l2 * s12]),
                jnp.stack([-l1 * c1 - l2 * c12, -l1 * s1 - l2 * s12]),
            ]
        )
        # a safe operand where there is no inverse
        determinant = l1 * l2 * jnp.where(regular, s2, 1.0)
        return jnp.where(regular, adjugate / determinant, 0.0), regular

    def _lengths(self) -> Pair:
        return jnp.stack([self.first, self.second])


def planar_inverse(
    arm: PlanarArm, position: Pair, previous: Pair | None = None
) -> tuple[Float[Array, "2 2"], Bool[Array, "2"]]:
    r"""Both pairs of joint angles for a position, the algebraic solution.

    $c_2 = (x^2+y^2-l_1^2-l_2^2)/(2 l_1 l_2)$,
    $\theta_2 = \mathrm{atan2}(\pm s_2, c_2)$,
    $k_1 = l_1 + l_2 c_2$, $k_2 = l_2 s_2$, $\theta_1 = \mathrm{atan2}(y, x) - \gamma$
    with $\gamma = \mathrm{atan2}(k_2, k_1)$; the text drops $\gamma$ in the last line.

    Args:
        arm: the arm.
        position: of the tool (x, y) [m].
        previous: angles [rad]; the first one stays where it is free, with the tool on
            joint 1. Zero unless given.

    Returns:
        Angles in (-pi, pi] [rad], shape (2, 2), the row with a positive second angle in
        front, and which rows reach the position, shape (2,). Out of reach the arm
        points stretched or folded towards the position. At these two poses the true
        slopes are infinite; the second angle is given the slope zero there.

    References:
        [Berns], algebraic solution, corrected.
    """
    l1, l2 = arm.first, arm.second
    x, y = position[0], position[1]
    area, square, reached = _triangle(arm, position)
    sign = jnp.array([1.0, -1.0], position.dtype)
    theta_2 = jnp.arctan2(sign * area, square - l1**2 - l2**2)
    k1, k2 = l1 + l2 * jnp.cos(theta_2), l2 * jnp.sin(theta_2)
    free = _free(arm, position.dtype)
    gamma = angle(k2, k1, jnp.zeros_like(k1), free)
    theta_1 = angle(y, x, _kept(previous, position) + gamma, free) - gamma
    return wrapped(jnp.stack([theta_1, theta_2], axis=1)), reached


def planar_inverse_geometric(
    arm: PlanarArm, position: Pair, previous: Pair | None = None
) -> tuple[Float[Array, "2 2"], Bool[Array, "2"]]:
    r"""Both pairs of joint angles for a position, by the law of cosines.

    In the triangle of the links and the line of length r to the tool,
    $\cos\psi = (r^2+l_1^2-l_2^2)/(2 l_1 r)$ and
    $\cos(\pi-\theta_2) = (l_1^2+l_2^2-r^2)/(2 l_1 l_2)$;
    $\theta_1 = \beta \mp \psi$ with $\beta = \mathrm{atan2}(y, x)$, minus for a
    positive second angle. The text leaves the sign open.

    Args:
        arm: the arm.
        position: of the tool (x, y) [m].
        previous: as for `planar_inverse`.

    Returns:
        As for `planar_inverse`.

    References:
        [Berns], geometric solution.
    """
    l1, l2 = arm.first, arm.second
    area, square, reached = _triangle(arm, position)
    sign = jnp.array([1.0, -1.0], position.dtype)
    # angles of a triangle from its area and the law of cosines, without a pole
    free = _free(arm, position.dtype)
    at_elbow = jnp.arctan2(area, l1**2 + l2**2 - square)
    # the pair has the length 2 l1 r
    beside = square + l1**2 - l2**2
    psi = angle(area, beside, jnp.zeros_like(area), 4 * l1**2 * free)
    kept = _kept(previous, position) + sign * psi
    beta = angle(position[1], position[0], kept, free)
    theta_1 = beta - sign * psi
    theta_2 = sign * (jnp.pi - at_elbow)
    return wrapped(jnp.stack([theta_1, theta_2], axis=1)), reached


def _triangle(arm: PlanarArm, position: Pair):
    """Four times the area of links and line to the tool, its square, reachability."""
    l1, l2 = arm.first, arm.second
    square = position @ position
    # products instead of 1 - c2^2, which loses half the digits at the stretched arm
    outer, inner = (l1 + l2) ** 2 - square, square - (l1 - l2) ** 2
    rounding = _ROUNDING * float(jnp.finfo(position.dtype).eps)
    scale = (l1 + l2) ** 2
    area = root(outer * inner, (rounding * scale) ** 2)
    reached = (outer >= -rounding * scale) & (inner >= -rounding * scale)
    return area, square, jnp.stack([reached, reached])


def _free(arm: PlanarArm, dtype) -> Scalar:
    """Squared distance from joint 1 below which the first angle is free."""
    rounding = _ROUNDING * float(jnp.finfo(dtype).eps)
    return (rounding * (arm.first + arm.second)) ** 2


def _kept(previous: Pair | None, position: Pair) -> Scalar:
    return jnp.zeros((), position.dtype) if previous is None else previous[0]
