r"""Exponential maps of rotations and of rigid motions, exact and smooth at zero.

The coefficients are written as functions of the squared angle, which are entire: near
zero their power series stand in, so that derivatives of any order exist there.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Matrix3, Scalar, Transform, Vector3
from .._taylor import skew
from ._se3 import transform


_SMALL = 0.25  # squared angle below which nine terms of a series are exact
_TERMS = 9


def rotation_from_vector(vector: Vector3) -> Matrix3:
    r"""Rotation about the direction of `vector` by its length [rad].

    $R = I + \frac{\sin\varphi}{\varphi}\tilde v
    + \frac{1-\cos\varphi}{\varphi^2}\tilde v\tilde v$ (Rodrigues).
    """
    turn, square = skew(vector), vector @ vector
    identity = jnp.eye(3, dtype=turn.dtype)
    return identity + _sine(square) * turn + _cosine(square) * turn @ turn


def transform_from_twist(twist: Float[Array, "6"]) -> Transform:
    r"""Rigid motion along a screw: the exponential of a twist.

    $\exp\begin{pmatrix}\tilde w & v\\ 0 & 0\end{pmatrix}$; the translation is
    $(I + \frac{1-\cos\varphi}{\varphi^2}\tilde w
    + \frac{\varphi-\sin\varphi}{\varphi^3}\tilde w\tilde w)\,v$.

    Args:
        twist: translation v [m] above rotation w [rad], shape (6,).
    """
    v, w = twist[:3], twist[3:]
    turn, square = skew(w), w @ w
    identity = jnp.eye(3, dtype=turn.dtype)
    along = identity + _cosine(square) * turn + _cubic(square) * turn @ turn
    return transform(rotation_from_vector(w), along @ v)


def _series(square: Scalar, first: int) -> Scalar:
    r"""$\sum_k (-s)^k/(2k+f)!$ by Horner's rule."""
    factorial, terms = 1.0, []
    for n in range(1, 2 * _TERMS + first + 1):
        factorial *= n
        if n >= first and (n - first) % 2 == 0:
            terms.append(1 / factorial)
    total = jnp.zeros_like(square)
    for term in reversed(terms[:_TERMS]):
        total = term - square * total
    return total


def _both(square: Scalar, first: int, closed) -> Scalar:
    """Closed form, and the series where the angle is small."""
    small = square < _SMALL
    # a safe operand where the branch is not taken: the root has no slope at zero
    safe = jnp.where(small, 1.0, square)
    return jnp.where(small, _series(square, first), closed(safe, jnp.sqrt(safe)))


def _sine(square: Scalar) -> Scalar:
    return _both(square, 1, lambda s, angle: jnp.sin(angle) / angle)


def _cosine(square: Scalar) -> Scalar:
    return _both(square, 2, lambda s, angle: (1 - jnp.cos(angle)) / s)


def _cubic(square: Scalar) -> Scalar:
    return _both(square, 3, lambda s, angle: (angle - jnp.sin(angle)) / (s * angle))
