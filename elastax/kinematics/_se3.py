"""Rotations and homogeneous transforms.

A transform `T_a_b` maps coordinates of frame b into frame a; column vectors, chains
read from left to right (`papers/notation.md`).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Matrix3, Scalar, Transform, Vector3
from .._taylor import skew


def rotation_x(angle: Scalar) -> Matrix3:
    """Rotation by `angle` [rad] about x."""
    return rotation_about(jnp.array([1.0, 0.0, 0.0]), angle)


def rotation_y(angle: Scalar) -> Matrix3:
    """Rotation by `angle` [rad] about y."""
    return rotation_about(jnp.array([0.0, 1.0, 0.0]), angle)


def rotation_z(angle: Scalar) -> Matrix3:
    """Rotation by `angle` [rad] about z."""
    return rotation_about(jnp.array([0.0, 0.0, 1.0]), angle)


def rotation_about(axis: Vector3, angle: Scalar) -> Matrix3:
    r"""Rotation by `angle` [rad] about the unit vector `axis` (Rodrigues).

    $R = I + \sin\varphi\,\tilde a + (1-\cos\varphi)\,\tilde a\tilde a$.
    """
    a = skew(axis)
    angle = jnp.asarray(angle)
    sine, rest = jnp.sin(angle), 1 - jnp.cos(angle)
    return jnp.eye(3, dtype=a.dtype) + sine * a + rest * a @ a


def rotation_from_rpy(rpy: Vector3) -> Matrix3:
    r"""Rotation $R_z(\Theta_z) R_y(\Theta_y) R_x(\Theta_x)$ from angles [rad].

    References:
        [KinModell] (3-11).
    """
    return rotation_z(rpy[2]) @ rotation_y(rpy[1]) @ rotation_x(rpy[0])


def transform(
    rotation: Float[Array, "*batch 3 3"], position: Float[Array, "*batch 3"]
) -> Float[Array, "*batch 4 4"]:
    """Homogeneous matrix of a rotation and a translation [m].

    References:
        [Reiner2010] (2.25), (A.10).
    """
    bottom = jnp.broadcast_to(
        jnp.array([0.0, 0.0, 0.0, 1.0], rotation.dtype), (*position.shape[:-1], 1, 4)
    )
    top = jnp.concatenate([rotation, position[..., None]], axis=-1)
    return jnp.concatenate([top, bottom], axis=-2)


def inverse_transform(pose: Transform) -> Transform:
    """Inverse of a homogeneous matrix without solving a linear system.

    References:
        [Reiner2010] (A.11).
    """
    rotation = pose[:3, :3].T
    return transform(rotation, -rotation @ pose[:3, 3])


def rotation_error(target: Matrix3, actual: Matrix3) -> Vector3:
    r"""Small-angle error vector in the base frame, target against actual orientation.

    $e = \tfrac12\,\mathrm{vee}(R_t R_a^T - R_a R_t^T)$, equal to the rotation vector
    for small errors at any absolute orientation; the difference of $R - R^T$ that the
    text uses is singular where the absolute rotation angle is 90 or 180 degrees.

    References:
        [Reiner2010] (3.55) to (3.57), with the relative error of the errata.
    """
    relative = target @ actual.T
    return 0.5 * jnp.array(
        [
            relative[2, 1] - relative[1, 2],
            relative[0, 2] - relative[2, 0],
            relative[1, 0] - relative[0, 1],
        ]
    )
