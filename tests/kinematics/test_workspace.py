"""Maps of the workspace against closed forms of simple arms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SphericalWrist,
    forward_kinematics,
    joint_grid,
    manipulability,
    pose_quality,
    random_joints,
    reachable_points,
    rotation_y,
    sampled_section,
    scaled_jacobian,
    section_map,
    section_points,
    transform,
)

from tests.helpers import assert_close
from tests.kinematics.arms import kuka, planar


@pytest.fixture(scope="module")
def arm():
    return SphericalWrist.from_chain(kuka(wrist_height=0.0))


def wide(limit=np.pi):
    return jnp.full(6, -limit), jnp.full(6, limit)


def test_grid_and_samples_of_joints():
    lower, upper = jnp.array([-1.0, 0.0, 2.0]), jnp.array([1.0, 2.0, 4.0])
    grid = joint_grid(lower, upper, (3, 2, 1))
    expected = [[a, b, 3.0] for a in (-1.0, 0, 1) for b in (0.0, 2)]
    assert_close(grid, np.array(expected), rtol=1e-15)
    samples = random_joints(lower, upper, 1000, key=jax.random.key(0))
    assert np.all((samples >= lower[None]) & (samples <= upper[None]))
    # a uniform mean is known to 0.6 / sqrt(1000)
    assert_close(samples.mean(axis=0), (lower + upper) / 2, rtol=0.0, atol=0.08)
    with pytest.raises(ValueError, match="`counts` must be a positive number"):
        joint_grid(lower, upper, (3, 2))
    with pytest.raises(ValueError, match="`counts` must be a positive number"):
        joint_grid(lower, upper, (3, 0, 1))


def test_points_are_in_the_ring():
    chain, limit = planar(0.5, 0.4), jnp.full(2, np.pi)
    q = random_joints(-limit, limit, 500, key=jax.random.key(1))
    points = jax.jit(reachable_points)(chain, q)
    radius = jnp.linalg.norm(points[:, :2], axis=1)
    assert float(radius.min()) > 0.1 and float(radius.max()) < 0.9
    one = forward_kinematics(chain, q[7])[:3, 3]
    assert_close(points[7], one, rtol=1e-14, atol=1e-15)


@pytest.mark.slow
def test_section_of_a_wrist(arm):
    """Reachable where the wrist centre is between the two circles of the arm."""
    corner = jnp.array([0.1, 0.0, -1.4])
    first, second = jnp.array([2.2, 0, 0]), jnp.array([0, 0, 3.6])
    points = section_points(corner, first, second, (12, 16))
    assert_close(points[-1, -1], corner + first + second, rtol=1e-15)
    assert_close(points[1, 2] - points[0, 0], first / 11 + 2 * second / 15, rtol=1e-14)
    level = rotation_y(jnp.array(np.pi / 2))
    found = jax.jit(lambda p: section_map(arm, level, p, *wide(), manipulability))(
        points
    )
    wrist = np.asarray(points) - [0.115, 0.0, 0.0]
    upper, fore = 0.68, 0.67
    near = np.hypot(wrist[..., 0] - 0.26, wrist[..., 2] - 0.675)
    far = np.hypot(-wrist[..., 0] - 0.26, wrist[..., 2] - 0.675)
    inside = lambda r: (r < upper + fore) & (r > abs(upper - fore))
    expected = 4 * (inside(near).astype(int) + inside(far).astype(int))
    assert_close(found.branches, expected, rtol=0.0)
    assert np.all((np.asarray(found.value) > 0) == (expected > 0))
    # without limits the wrist may flip, so that branches come in fours
    assert expected.max() == 8 and expected.min() == 0


@pytest.mark.slow
def test_limits_and_whole_turns(arm):
    """A pose counts if one branch, but for whole turns, is within the limits."""
    q = jnp.array([0.3, -1.1, 1.4, 0.4, 0.8, -0.6])
    pose = forward_kinematics(arm.chain, q)
    quality = jax.jit(
        lambda low, high: pose_quality(arm, pose, low, high, manipulability)
    )
    around = quality(q - 0.01, q + 0.01)
    assert int(around.branches) == 1
    expected = manipulability(scaled_jacobian(arm.chain, q))
    assert_close(around.value, expected, rtol=1e-10)
    turned = jnp.array([0, 0, 0, 2 * np.pi, 0, -4 * np.pi])
    assert int(quality(q + turned - 0.01, q + turned + 0.01).branches) == 1
    assert int(quality(q + 0.01, q + 0.02).branches) == 0
    assert float(quality(q + 0.01, q + 0.02).value) == 0.0
    everything = quality(*wide())
    assert int(everything.branches) == 4 and float(everything.value) >= float(expected)


def test_sampled_section_counts_every_point_once():
    points = jnp.array(
        [[0.5, 0.0, 0.5], [0.5, 0.02, 0.6], [1.5, 0.0, 0.5], [0.5, 0.2, 0.5], [3, 0, 0]]
    )
    values = jnp.array([1.0, 2.0, 3.0, 9.0, 9.0])
    corner, first, second = jnp.zeros(3), jnp.array([2.0, 0, 0]), jnp.array([0, 0, 1.0])
    found = jax.jit(
        lambda p, v: sampled_section(p, v, corner, first, second, (2, 1), 0.1)
    )(points, values)
    assert_close(found.counts, np.array([[2], [1]]), rtol=0.0)
    assert_close(found.best, jnp.array([[2.0], [3.0]]), rtol=0.0)


@pytest.mark.slow
def test_section_from_samples_is_the_ring():
    """Cells well inside the ring of a planar arm are hit, those outside never."""
    chain, limit = planar(0.5, 0.4), jnp.full(2, np.pi)
    q = joint_grid(-limit, limit, (200, 100))
    points = jax.jit(reachable_points)(chain, q)
    corner, first, second = (
        jnp.array(x) for x in ([-1.0, -1, 0], [2.0, 0, 0], [0, 2.0, 0])
    )
    section = sampled_section(
        points, jnp.ones(20000), corner, first, second, (20, 20), 0.1
    )
    middle = -0.95 + 0.1 * np.arange(20)
    radius = np.hypot(*np.meshgrid(middle, middle, indexing="ij"))
    half = 0.1 / np.sqrt(2)  # from the middle of a cell to its corner
    counts = np.asarray(section.counts)
    assert np.all(counts[(radius > 0.1 + half) & (radius < 0.9 - half)] > 0)
    assert np.all(counts[(radius > 0.9 + half) | (radius < 0.1 - half)] == 0)
    assert counts.sum() == 20000


@pytest.mark.slow
def test_gradient_by_the_pose(arm):
    """The best measure is differentiable where it can be reached, zero elsewhere."""
    low, high = wide()
    value = lambda p: (
        pose_quality(arm, transform(jnp.eye(3), p), low, high, manipulability).value
    )
    slope = jax.jit(jax.vmap(jax.grad(value)))
    inside, outside = jnp.array([0.9, 0.3, 0.8]), jnp.array([5.0, 0.0, 0.0])
    found = slope(jnp.stack([inside, outside]))
    step = 1e-5 * jnp.eye(3)
    values = jax.jit(jax.vmap(value))(
        jnp.concatenate([inside[None] + step, inside[None] - step])
    )
    # central difference of a measure of order one
    expected = (values[:3] - values[3:]) / 2e-5
    assert_close(found, jnp.stack([expected, jnp.zeros(3)]), rtol=1e-6, atol=1e-8)
