"""Rotations, transforms and the orientation error."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.spatial.transform
from elastax.kinematics import (
    inverse_transform,
    rotation_about,
    rotation_error,
    rotation_from_rpy,
    rotation_x,
    rotation_y,
    rotation_z,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


def unit(*vector):
    vector = jnp.array(vector, float)
    return vector / jnp.linalg.norm(vector)


def vee(matrix):
    return jnp.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-8, 0.7, np.pi, -2.5, 1e8])
def test_rotation_about_is_the_exponential(angle):
    axis = unit(1, -2, 3)
    reference = scipy.spatial.transform.Rotation.from_rotvec(
        np.asarray(axis) * np.remainder(angle, 2 * np.pi)
    )
    # argument reduction of 1e8 costs its own rounding, 1e8 * 2e-16
    assert_close(
        rotation_about(axis, jnp.array(angle)),
        reference.as_matrix(),
        rtol=0.0,
        atol=1e-15 + 1e-15 * abs(angle),
    )


def test_elementary_rotations_are_right_handed():
    quarter = jnp.array(np.pi / 2)
    x, y, z = jnp.eye(3)
    assert_close(rotation_x(quarter) @ y, z, rtol=0.0, atol=1e-15)
    assert_close(rotation_y(quarter) @ z, x, rtol=0.0, atol=1e-15)
    assert_close(rotation_z(quarter) @ x, y, rtol=0.0, atol=1e-15)


def test_rpy_turns_about_fixed_x_then_y_then_z():
    rpy = jnp.array([0.3, -0.7, 1.9])
    reference = scipy.spatial.transform.Rotation.from_euler("xyz", np.asarray(rpy))
    assert_close(rotation_from_rpy(rpy), reference.as_matrix(), rtol=0.0, atol=1e-15)


def test_transform_and_its_inverse():
    vectors = load_vectors("A.10/A.11")[0]
    rotation, position = (jnp.array(vectors["inputs"][k]) for k in ("R", "r_t"))
    pose, tol = transform(rotation, position), vectors["tol"]
    assert_close(pose, vectors["outputs"]["T"], rtol=tol)
    inverse = inverse_transform(pose)
    assert_close(inverse, vectors["outputs"]["T_inv"], rtol=tol, atol=tol)
    assert_close(inverse @ pose, jnp.eye(4), rtol=0.0, atol=1e-15)


def test_error_of_a_small_rotation_is_its_vector():
    actual = rotation_from_rpy(jnp.array([2.0, -1.0, 0.5]))
    vector = 1e-3 * unit(2, -1, 1)
    angle = jnp.linalg.norm(vector)
    target = rotation_about(vector / angle, angle) @ actual
    # sin(angle) instead of angle
    assert_close(rotation_error(target, actual), vector, rtol=2e-7)
    assert_close(
        rotation_error(actual, target), -rotation_error(target, actual), rtol=1e-12
    )
    assert_close(rotation_error(actual, actual), jnp.zeros(3), rtol=0.0)


@pytest.mark.parametrize("case", load_vectors("Reiner 3.55/3.56"), ids="123")
def test_absolute_orientation_is_singular_and_relative_is_not(case):
    axis = unit(*case["inputs"]["axis"])
    actual = rotation_about(axis, jnp.array(np.deg2rad(case["inputs"]["angle_deg"])))

    def turned(rotvec):
        angle = jnp.sqrt(jnp.sum(rotvec**2) + 1e-300)
        return rotation_about(rotvec / angle, angle) @ actual

    # the derivative at zero is taken along small rotations
    start = 1e-9 * unit(1, 1, 1)
    rates = jax.jit(jax.jacfwd(turned))(start)
    absolute = jnp.stack([vee(rates[..., k] - rates[..., k].T) for k in range(3)], 1)
    expected = jnp.trace(actual) * jnp.eye(3) - actual
    assert_close(absolute, expected, rtol=0.0, atol=1e-8)
    determinant = case["outputs"]["det"]
    assert_close(jnp.linalg.det(expected), determinant, rtol=1e-10, atol=1e-10)

    part = actual - actual.T
    skew = jnp.array([part[0, 1], part[0, 2], part[1, 2]])
    assert_close(skew, case["outputs"]["R_S"], rtol=case["tol"], atol=1e-11)

    relative = jax.jit(jax.jacfwd(lambda v: rotation_error(turned(v), actual)))
    assert_close(relative(start), jnp.eye(3), rtol=0.0, atol=1e-8)


def test_gradient():
    def function(rpy, axis, angle):
        rotation = rotation_from_rpy(rpy) @ rotation_about(axis, angle)
        pose = inverse_transform(transform(rotation, rpy))
        return pose, rotation_error(rotation, rotation_from_rpy(rpy))

    assert_gradient(
        function, jnp.array([0.3, -0.7, 1.9]), unit(1, 2, 2), jnp.array(0.4)
    )
