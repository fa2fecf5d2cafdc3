"""Quaternions: round trips, signs along a path, products, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.spatial.transform
from elastax.kinematics import (
    continuous_quaternions,
    quaternion_from_rotation,
    quaternion_product,
    rotation_about,
    rotation_from_quaternion,
    rotation_z,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.test_orientation import special_rotations


def random_quaternions(samples=200):
    quaternions = np.random.default_rng(1).standard_normal((samples, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return jnp.asarray(quaternions * np.where(quaternions[:, :1] < 0, -1, 1))


def test_round_trip_against_scipy():
    quaternions = random_quaternions()
    rotations = jax.jit(jax.vmap(rotation_from_quaternion))(quaternions)
    scalar_last = np.roll(np.asarray(quaternions), -1, axis=1)
    reference = scipy.spatial.transform.Rotation.from_quat(scalar_last)
    assert_close(rotations, reference.as_matrix(), rtol=0.0, atol=1e-15)
    again = jax.jit(jax.vmap(quaternion_from_rotation))(rotations)
    assert_close(again, quaternions, rtol=0.0, atol=1e-15)


def test_special_rotations():
    special = special_rotations()
    quaternions = jax.jit(jax.vmap(quaternion_from_rotation))(special)
    again = jax.jit(jax.vmap(rotation_from_quaternion))(quaternions)
    assert_close(again, special, rtol=0.0, atol=1e-15)
    assert_close(quaternions[0], jnp.array([1.0, 0, 0, 0]), rtol=0.0)
    # at exactly half a turn the first of x, y, z that is none is positive
    assert_close(quaternions[1], jnp.array([0.0, 1, 0, 0]), rtol=0.0)
    forward = jax.jit(jax.vmap(jax.jacfwd(quaternion_from_rotation)))(special)
    reverse = jax.jit(jax.vmap(jax.jacrev(quaternion_from_rotation)))(special)
    assert np.all(np.isfinite(forward))
    assert_close(reverse, forward, rtol=0.0, atol=1e-15)


def test_previous_chooses_the_sign():
    rotation = rotation_z(jnp.array(3.0))
    quaternion = quaternion_from_rotation(rotation)
    opposite = quaternion_from_rotation(rotation, -quaternion)
    assert_close(opposite, -quaternion, rtol=0.0)


@pytest.mark.slow
def test_signs_along_a_path():
    """Two whole turns about an axis: one turn brings the quaternion to its negative."""
    axis = jnp.array([0.6, 0.0, 0.8])
    angles = jnp.linspace(0.0, 4 * np.pi, 201)
    rotations = jax.vmap(rotation_about, (None, 0))(axis, angles)
    path = continuous_quaternions(jax.vmap(quaternion_from_rotation)(rotations))
    half = angles[:, None] / 2
    expected = jnp.concatenate([jnp.cos(half), jnp.sin(half) * axis[None]], axis=1)
    assert_close(path, expected, rtol=0.0, atol=1e-14)
    other = continuous_quaternions(path, -path[0])
    assert_close(other, -path, rtol=0.0)


def test_product_is_that_of_the_rotations():
    left, right = random_quaternions(2)
    both = rotation_from_quaternion(quaternion_product(left, right))
    expected = rotation_from_quaternion(left) @ rotation_from_quaternion(right)
    assert_close(both, expected, rtol=0.0, atol=1e-15)


def test_length_does_not_count_and_zero_is_the_identity():
    quaternion = random_quaternions(1)[0]
    expected = rotation_from_quaternion(quaternion)
    assert_close(rotation_from_quaternion(-3 * quaternion), expected, rtol=1e-14)
    zero = jnp.zeros(4)
    assert_close(rotation_from_quaternion(zero), jnp.eye(3), rtol=0.0)
    assert np.all(np.isfinite(jax.jacrev(rotation_from_quaternion)(zero)))


def test_gradient_and_batches():
    quaternions = random_quaternions(4)
    assert_gradient(
        lambda q: quaternion_from_rotation(rotation_from_quaternion(q)), quaternions[0]
    )
    rotations = jax.jit(jax.vmap(rotation_from_quaternion))(quaternions)
    single = jax.jit(quaternion_from_rotation)
    loop = jnp.stack([single(r) for r in rotations])
    mapped = jax.jit(jax.vmap(quaternion_from_rotation))(rotations)
    assert_close(mapped, loop, rtol=0.0, atol=1e-15)
