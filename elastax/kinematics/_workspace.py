"""Maps of the workspace as arrays: points, sections, qualities and limits of reach."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import Matrix3, PerJoint, Scalar, Transform, Vector3
from ._chain import SerialChain, forward_kinematics
from ._ik_analytic import SphericalWrist, inverse_kinematics
from ._jacobian import jacobian
from ._se3 import transform


Measure = Callable[[Float[Array, "6 joints"]], Scalar]


def joint_grid(
    lower: PerJoint, upper: PerJoint, counts: tuple[int, ...]
) -> Float[Array, "samples joints"]:
    """All combinations of evenly spaced joint coordinates.

    Args:
        lower, upper: limits [rad] or [m], shape (joints,); both are samples.
        counts: number of samples of every joint; one sample is in the middle.

    Raises:
        ValueError: `counts` are not positive, or not one per joint.
    """
    if len(counts) != lower.shape[0] or min(counts) < 1:
        raise ValueError(
            f"`counts` must be a positive number for each of the {lower.shape[0]} "
            f"joints, but is {counts}"
        )
    lines = [np.linspace(0, 1, c) if c > 1 else np.array([0.5]) for c in counts]
    shares = np.stack([x.ravel() for x in np.meshgrid(*lines, indexing="ij")], axis=1)
    shares = jnp.asarray(shares, lower.dtype)
    return lower[None] + shares * (upper - lower)[None]


def reachable_points(
    chain: SerialChain, q: Float[Array, "samples joints"]
) -> Float[Array, "samples 3"]:
    """Positions of the tool [m] of many joint coordinates, in the base frame."""
    return jax.vmap(lambda x: forward_kinematics(chain, x)[:3, 3])(q)


def section_points(
    corner: Vector3, first: Vector3, second: Vector3, counts: tuple[int, int]
) -> Float[Array, "rows columns 3"]:
    """Grid over a parallelogram in a plane through the workspace.

    Args:
        corner: where it starts [m].
        first, second: its edges [m]; their ends are grid points.
        counts: number of points along each of them, at least two.
    """
    u, v = (jnp.linspace(0.0, 1.0, n, dtype=corner.dtype) for n in counts)
    along = u[:, None, None] * first[None, None] + v[None, :, None] * second[None, None]
    return corner[None, None] + along


class PoseQuality(NamedTuple):
    """What an arm makes of a pose.

    Attributes:
        branches: number of solutions within the joint limits, whole turns aside.
        value: best measure among them, zero if there is none.
    """

    branches: Int[Array, ""]
    value: Scalar


def pose_quality(
    arm: SphericalWrist,
    pose: Transform,
    lower: PerJoint,
    upper: PerJoint,
    measure: Measure,
) -> PoseQuality:
    """Whether and how well a pose can be reached, over all branches of the inverse.

    Args:
        arm: the arm.
        pose: of the tool in the base frame, shape (4, 4).
        lower, upper: joint limits [rad], shape (6,).
        measure: of the geometric Jacobian (6, 6), not negative, such as
            `manipulability`; scale its rows first where metres and radians mix.
    """
    solutions, valid = inverse_kinematics(arm, pose)
    within = jax.vmap(_within, (0, None, None))(solutions, lower, upper)
    good = valid & within
    values = jax.vmap(lambda q: measure(jacobian(arm.chain, q)))(solutions)
    best = jnp.max(jnp.where(good, values, 0.0))
    return PoseQuality(jnp.sum(good), best)


def section_map(
    arm: SphericalWrist,
    rotation: Matrix3,
    points: Float[Array, "rows columns 3"],
    lower: PerJoint,
    upper: PerJoint,
    measure: Measure,
) -> PoseQuality:
    """`pose_quality` at every point of a section, at one orientation of the tool.

    Args:
        arm: the arm.
        rotation: of the tool in the base frame, shape (3, 3).
        points: positions of the tool [m], such as `section_points`.
        lower, upper, measure: as for `pose_quality`.

    Returns:
        Arrays of shape (rows, columns).
    """
    at = lambda p: pose_quality(arm, transform(rotation, p), lower, upper, measure)
    return jax.vmap(jax.vmap(at))(points)


def _within(q: PerJoint, lower: PerJoint, upper: PerJoint) -> Bool[Array, ""]:
    """Whether angles, but for whole turns, are between the limits."""
    turn, slack = 2 * np.pi, 1e-9
    lowest = q + turn * jnp.ceil((lower - q - slack) / turn)
    return jnp.all(lowest <= upper + slack)


class SampledSection(NamedTuple):
    """Cells of a section through a cloud of points.

    Attributes:
        counts: number of points in each cell, shape (rows, columns).
        best: largest value among them, zero where there is none.
    """

    counts: Int[Array, "rows columns"]
    best: Float[Array, "rows columns"]


def sampled_section(
    points: Float[Array, "samples 3"],
    values: Float[Array, " samples"],
    corner: Vector3,
    first: Vector3,
    second: Vector3,
    counts: tuple[int, int],
    thickness: Scalar | float,
) -> SampledSection:
    """Points near a plane, sorted into cells: for chains without a closed inverse.

    An empty cell is not out of reach for certain: the number of samples decides.

    Args:
        points: sampled positions [m], such as `reachable_points`. For a section through
            a body of revolution replace x by the distance from its axis, y by zero.
        values: measure of each sample, not negative.
        corner: of the rectangle [m].
        first, second: its edges [m], perpendicular to each other.
        counts: number of cells along each of them.
        thickness: points up to half of it away from the plane count [m].
    """
    rows, columns = counts
    away = points - corner[None]
    u = jnp.floor(rows * (away @ first) / jnp.sum(first**2)).astype(int)
    v = jnp.floor(columns * (away @ second) / jnp.sum(second**2)).astype(int)
    normal = jnp.cross(first, second)
    height = (away @ normal) / jnp.sqrt(jnp.sum(normal**2))
    inside = (u >= 0) & (u < rows) & (v >= 0) & (v < columns)
    inside = inside & (jnp.abs(height) <= thickness / 2)
    # one cell more collects the points outside
    cell = jnp.where(inside, u * columns + v, rows * columns)
    number = jnp.zeros(rows * columns + 1, int).at[cell].add(1)
    best = jnp.zeros(rows * columns + 1, values.dtype).at[cell].max(values)
    return SampledSection(
        number[:-1].reshape(rows, columns), best[:-1].reshape(rows, columns)
    )
