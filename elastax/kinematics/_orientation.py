r"""Angles from rotation matrices: roll-pitch-yaw, KUKA's A, B, C, and Euler z-x-z.

Three angles have two solutions, and a pose in which only a sum or a difference of two
of them is determined (gimbal lock). There the first of the turns, read from the left,
is kept: it is zero or what the caller had before. The other two follow from that first
one instead of from elements of their own, so that the angles give the matrix back to
rounding in and near gimbal lock, and all derivatives are finite.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import is_concrete
from .._custom_types import Matrix3, Scalar, Transform, Vector3
from .._kernel import kernel
from ._se3 import rotation_from_rpy, rotation_x, rotation_z


AnyMatrix3 = Matrix3 | Float[np.ndarray, "3 3"]
AnyTransform = Transform | Float[np.ndarray, "4 4"]

# in units of rounding: below it, noise moves the first angle by more than 1/64 rad
_LOCKED = 64.0


def check_rotation(rotation: AnyMatrix3, tolerance: float = 1e-6) -> AnyMatrix3:
    r"""`rotation`, if it is one.

    Args:
        rotation: matrix with orthonormal columns that form a right-handed frame.
        tolerance: largest deviation of an element of $R^TR$ from the identity.

    Returns:
        The same matrix; use it, or nothing is checked where it is traced.

    Raises:
        ValueError: the matrix is not finite, not orthogonal or left-handed; the message
            says by how much. Where the matrix is traced, a run-time error.
    """
    if not is_concrete(rotation):
        deviation = jnp.max(
            jnp.abs(rotation.T @ rotation - jnp.eye(3, dtype=rotation.dtype))
        )
        good = (deviation <= tolerance) & (jnp.linalg.det(rotation) > 0)
        return eqx.error_if(
            rotation,
            ~good,
            "`rotation` must be orthogonal and right-handed within `tolerance`, but is "
            "not: check its numbers outside of `jit` to see by how much",
        )
    matrix = np.asarray(rotation, float)
    if not np.all(np.isfinite(matrix)):
        raise ValueError(f"`rotation` must be finite, but is {matrix.tolist()}")
    excess = np.abs(matrix.T @ matrix - np.eye(3))
    if excess.max() > tolerance:
        i, j = np.unravel_index(np.argmax(excess), excess.shape)
        what = (
            f"column {i + 1} has the length {np.linalg.norm(matrix[:, i]):.8g}"
            if i == j
            else f"columns {i + 1} and {j + 1} have the product {excess[i, j]:.3g}"
        )
        raise ValueError(
            f"`rotation` must be orthogonal within {tolerance:.3g}, but deviates by "
            f"{excess.max():.3g}: {what}"
        )
    if (determinant := float(np.linalg.det(matrix))) < 0:
        raise ValueError(
            "`rotation` must be right-handed, but is a reflection with the determinant "
            f"{determinant:.6g}"
        )
    return rotation


def check_transform(pose: AnyTransform, tolerance: float = 1e-6) -> AnyTransform:
    """`pose`, if it is a rigid motion.

    Args:
        pose: homogeneous matrix, shape (4, 4).
        tolerance: as for `check_rotation`, also of the last row.

    Returns:
        The same matrix; use it, or nothing is checked where it is traced.

    Raises:
        ValueError: the matrix is not finite, its rotation is none, or its last row is
            not (0, 0, 0, 1). Where the matrix is traced, a run-time error.
    """
    if not is_concrete(pose):
        turn = check_rotation(pose[:3, :3], tolerance)
        last = jnp.abs(pose[3] - jnp.array([0.0, 0.0, 0.0, 1.0], pose.dtype))
        return eqx.error_if(
            jnp.asarray(pose).at[:3, :3].set(turn),
            ~(jnp.all(jnp.isfinite(pose)) & jnp.all(last <= tolerance)),
            "`pose` must be finite and have the last row (0, 0, 0, 1), but has not",
        )
    matrix = np.asarray(pose, float)
    if not np.all(np.isfinite(matrix)):
        raise ValueError(f"`pose` must be finite, but is {matrix.tolist()}")
    if np.max(np.abs(matrix[3] - [0, 0, 0, 1])) > tolerance:
        raise ValueError(
            f"the last row of `pose` must be (0, 0, 0, 1), but is {matrix[3].tolist()}"
        )
    check_rotation(matrix[:3, :3], tolerance)
    return pose


@kernel
def rpy_solutions(
    rotation: Matrix3, previous: Vector3 | None = None
) -> Float[Array, "2 3"]:
    r"""Both sets of roll-pitch-yaw angles of a rotation.

    $R = R_z(\Theta_z) R_y(\Theta_y) R_x(\Theta_x)$. In the first row
    $\Theta_y \in [-\pi/2, \pi/2]$; the second one turns by $\Theta_z \pm \pi$ first,
    and has $\Theta_y$ in the other half. In gimbal lock, $\cos\Theta_y = 0$ up to
    rounding, both rows are equal, $\Theta_z$ is kept and does not depend on `rotation`.

    The text prints $R_y$ as the last factor of (3-15), which is $R_x$, and in (3-18)
    the other solution as $\pi - \arcsin t_{31}$ for $\pi + \arcsin t_{31}$; its
    principal values are those of the quadrants I and IV.

    Args:
        rotation: shape (3, 3).
        previous: angles whose $\Theta_z$ is kept in gimbal lock [rad]; zero unless
            given.

    Returns:
        Angles $(\Theta_x, \Theta_y, \Theta_z)$ in [-pi, pi] [rad], shape (2, 3). For
        the row next to angles from before see `select_branch`.

    References:
        [KinModell] (3-15) to (3-18).
    """
    kept = None if previous is None else previous[2]
    first = _first(rotation[1, 0], rotation[0, 0], kept)
    return jnp.stack([_rpy(rotation, angle) for angle in first])


@kernel
def rpy_from_rotation(rotation: Matrix3, previous: Vector3 | None = None) -> Vector3:
    r"""Principal roll-pitch-yaw angles, $\Theta_y \in [-\pi/2, \pi/2]$.

    Args:
        rotation: shape (3, 3).
        previous: angles whose $\Theta_z$ is kept in gimbal lock [rad]; zero unless
            given.

    Returns:
        Angles $(\Theta_x, \Theta_y, \Theta_z)$ [rad], shape (3,).

    References:
        [KinModell] (3-18), see `rpy_solutions`.
    """
    return rpy_solutions(rotation, previous)[0]


def _rpy(rotation: Matrix3, z: Scalar) -> Vector3:
    r"""The other two angles, of $R_z^T R = R_y R_x$."""
    sine, cosine = jnp.sin(z), jnp.cos(z)
    ahead = cosine * rotation[0] + sine * rotation[1]
    aside = cosine * rotation[1] - sine * rotation[0]
    y = jnp.arctan2(-rotation[2, 0], ahead[0])
    return jnp.stack([jnp.arctan2(-aside[2], aside[1]), y, z])


@kernel
def rotation_from_abc(abc: Vector3) -> Matrix3:
    r"""Rotation from KUKA's angles A, B, C [rad], turns about z, y', x''.

    $(A, B, C) = (\Theta_z, \Theta_y, \Theta_x)$; the controller shows degrees.
    """
    return rotation_from_rpy(abc[::-1])


@kernel
def abc_from_rotation(rotation: Matrix3, previous: Vector3 | None = None) -> Vector3:
    """KUKA's angles A, B, C of a rotation, with B in [-pi/2, pi/2].

    Args:
        rotation: shape (3, 3).
        previous: angles A, B, C whose A is kept in gimbal lock [rad]; zero unless
            given.

    Returns:
        Angles A, B, C [rad], shape (3,); the controller shows degrees.

    References:
        [KinModell] (3-18), see `rpy_solutions`.
    """
    rpy = None if previous is None else previous[::-1]
    return rpy_from_rotation(rotation, rpy)[::-1]


@kernel
def rotation_from_zxz(angles: Vector3) -> Matrix3:
    r"""Rotation $R_z(\alpha) R_x(\beta) R_z(\gamma)$ from Euler angles [rad].

    References:
        [Reiner2010] (A.9), which prints the transpose.
    """
    turn = rotation_x(angles[1]) @ rotation_z(angles[2])
    return rotation_z(angles[0]) @ turn


@kernel
def zxz_solutions(
    rotation: Matrix3, previous: Vector3 | None = None
) -> Float[Array, "2 3"]:
    r"""Both sets of Euler angles z-x-z of a rotation.

    In the first row $\beta \in [0, \pi]$; the second one has the opposite $\beta$.
    Where $\sin\beta = 0$ up to rounding, both rows are equal, $\alpha$ is kept and does
    not depend on `rotation`.

    Args:
        rotation: shape (3, 3).
        previous: angles whose $\alpha$ is kept in the singular case [rad]; zero unless
            given.

    Returns:
        Angles $(\alpha, \beta, \gamma)$ in [-pi, pi] [rad], shape (2, 3).

    References:
        [Reiner2010] (A.9), which prints the transpose.
    """
    kept = None if previous is None else previous[0]
    first = _first(rotation[0, 2], -rotation[1, 2], kept)
    return jnp.stack([_zxz(rotation, angle) for angle in first])


@kernel
def zxz_from_rotation(rotation: Matrix3, previous: Vector3 | None = None) -> Vector3:
    r"""Euler angles z-x-z of a rotation with $\beta \in [0, \pi]$.

    Args:
        rotation: shape (3, 3).
        previous: angles whose $\alpha$ is kept in the singular case [rad]; zero unless
            given.

    Returns:
        Angles $(\alpha, \beta, \gamma)$ [rad], shape (3,).
    """
    return zxz_solutions(rotation, previous)[0]


def _zxz(rotation: Matrix3, z: Scalar) -> Vector3:
    r"""The other two angles, of $R_z^T R = R_x R_z$."""
    sine, cosine = jnp.sin(z), jnp.cos(z)
    ahead = cosine * rotation[0] + sine * rotation[1]
    aside = cosine * rotation[1] - sine * rotation[0]
    x = jnp.arctan2(-aside[2], rotation[2, 2])
    return jnp.stack([z, x, jnp.arctan2(-ahead[1], ahead[0])])


def _first(sine: Scalar, cosine: Scalar, kept: Scalar | None) -> tuple[Scalar, Scalar]:
    """The first turn of both solutions from its sine and cosine, or what is kept."""
    kept = jnp.zeros_like(sine) if kept is None else kept
    rounding = _LOCKED * float(jnp.finfo(sine.dtype).eps)
    locked = sine**2 + cosine**2 <= rounding**2
    # a safe operand where the angle is kept: its slope would be infinite
    sine, cosine = jnp.where(locked, 0.0, sine), jnp.where(locked, 1.0, cosine)
    return (
        jnp.where(locked, kept, jnp.arctan2(sine, cosine)),
        jnp.where(locked, kept, jnp.arctan2(-sine, -cosine)),
    )
