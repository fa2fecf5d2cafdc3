"""Rotations and transforms that fit measured directions and points best."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import is_concrete
from .._custom_types import Matrix3, Scalar, Transform, Vector3, require_float64
from .._taylor import skew
from ._se3 import rotation_error, transform


class RotationFit(eqx.Module):
    """A rotation from several measurements of it.

    Attributes:
        rotation: the one with the least sum of squared distances, shape (3, 3).
        residuals: rotation vectors from it to each measurement, in the frame that it
            maps to [rad], shape (number, 3).
    """

    rotation: Matrix3
    residuals: Float[Array, "number 3"]

    def standard_deviation(self) -> Vector3:
        """Of the rotation about each axis, from the residuals [rad]."""
        number = self.residuals.shape[0]
        return jnp.sqrt(jnp.sum(self.residuals**2, axis=0) / (number * (number - 1)))


class PointFit(eqx.Module):
    """A rigid motion that maps points onto measured ones.

    Attributes:
        pose: of the points' frame in the frame of the measured ones, shape (4, 4) [m].
        residuals: measured minus mapped points [m], shape (points, 3).
    """

    pose: Transform
    residuals: Float[Array, "points 3"]


@jax.custom_jvp
def nearest_rotation(matrix: Matrix3) -> Matrix3:
    r"""Rotation R that maximises $\mathrm{tr}(R^T M)$.

    $R = U\,\mathrm{diag}(1, 1, \det(UV^T))\,V^T$ of $M = U\Sigma V^T$. The
    derivative is that of the maximum, which exists where the rotation is unique, at
    equal singular values too: $dR = R\,\tilde w$ with
    $(\mathrm{tr}(S)\,I - S)\,w = \mathrm{vee}(R^T dM - dM^T R)$, $S = R^T M$.

    References:
        [Kabsch1976].
    """
    left, _, right = jnp.linalg.svd(matrix)
    sign = _handedness(left) * _handedness(right)
    last = jnp.stack([jnp.ones_like(sign), jnp.ones_like(sign), sign])
    return (left * last[None]) @ right


def _handedness(matrix: Matrix3) -> Scalar:
    """Determinant of an orthogonal matrix, without a LAPACK call."""
    return jnp.cross(matrix[0], matrix[1]) @ matrix[2]


@nearest_rotation.defjvp
def _nearest_rotation_jvp(primals, tangents):
    (matrix,), (change,) = primals, tangents
    rotation = nearest_rotation(matrix)
    stretch = rotation.T @ matrix
    turned = rotation.T @ change
    twice = turned - turned.T
    axis = jnp.stack([twice[2, 1], twice[0, 2], twice[1, 0]])
    identity = jnp.eye(3, dtype=matrix.dtype)
    symmetric = 0.5 * (stretch + stretch.T)
    turn = jnp.linalg.solve(jnp.trace(symmetric) * identity - symmetric, axis)
    return rotation, rotation @ skew(turn)


def mean_rotation(rotations: Float[Array, "number 3 3"]) -> RotationFit:
    """Mean of several measurements of a rotation.

    Args:
        rotations: shape (number, 3, 3).

    Raises:
        ValueError: fewer than two; rotations so far apart that there is no mean.
    """
    require_float64("a mean rotation")
    if rotations.shape[0] < 2:
        raise ValueError(
            f"`rotations` must hold two at least, but hold {rotations.shape[0]}"
        )
    mean = jnp.mean(rotations, axis=0)
    values = jnp.linalg.svd(mean, compute_uv=False)
    mean = _require(
        mean,
        values[1] + values[2] > 0.1,
        "`rotations` must lie near one another, but point all over: these have no mean",
    )
    rotation = nearest_rotation(mean)
    residuals = jax.vmap(lambda r: rotation_error(r, rotation))(rotations)
    return RotationFit(rotation, residuals)


def fit_points(
    points: Float[Array, "points 3"],
    measured: Float[Array, "points 3"],
    *,
    smallest_spread: Scalar | float = 1e-3,
) -> PointFit:
    r"""Rigid motion of points onto measured ones, in closed form.

    Minimises $\sum |y_i - R x_i - p|^2$.

    Args:
        points: in their own frame [m], shape (points, 3).
        measured: the same points in another frame [m], shape (points, 3).
        smallest_spread: least distance of the points from a line through them, root
            mean square [m]; a few hundred times what the measurement is wrong by.

    Raises:
        ValueError: fewer than three points, or all on a line: the rotation about that
            line is not determined then.

    References:
        [Kabsch1976].
    """
    require_float64("a fit of points")
    if points.shape != measured.shape or points.shape[0] < 3:
        raise ValueError(
            "`points` and `measured` must hold the same three points or more, but have "
            f"the shapes {points.shape} and {measured.shape}"
        )
    centre, target = jnp.mean(points, axis=0), jnp.mean(measured, axis=0)
    spread = points - centre[None]
    values = jnp.linalg.svd(spread, compute_uv=False) / np.sqrt(points.shape[0])
    across = jnp.sqrt(values[1] ** 2 + values[2] ** 2)
    spread = _require(
        spread,
        across > smallest_spread,
        "`points` must not lie on one line, because the rotation about it would not be "
        "determined: measure points away from it, or lower `smallest_spread`",
    )
    rotation = nearest_rotation((measured - target[None]).T @ spread)
    pose = transform(rotation, target - rotation @ centre)
    residuals = measured - points @ rotation.T - pose[None, :3, 3]
    return PointFit(pose, residuals)


def _require(value, condition, message: str):
    """`value`, with an error where `condition` does not hold."""
    if is_concrete(value, condition):
        if not bool(condition):
            raise ValueError(message)
        return value
    return eqx.error_if(value, ~condition, message)
