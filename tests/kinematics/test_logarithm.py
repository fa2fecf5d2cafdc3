"""Exponentials and logarithms of rotations and rigid motions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from elastax.kinematics import (
    pose_difference,
    pose_error,
    rotation_about,
    rotation_from_vector,
    transform_from_twist,
    twist_from_transform,
    vector_from_rotation,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.test_orientation import special_rotations


ANGLES = [0.0, 1e-300, 1e-160, 1e-12, 1e-7, 1e-3, 0.19, 0.2, 0.2004, 0.4999, 0.5001]
ANGLES += [1.0, 2.0, 3.0, np.pi - 1e-4, np.pi - 1e-8, np.pi - 1e-12]


def twists(angles=ANGLES):
    rng = np.random.default_rng(4)
    axes = rng.standard_normal((len(angles), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    shifts = rng.standard_normal((len(angles), 3))
    return jnp.asarray(np.concatenate([shifts, axes * np.array(angles)[:, None]], 1))


def generator(twist):
    x, y, z = twist[3:]
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.block([[turn, twist[:3, None]], [np.zeros((1, 4))]])


@pytest.fixture(scope="module")
def maps():
    return tuple(
        jax.jit(jax.vmap(f))
        for f in (
            transform_from_twist,
            twist_from_transform,
            rotation_from_vector,
            vector_from_rotation,
        )
    )


def test_exponential_is_that_of_the_matrix(maps):
    exponential, _, turn, _ = maps
    given = twists()
    expected = [scipy.linalg.expm(generator(np.asarray(t))) for t in given]
    assert_close(exponential(given), np.stack(expected), rtol=0.0, atol=5e-15)
    assert_close(turn(given[:, 3:]), exponential(given)[:, :3, :3], rtol=0.0)


def test_round_trips(maps):
    exponential, logarithm, turn, vector = maps
    given = twists()
    assert_close(logarithm(exponential(given)), given, rtol=0.0, atol=1e-14)
    poses = exponential(given)
    assert_close(exponential(logarithm(poses)), poses, rtol=0.0, atol=1e-14)
    assert_close(vector(turn(given[:, 3:])), given[:, 3:], rtol=0.0, atol=1e-14)


def test_small_vectors_keep_their_digits(maps):
    _, _, turn, vector = maps
    small = twists([1e-300, 1e-160, 1e-12, 1e-7, 1e-3])[:, 3:]
    assert_close(vector(turn(small)), small, rtol=1e-14)


def test_half_a_turn(maps):
    """Exactly half a turn, and beyond it: the shorter way back."""
    _, _, _, vector = maps
    special = special_rotations()
    found = vector(special)
    again = jax.jit(jax.vmap(rotation_from_vector))(found)
    assert_close(again, special, rtol=0.0, atol=1e-15)
    assert_close(found[1], jnp.array([np.pi, 0, 0]), rtol=0.0, atol=1e-15)
    axis, beyond = jnp.array([0.6, 0.0, 0.8]), np.pi + 0.3
    back = vector_from_rotation(rotation_about(axis, jnp.array(beyond)))
    assert_close(back, (beyond - 2 * np.pi) * axis, rtol=1e-14)


def test_derivatives_are_finite_everywhere():
    def both(rotation):
        pose = jnp.zeros((4, 4)).at[:3, :3].set(rotation)
        pose = pose.at[:, 3].set(jnp.array([0.3, -0.2, 0.5, 1.0]))
        return vector_from_rotation(rotation), twist_from_transform(pose)

    special = special_rotations()
    forward = jax.jit(jax.vmap(jax.jacfwd(both)))(special)
    reverse = jax.jit(jax.vmap(jax.jacrev(both)))(special)
    assert all(np.all(np.isfinite(x)) for x in forward)
    assert_close(reverse, forward, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.199, 0.6, 3.1, np.pi - 1e-6])
def test_derivative_of_the_round_trip_is_the_identity(angle):
    """Through both branches of both maps, and at zero."""
    twist = twists([angle])[0]
    slopes = jax.jit(
        jax.jacfwd(lambda x: twist_from_transform(transform_from_twist(x)))
    )(twist)
    assert_close(slopes, jnp.eye(6), rtol=0.0, atol=1e-13)


def test_second_derivatives_at_zero():
    """Of the logarithm of a product: half the Lie bracket."""
    product = lambda a, b: vector_from_rotation(
        rotation_from_vector(a) @ rotation_from_vector(b)
    )
    zero = jnp.zeros(3)
    mixed = jax.jit(jax.jacfwd(jax.jacrev(product, 0), 1))(zero, zero)
    levi = np.cross(np.eye(3)[:, None], np.eye(3)[None]).transpose(2, 0, 1)
    assert_close(mixed, levi / 2, rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_gradient_and_batches(maps):
    given = twists()
    for twist in (given[8], given[12]):
        assert_gradient(lambda x: transform_from_twist(x), twist)
        assert_gradient(twist_from_transform, transform_from_twist(twist))
    single = jax.jit(twist_from_transform)
    poses = maps[0](given)
    loop = jnp.stack([single(p) for p in poses])
    assert_close(maps[1](poses), loop, rtol=0.0, atol=1e-15)


def test_displacement_is_the_pose_error_with_the_angle():
    target, actual = jax.vmap(transform_from_twist)(twists([0.7, 1.9]))
    found = pose_difference(target, actual)
    sine = pose_error(target, actual)
    assert_close(found[:3], sine[:3], rtol=1e-15)
    angle = jnp.linalg.norm(found[3:])
    assert_close(found[3:] * jnp.sin(angle) / angle, sine[3:], rtol=1e-13)
    turned = rotation_from_vector(found[3:]) @ actual[:3, :3]
    assert_close(turned, target[:3, :3], rtol=0.0, atol=1e-14)
