"""Straight Cartesian paths and their inverse kinematics."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.signals import BesselFilter, Reference as SignalsReference
from elastax.trajectory import (
    PointToPoint,
    Reference,
    StraightPath,
    path_to_joints,
    rectangle,
)

from tests.helpers import assert_close, assert_gradient


LIMITS = (0.5, 3.0, 40.0)
LENGTHS = (0.9, 0.7)


# The path is an argument, so that the tests share one compilation per shape.
@eqx.filter_jit
def follow(path, t):
    """Position, velocity and acceleration at the times `t`."""
    return tuple(
        jax.vmap(law)(t) for law in (path.position, path.velocity, path.acceleration)
    )


@eqx.filter_jit
def slopes(path, t):
    """Time derivatives of position and velocity by autodiff."""
    return tuple(jax.vmap(jax.jacfwd(law))(t) for law in (path.position, path.velocity))


def figure_path():
    """A rectangle in the y-z plane, as in [Reiner2010] figure 6.5."""
    origin = np.array([0.9, 0.0, 0.5])
    return StraightPath(rectangle(origin, 0.4, 0.2, np.eye(3)[1:]), *LIMITS)


def planar_arm(q):
    """Tool of a planar 2R arm in the y-z plane."""
    first, both = q[0], q[0] + q[1]
    y = LENGTHS[0] * jnp.cos(first) + LENGTHS[1] * jnp.cos(both)
    z = LENGTHS[0] * jnp.sin(first) + LENGTHS[1] * jnp.sin(both)
    return jnp.array([0.9, y, z])


def planar_inverse(position):
    y, z = position[1], position[2]
    a, b = LENGTHS
    cosine = (y**2 + z**2 - a**2 - b**2) / (2 * a * b)
    elbow = jnp.arccos(cosine)
    wrist = jnp.arctan2(b * jnp.sin(elbow), a + b * jnp.cos(elbow))
    return jnp.array([jnp.arctan2(z, y) - wrist, elbow])


def test_rectangle():
    axes = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    points = rectangle(np.array([1.0, 2.0, 3.0]), 0.4, 0.2, axes)
    desired = [
        [1.0, 2.0, 3.0],
        [1.0, 2.24, 3.32],
        [1.2, 2.24, 3.32],
        [1.2, 2.0, 3.0],
        [1.0, 2.0, 3.0],
    ]
    assert_close(points, np.array(desired), rtol=1e-15)


def test_corners_are_met_at_rest():
    path = figure_path()
    corners = path.corner_times
    single = [
        float(PointToPoint([0.0], [d], *([limit] for limit in LIMITS)).duration)
        for d in (0.4, 0.2, 0.4, 0.2)
    ]
    assert_close(corners, np.concatenate([[0.0], np.cumsum(single)]), rtol=1e-14)
    assert_close(path.duration, corners[-1], rtol=0.0)
    places, speeds, _ = follow(path, corners)
    # The times of the corners are sums of rounded durations.
    assert_close(places, path.waypoints, rtol=0.0, atol=1e-15)
    assert_close(speeds, jnp.zeros((5, 3)), rtol=0.0, atol=1e-13)
    outside = follow(path, np.array([-1.0, 1e8]))[0]
    assert_close(outside, path.waypoints[jnp.array([0, 4])], rtol=0.0)


def test_edges_are_straight_and_within_limits():
    path = figure_path()
    t = np.linspace(0.0, float(path.duration), 2001)
    points, speed, force = jax.tree.map(np.asarray, follow(path, t))
    # One coordinate moves at a time, so that the points lie on the rectangle.
    y, z = points[:, 1] / 0.4, (points[:, 2] - 0.5) / 0.2
    on_edge = np.min(np.abs(np.stack([y, y - 1, z, z - 1])), axis=0)
    assert np.max(on_edge) < 1e-14
    speed = np.linalg.norm(speed, axis=1)
    force = np.linalg.norm(force, axis=1)
    assert np.max(speed) < 0.5 * (1 + 1e-12) and np.max(speed) > 0.5 * (1 - 1e-12)
    assert np.max(force) < 3.0 * (1 + 1e-12) and np.max(force) > 3.0 * (1 - 1e-2)
    middle = 0.31 + 0.7 * np.arange(4)
    desired = follow(path, middle)[1:]
    assert_close(slopes(path, middle), desired, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_repeated_waypoints():
    points = jnp.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    plain = StraightPath(points, *LIMITS)
    doubled = StraightPath(points[jnp.array([0, 0, 1, 1])], *LIMITS)
    assert_close(doubled.duration, plain.duration, rtol=1e-15)
    t = np.array([0.0, 0.2, 0.7, 9.0])
    places = follow(plain, t)[0]
    assert_close(follow(doubled, t)[0], places, rtol=1e-14, atol=1e-16)
    build = lambda points: StraightPath(points, *LIMITS).duration
    assert np.all(np.isfinite(jax.grad(build)(doubled.waypoints)))
    assert_close(StraightPath(points[:1].repeat(2, 0), *LIMITS).duration, 0.0, rtol=0.0)


@pytest.mark.slow
def test_jit_vmap_loop_and_gradient():
    path = figure_path()
    t = jnp.array([0.1, 1.2, 2.0, 3.0])
    loop = jnp.stack([path.position(time) for time in t])
    assert_close(follow(path, t)[0], loop, rtol=1e-14)
    run = lambda path, t: (path.duration, path.position(t))
    assert_gradient(run, path, jnp.asarray(1.3))


@pytest.mark.slow
def test_path_to_joints():
    path = figure_path()
    times = np.linspace(0.0, float(path.duration), 41)
    joints = path_to_joints(path, times, planar_inverse)
    points = jax.vmap(path.position)(times)
    assert_close(jax.vmap(planar_arm)(joints), points, rtol=1e-13, atol=1e-14)

    def newton(position, q):
        for _ in range(4):
            residual = (position - planar_arm(q))[1:]
            q = q + jnp.linalg.solve(jax.jacfwd(planar_arm)(q)[1:], residual)
        return q

    start = joints[0] + jnp.array([0.05, -0.05])
    followed = path_to_joints(path, times, newton, initial=start)
    assert_close(followed, joints, rtol=1e-11, atol=1e-12)
    traced = jax.jit(lambda times: path_to_joints(path, times, planar_inverse))
    assert_close(traced(times), joints, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
def test_way_to_a_reference():
    """Path, inverse kinematics and filter: the whole way of figure 6.5."""
    assert Reference is SignalsReference
    path = figure_path()
    times = 2e-3 * np.arange(int(float(path.duration) / 2e-3) + 2)
    joints = path_to_joints(path, times, planar_inverse)
    reference = Reference.from_samples(
        times, joints, filter=BesselFilter(5, 20.0), settle=0.3
    )
    places = np.asarray(jax.vmap(planar_arm)(reference.positions))
    # The filter acts on the axes: the corners are met, the edges are bent a little.
    assert_close(places[-1], path.waypoints[-1], rtol=0.0, atol=1e-12)
    y, z = places[:, 1], places[:, 2] - 0.5
    off_edge = np.min(np.abs(np.stack([y, y - 0.4, z, z - 0.2])), axis=0)
    assert 1e-6 < np.max(off_edge) < 2e-3


def test_refusals():
    points = jnp.zeros((3, 3))
    with pytest.raises(ValueError, match="`waypoints` must hold at least two"):
        StraightPath(points[:1], *LIMITS)
    with pytest.raises(ValueError, match="`waypoints`.* must have the shape"):
        StraightPath(points[:, :2], *LIMITS)
    with pytest.raises(ValueError, match="`waypoints` must be finite"):
        StraightPath(points.at[1, 1].set(jnp.nan), *LIMITS)
    with pytest.raises(ValueError, match="`max_acceleration` must be positive"):
        StraightPath(points, 1.0, -1.0, 1.0)
    with pytest.raises(ValueError, match="`axes` must be orthonormal"):
        rectangle(np.zeros(3), 1.0, 1.0, np.eye(3)[:2] + 0.1)
    with pytest.raises(ValueError, match="`origin` must have the shape"):
        rectangle(np.zeros(2), 1.0, 1.0, np.eye(3)[:2])
    far = StraightPath([[0.9, 0.5, 0.0], [0.9, 5.0, 0.0]], *LIMITS)
    with pytest.raises(ValueError, match="within reach.*sample 2"):
        path_to_joints(far, np.array([0.0, 0.5, 6.0, 7.0]), planar_inverse)
