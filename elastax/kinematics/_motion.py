r"""Motion of the tool to any order: velocity, acceleration, jerk, snap.

Motions are given and returned as arrays of time derivatives, row k of order k.
Truncated Taylor arithmetic carries them through the chain, so that no derivative of a
Jacobian is written down.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import Transform, as_real
from .._kernel import kernel
from .._taylor import (
    Series,
    compose,
    concatenate,
    from_derivatives,
    leading,
    product,
    sin_cos,
    skew,
    stack,
)
from ._chain import SerialChain, moving_frames
from ._elementary import ElementaryProduct, elementary_product
from ._joints import JointKind
from ._se3 import transform


class ToolMotion(eqx.Module):
    """Pose of a body and the time derivatives of its motion, in the base frame.

    Attributes:
        pose: shape (4, 4) [m].
        twists: shape (order, 6); row k is the derivative k of the twist, velocity of
            the origin above angular velocity: velocity [m/s, rad/s], acceleration,
            jerk, snap, ...
    """

    pose: Transform = eqx.field(converter=as_real)
    twists: Float[Array, "order 6"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)


@kernel
def tool_derivatives(
    chain: SerialChain, q_derivatives: Float[Array, "terms joints"]
) -> ToolMotion:
    r"""Motion of the tool from that of the joints.

    $\dot y = J\dot x$, $\ddot y = \dot J\dot x + J\ddot x$,
    $\dddot y = \ddot J\dot x + 2\dot J\ddot x + J\dddot x$ and so on, with the
    geometric Jacobian.

    Args:
        chain: the chain.
        q_derivatives: joint coordinates and their time derivatives, shape
            (order + 1, joints), order >= 1 [rad/s^k] or [m/s^k].

    Returns:
        Pose, and twist with its derivatives up to the order `order` of the motion.

    Raises:
        ValueError: there is no velocity.

    References:
        [KinModell] (3-105), (3-109), (3-112), (3-120) to (3-123).
    """
    _check_order(q_derivatives)
    q = from_derivatives(q_derivatives)
    frames = moving_frames(chain, q)
    turning = [float(kind is JointKind.REVOLUTE) for kind in chain.kinds]
    rates = product("k,k->k", q.rate(), jnp.asarray(turning, q_derivatives.dtype))
    spin = product("ka,k->a", frames.axis, rates)
    return _motion(frames.tool_rotation, frames.tool_position, spin)


@kernel
def product_derivatives(
    factors: ElementaryProduct,
    q_derivatives: Float[Array, "terms joints"],
    deviations: Float[Array, "others variables"],
) -> ToolMotion:
    r"""Motion of the tool from that of the joints and of changing parameters.

    $\dot y = J_p\dot p + J_x\dot x$,
    $\ddot y = \dot J_p\dot p + J_p\ddot p + \dot J_x\dot x + J_x\ddot x$ and so on:
    links that grow with temperature, bases that travel, tools that are moved.

    Args:
        factors: chain as a product of elementary transformations.
        q_derivatives: joint coordinates and their time derivatives, shape
            (order + 1, joints), order >= 1 [rad/s^k] or [m/s^k].
        deviations: of the parameters from their values, and their time derivatives,
            shape (order + 1, variables).

    Raises:
        ValueError: there is no velocity, or the orders differ.

    References:
        [KinModell] (3-104), (3-108), (3-111); (3-108) is printed with one factor twice.
    """
    _check_order(q_derivatives)
    if q_derivatives.shape[0] != deviations.shape[0]:
        raise ValueError(
            "`deviations` must have as many derivatives as `q_derivatives`, but they "
            f"have {deviations.shape[0] - 1} and {q_derivatives.shape[0] - 1}"
        )
    q, deviation = from_derivatives(q_derivatives), from_derivatives(deviations)
    pose = elementary_product(factors, factors.values_at(q, deviation))
    rotation = pose[:3, :3]
    turn = product("ab,cb->ac", rotation.rate(), rotation)
    spin = stack([turn[2, 1], turn[0, 2], turn[1, 0]])
    return _motion(rotation, pose[:3, 3], spin)


def _check_order(derivatives) -> None:
    if derivatives.shape[0] < 2:
        raise ValueError(
            "a motion must have at least a velocity: the first axis must have two rows "
            f"or more, but has {derivatives.shape[0]}"
        )


def _motion(rotation: Any, position: Any, spin: Any) -> ToolMotion:
    twists = concatenate([position.rate(), spin]).derivatives()
    return ToolMotion(transform(leading(rotation), leading(position)), twists)


@kernel
def rpy_derivatives(motion: ToolMotion) -> Float[Array, "terms 6"]:
    r"""Motion of the position and the roll-pitch-yaw angles of a body.

    The derivative of the angles is $E^{-1}\omega$, not $\omega$: this is the motion to
    which the analytic Jacobian belongs, $J_a = \mathrm{diag}(I, E^{-1}) J$.

    At gimbal lock ($\cos\Theta_y$ below the root of the rounding) a motion has angles
    only where the body does not turn about the lost direction. There $\Theta_z$ is held
    at zero and the others follow what remains: everything stays finite, and
    $\omega = E\dot\Theta$ holds but for the lost direction. Next to it derivative k
    grows with $1/\cos^k\Theta_y$, and its rounding too: 1e-4 rad away from the lock six
    digits are left of the third derivative.

    Args:
        motion: pose and twists.

    Returns:
        Shape (order + 1, 6): row 0 holds $(x, y, z, \Theta_x, \Theta_y, \Theta_z)$ [m]
        and [rad], $\Theta_y$ from -90 to 90 degrees; row k the derivatives of order k.

    References:
        [KinModell] (3-18), (3-33), with the principal range of the errata.
    """
    spin = from_derivatives(motion.twists[:, 3:])
    rotation = _turned(motion.pose[:3, :3], spin)
    row = lambda i: rotation[i]
    yaw = _yaw(rotation)
    sine, cosine = sin_cos(yaw)
    # R_y R_x remains; its quotients are singular nowhere
    first = product(",b->b", cosine, row(0)) + product(",b->b", sine, row(1))
    second = product(",b->b", cosine, row(1)) - product(",b->b", sine, row(0))
    pitch = _arctangent(-row(2)[0], first[0])
    roll = _arctangent(-second[2], second[1])
    angles = stack([roll, pitch, yaw]).derivatives()
    position = jnp.concatenate([motion.pose[None, :3, 3], motion.twists[:, :3]])
    return jnp.concatenate([position, angles], axis=1)


def _turned(rotation, spin: Series) -> Series:
    r"""Rotation with its derivatives: $\dot R = \tilde\omega R$, coefficient by
    coefficient."""
    turns, coefficients = skew(spin).coefficients, [rotation]
    for k in range(spin.order + 1):
        terms = [turns[i] @ coefficients[k - i] for i in range(k + 1)]
        coefficients.append(sum(terms, jnp.zeros_like(rotation)) / (k + 1))
    return Series(jnp.stack(coefficients))


def _yaw(rotation: Series) -> Series:
    """Angle about z, held at zero in gimbal lock."""
    y, x = rotation[1, 0].coefficients, rotation[0, 0].coefficients
    locked = y[0] ** 2 + x[0] ** 2 < jnp.finfo(y.dtype).eps
    # safe operands: at the lock the quotient has no derivatives
    one = jnp.zeros_like(x).at[0].set(1.0)
    y, x = jnp.where(locked, 0.0, y), jnp.where(locked, one, x)
    return _arctangent(Series(y), Series(x))


def _arctangent(y: Series, x: Series) -> Series:
    r"""Angle of the vector (x, y): $\dot\varphi = (x\dot y - y\dot x)/(x^2 + y^2)$."""
    inverse = compose(lambda r: 1 / r, x * x + y * y)
    slope = (x * y.rate() - y * x.rate()) * inverse
    angle = jnp.arctan2(leading(y), leading(x))[None]
    orders = jnp.arange(1.0, slope.order + 2, dtype=angle.dtype)
    return Series(jnp.concatenate([angle, slope.coefficients / orders]))


@kernel
def motion_from_rpy(derivatives: Float[Array, "terms 6"]) -> ToolMotion:
    r"""Motion of a body from that of its position and roll-pitch-yaw angles.

    $\omega = E\,\dot\Theta$, regular at gimbal lock too.

    Args:
        derivatives: position [m], angles about x, y, z [rad], and their time
            derivatives, shape (order + 1, 6), order >= 1.

    Raises:
        ValueError: there is no velocity.

    References:
        [KinModell] (3-15), (3-33); E as in `papers/notation.md`.
    """
    _check_order(derivatives)
    series = from_derivatives(derivatives)
    sine, cosine = sin_cos(series[3:])
    (sx, sy, sz), (cx, cy, cz) = ([s[k] for k in range(3)] for s in (sine, cosine))
    roll, pitch, yaw = (series.rate()[k] for k in (3, 4, 5))
    spin = stack(
        [
            cz * cy * roll - sz * pitch,
            sz * cy * roll + cz * pitch,
            yaw - sy * roll,
        ]
    )
    rotation = stack(
        [
            stack([cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx]),
            stack([sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx]),
            stack([-sy, cy * sx, cy * cx]),
        ]
    )
    return _motion(rotation, series[:3], spin)
