r"""Rates of angles and quaternions against the angular velocity, with derivatives.

The matrices and the rates take arrays or `Series`, so that `angular_velocity` and
`angle_motion` give time derivatives of any order. Angular velocities are those of the
body against the base frame, in base coordinates.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from .._taylor import (
    Series,
    compose,
    from_derivatives,
    leading,
    product,
    sin_cos,
    stack,
)
from ._chain import SerialChain, forward_kinematics
from ._jacobian import jacobian
from ._orientation import rpy_from_rotation
from ._quaternion import CONJUGATE, HAMILTON


_LOCKED = 64.0  # in units of rounding, as for the angles themselves


def rpy_rate_matrix(rpy):
    r"""Matrix E of $\omega = E\,\dot\Theta$ for roll-pitch-yaw angles.

    Its columns are the axes of the three turns, $(c_zc_y, s_zc_y, -s_y)$,
    $(-s_z, c_z, 0)$ and $(0, 0, 1)$; its determinant is $\cos\Theta_y$.

    Args:
        rpy: angles $(\Theta_x, \Theta_y, \Theta_z)$ [rad], shape (3,), or a `Series`.

    Returns:
        Shape (3, 3), of the kind of `rpy`.

    References:
        [KinModell] (3-15), with $\omega$ from its derivative.
    """
    sine, cosine = sin_cos(rpy)
    sy, cy, sz, cz = sine[1], cosine[1], sine[2], cosine[2]
    zero = 0.0 * cz
    rows = [[cz * cy, -sz, zero], [sz * cy, cz, zero], [-sy, zero, zero + 1.0]]
    return stack([stack(row) for row in rows])


def rpy_rates(rpy, spin, *, throw: bool = True):
    r"""Rates of roll-pitch-yaw angles, $\dot\Theta = E^{-1}\omega$.

    Args:
        rpy: angles [rad], shape (3,), or a `Series`.
        spin: angular velocity [rad/s], shape (3,), or (3, n) for the columns of a
            Jacobian; or a `Series` of shape (3,).
        throw: raise an error in gimbal lock, $\cos\Theta_y = 0$ up to rounding.
            Otherwise the part of the motion is given there that the angles can follow
            with $\Theta_z$ at rest, as `rpy_from_rotation` keeps it.

    Returns:
        Rates [rad/s], of the shape of `spin`; a `Series` of the lower order if both
        arguments are.
    """
    sine, cosine = sin_cos(rpy)
    sy, cy, sz, cz = sine[1], cosine[1], sine[2], cosine[2]
    ahead, aside = cz * spin[0] + sz * spin[1], cz * spin[1] - sz * spin[0]
    quotient, locked = _quotient(ahead, cy)
    if throw:
        quotient = eqx.error_if(
            quotient,
            locked,
            "the rates of roll-pitch-yaw angles are not determined where the cosine of "
            "the pitch is zero: use quaternions, or `throw=False`",
        )
    x = _choose(locked, -(sy * spin[2]), quotient)
    return stack([x, _lowered(aside, x), spin[2] + sy * x])


def zxz_rate_matrix(angles):
    r"""Matrix of $\omega$ from the rates of the Euler angles z-x-z.

    Its columns are $(0, 0, 1)$, $(c_\alpha, s_\alpha, 0)$ and
    $(s_\alpha s_\beta, -c_\alpha s_\beta, c_\beta)$; its determinant is $-\sin\beta$.

    Args:
        angles: $(\alpha, \beta, \gamma)$ [rad], shape (3,), or a `Series`.

    Returns:
        Shape (3, 3), of the kind of `angles`.
    """
    sine, cosine = sin_cos(angles)
    sa, ca, sb, cb = sine[0], cosine[0], sine[1], cosine[1]
    zero = 0.0 * ca
    rows = [[zero, ca, sa * sb], [zero, sa, -(ca * sb)], [zero + 1.0, zero, cb]]
    return stack([stack(row) for row in rows])


def zxz_rates(angles, spin, *, throw: bool = True):
    r"""Rates of the Euler angles z-x-z.

    Args:
        angles: $(\alpha, \beta, \gamma)$ [rad], shape (3,), or a `Series`.
        spin: angular velocity [rad/s], shape (3,) or (3, n), or a `Series` of shape
            (3,).
        throw: raise an error where $\sin\beta = 0$ up to rounding. Otherwise the part
            of the motion is given there that the angles can follow with $\alpha$ at
            rest.

    Returns:
        Rates [rad/s], of the shape of `spin`.
    """
    sine, cosine = sin_cos(angles)
    sa, ca, sb, cb = sine[0], cosine[0], sine[1], cosine[1]
    ahead, aside = ca * spin[0] + sa * spin[1], sa * spin[0] - ca * spin[1]
    quotient, locked = _quotient(aside, sb)
    if throw:
        quotient = eqx.error_if(
            quotient,
            locked,
            "the rates of the angles z-x-z are not determined where the sine of the "
            "second one is zero: use quaternions, or `throw=False`",
        )
    gamma = _choose(locked, cb * spin[2], quotient)
    return stack([spin[2] - cb * gamma, _lowered(ahead, gamma), gamma])


def quaternion_rate_matrix(quaternion):
    r"""Matrix of $\omega = 2\,\mathrm{vec}(\dot q\,\bar q)$ for a unit quaternion.

    Args:
        quaternion: (w, x, y, z) of length one, shape (4,), or a `Series`.

    Returns:
        Shape (3, 4), of the kind of `quaternion`.
    """
    tensor = jnp.asarray(2 * HAMILTON[1:] * CONJUGATE, leading(quaternion).dtype)
    return product("ijk,k->ij", tensor, quaternion)


def quaternion_rates(quaternion, spin):
    r"""Rates of a quaternion, $\dot q = \tfrac12 (0, \omega)\,q$; nowhere singular.

    Args:
        quaternion: (w, x, y, z), shape (4,), or a `Series`.
        spin: angular velocity [rad/s], shape (3,), or a `Series`.

    Returns:
        Shape (4,) [1/s].
    """
    tensor = jnp.asarray(0.5 * HAMILTON[:, 1:], leading(quaternion).dtype)
    return product("ik,k->i", product("ijk,j->ik", tensor, spin), quaternion)


def angular_velocity(
    rate_matrix: Callable[[Any], Any], motion: Float[Array, "terms angles"]
) -> Float[Array, "rates 3"]:
    """Angular velocity and its time derivatives from a motion of angles.

    Args:
        rate_matrix: `rpy_rate_matrix`, `zxz_rate_matrix` or `quaternion_rate_matrix`.
        motion: angles or quaternion and their time derivatives, shape (order + 1, 3)
            or (order + 1, 4).

    Returns:
        Shape (order, 3); entry k is the k-th time derivative [rad/s^(k+1)], in the
        base frame.

    Raises:
        ValueError: `motion` has no derivative.
    """
    if motion.shape[0] < 2:
        raise ValueError(
            "`motion` must hold at least one time derivative, but has the shape "
            f"{motion.shape}"
        )
    series = from_derivatives(motion)
    return product("ij,j->i", rate_matrix(series), series.rate()).derivatives()


def angle_motion(
    rates: Callable[[Any, Any], Any],
    start: Float[Array, " angles"],
    spin: Float[Array, "terms 3"],
) -> Float[Array, "more angles"]:
    """Time derivatives of angles from the angular velocity and its derivatives.

    The differential equation of the angles, solved for one coefficient of their power
    series after another.

    Args:
        rates: `rpy_rates`, `zxz_rates` or `quaternion_rates`.
        start: angles or quaternion now.
        spin: angular velocity in the base frame and its time derivatives, shape
            (order, 3) [rad/s^(k+1)].

    Returns:
        Angles and their time derivatives, shape (order + 1, angles).
    """
    omega = from_derivatives(spin)
    coefficients = [start]
    for k in range(spin.shape[0]):
        rate = rates(Series(jnp.stack(coefficients)), omega.truncated(k))
        coefficients.append(rate.coefficients[k] / (k + 1))
    return Series(jnp.stack(coefficients)).derivatives()


def analytic_jacobian(
    chain: SerialChain, q: PerJoint, *, throw: bool = True
) -> Float[Array, "6 joints"]:
    r"""Jacobian of the tool's pose in roll-pitch-yaw angles.

    Its rotation rows are $E^{-1}$ times those of `jacobian`: rates of the angles
    $(\Theta_x, \Theta_y, \Theta_z)$ instead of an angular velocity.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).
        throw: raise an error in gimbal lock; otherwise see `rpy_rates`.

    Returns:
        Shape (6, joints): rows 0 to 2 [m/rad], rows 3 to 5 [rad/rad].

    References:
        [KinModell] (3-100) to (3-105) with the pose (3-18).
    """
    geometric = jacobian(chain, q)
    rpy = rpy_from_rotation(forward_kinematics(chain, q)[:3, :3])
    turning = rpy_rates(rpy, geometric[3:], throw=throw)
    return jnp.concatenate([geometric[:3], turning])


def _quotient(over, under):
    """Quotient, and whether the divisor is zero; then the quotient is any number."""
    value = leading(under)
    locked = jnp.abs(value) <= _LOCKED * float(jnp.finfo(value.dtype).eps)
    # a safe operand where the quotient is not used
    safe = jnp.where(locked, 1.0, value)
    if isinstance(under, Series):
        under = Series(under.coefficients.at[0].set(safe))
        return over * compose(lambda x: 1 / x, under), locked
    return over / safe, locked


def _choose(which, yes, no):
    """`jnp.where` of arrays or of series, of which the shorter order counts."""
    if not isinstance(no, Series):
        return jnp.where(which, yes, no)
    terms = min(yes.order, no.order) + 1
    return Series(jnp.where(which, yes.coefficients[:terms], no.coefficients[:terms]))


def _lowered(x, other):
    """`x` with no more derivatives than `other` has."""
    return x.truncated(other.order) if isinstance(x, Series) else x
