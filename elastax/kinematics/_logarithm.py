r"""Logarithms of rotations and of rigid motions, exact at zero and up to half a turn.

The inverses of `rotation_from_vector` and `transform_from_twist`. By way of the
quaternion, whose parts are the sine and the cosine of half the angle: neither small
angles nor those near half a turn lose digits. Near zero the series of entire or
analytic functions of the squared angle stand in.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Matrix3, Scalar, Transform, Vector3
from .._kernel import kernel
from .._taylor import skew
from ._quaternion import quaternion_from_rotation


_SMALL = 0.01  # squared tangent of half the angle below which the series is exact
_TERMS = 10
_SMALL_ANGLE = 0.25  # squared angle below which the series is exact
# |B_2n|/(2n)! with the Bernoulli numbers B, n = 1, 2, ...
_BERNOULLI = (
    (1, 12),
    (1, 720),
    (1, 30240),
    (1, 1209600),
    (1, 47900160),
    (691, 1307674368000),
    (1, 74724249600),
    (3617, 10670622842880000),
)


@kernel
def vector_from_rotation(rotation: Matrix3) -> Vector3:
    r"""Axis times angle [rad] of a rotation, the angle in $[0, \pi]$.

    At exactly half a turn the axis has two senses; the one is taken whose first
    component that is not zero is positive, and the derivative is that of this branch.

    Args:
        rotation: shape (3, 3).

    Returns:
        Rotation vector [rad], shape (3,), zero for the identity.
    """
    q = quaternion_from_rotation(rotation)
    w, v = q[0], q[1:]
    square = v @ v
    small = square < _SMALL * w**2
    # safe operands where a branch is not taken
    tangent = v / jnp.where(small, w, 1.0)
    length = jnp.sqrt(jnp.where(small, 1.0, square))
    near = 2 * _arctangent(jnp.where(small, tangent @ tangent, 0.0))
    far = 2 * jnp.arctan2(length, w) / length
    return jnp.where(small, near * tangent, far * v)


@kernel
def twist_from_transform(pose: Transform) -> Float[Array, "6"]:
    r"""Twist whose exponential is a rigid motion.

    $v = (I - \tfrac12\tilde w + \tfrac{1}{\varphi^2}(1 - \tfrac\varphi2
    \cot\tfrac\varphi2)\,\tilde w\tilde w)\,p$ with the rotation vector w.

    Args:
        pose: homogeneous matrix [m], shape (4, 4).

    Returns:
        Translation v [m] above rotation w [rad], shape (6,).
    """
    w, p = vector_from_rotation(pose[:3, :3]), pose[:3, 3]
    turn = skew(w)
    once = turn @ p
    twice = turn @ once
    v = p - 0.5 * once + _cotangent(w @ w) * twice
    return jnp.concatenate([v, w])


@kernel
def pose_difference(target: Transform, actual: Transform) -> Float[Array, "6"]:
    """Target minus actual: translation [m] above rotation vector [rad].

    Like `pose_error`, but with the rotation vector in place of its sine: exact for
    large rotations too, and zero only where the poses are equal.

    Args:
        target, actual: poses in the base frame [m], shape (4, 4).

    Returns:
        Difference of the origins [m] and rotation vector [rad], in the base frame,
        shape (6,).

    References:
        [KinModell] (3-43), [Reiner2010] (3.57a).
    """
    vector = vector_from_rotation(target[:3, :3] @ actual[:3, :3].T)
    return jnp.concatenate([target[:3, 3] - actual[:3, 3], vector])


def _arctangent(square: Scalar) -> Scalar:
    r"""$\arctan(x)/x = \sum_k (-x^2)^k/(2k+1)$ by Horner's rule."""
    total = jnp.zeros_like(square)
    for k in reversed(range(_TERMS)):
        total = 1 / (2 * k + 1) - square * total
    return total


def _cotangent(square: Scalar) -> Scalar:
    r"""$(1 - \tfrac\varphi2\cot\tfrac\varphi2)/\varphi^2$."""
    small = square < _SMALL_ANGLE
    series = jnp.zeros_like(square)
    for over, under in reversed(_BERNOULLI):
        series = over / under + jnp.where(small, square, 0.0) * series
    # a safe operand where the branch is not taken
    safe = jnp.where(small, math.pi**2, square)
    half = jnp.sqrt(safe) / 2
    return jnp.where(small, series, (1 - half * jnp.cos(half) / jnp.sin(half)) / safe)
