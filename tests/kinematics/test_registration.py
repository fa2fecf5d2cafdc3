"""Rotations and points that fit best: exact, degenerate, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    fit_points,
    mean_rotation,
    nearest_rotation,
    rotation_from_vector,
    rotation_x,
    rotation_z,
    transform_from_twist,
)

from ..helpers import assert_close, assert_gradient
from .calibration_arms import REFLECTORS, poses


@pytest.mark.parametrize(
    "points",
    (REFLECTORS, np.eye(3), np.vstack([np.eye(3), -np.eye(3)]), poses(20)[:, :3]),
    ids=("three", "regular", "cube", "cloud"),
)
def test_fit_of_exact_points(points):
    pose = transform_from_twist(jnp.array([1.0, -2, 0.5, 2.0, 1.0, -1.8]))
    measured = points @ pose[:3, :3].T + pose[None, :3, 3]
    found = fit_points(jnp.asarray(points), measured)
    assert_close(found.pose, pose, rtol=0, atol=1e-13)
    assert_close(found.residuals, np.zeros(points.shape), rtol=0, atol=1e-13)


def test_fit_is_never_a_reflection():
    """Points of a plane whose mirror image would fit as well, and noise beyond it."""
    points = jnp.asarray(np.array([[0.0, 0, 1e-4], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    mirrored = points * jnp.array([1.0, 1.0, -1.0])[None]
    assert_close(jnp.linalg.det(fit_points(points, mirrored).pose), 1.0, rtol=1e-12)


@pytest.mark.parametrize("matrix", ("general", "equal", "flat"))
def test_nearest_rotation_gradient(matrix):
    """Equal singular values, or a zero one, leave the rotation unique and smooth."""
    rotation = rotation_from_vector(jnp.array([0.4, -1.0, 0.3]))
    stretch = {"general": [3.0, 2, 1], "equal": [2.0, 2, 2], "flat": [2.0, 1, 0]}
    base = rotation @ jnp.diag(jnp.array(stretch[matrix]))
    assert_close(nearest_rotation(base), rotation, rtol=0, atol=1e-14)
    # moved in a skew direction, so that differences see a plane that does not flip
    path = lambda x: nearest_rotation(
        base + (x[0] - 1) * jnp.array([[0.0, 1, 2], [-1, 0, 0.5], [-2, -0.5, 0]])
    )
    assert_gradient(path, jnp.ones(1))


def test_points_on_a_line_are_refused():
    line = jnp.asarray(np.outer(np.arange(4.0), [1.0, 2, 3]))
    with pytest.raises(ValueError, match="must not lie on one line"):
        fit_points(line, line)
    with pytest.raises(ValueError, match="same three points"):
        fit_points(line[:2], line[:2])
    with pytest.raises(Exception, match="must not lie on one line"):
        jax.block_until_ready(jax.jit(lambda x: fit_points(x, x).pose)(line))


def test_rotations_without_a_mean():
    about = jax.vmap(rotation_z)(jnp.array([0.0, np.pi / 2, np.pi, -np.pi / 2]))
    with pytest.raises(ValueError, match="point all over"):
        mean_rotation(jnp.concatenate([about, about @ rotation_x(jnp.array(np.pi))]))
    with pytest.raises(ValueError, match="two at least, but hold 1"):
        mean_rotation(about[:1])
