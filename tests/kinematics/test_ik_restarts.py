"""Inverse kinematics from many starts."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    Arm,
    PoseSearch,
    SearchResults,
    SerialChain,
    find_pose,
    forward_kinematics,
    rotation_from_vector,
    transform,
)
from elastax.kinematics._starts import low_discrepancy
from elastax.robots import iiwa14, kr210, ur10e

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import mixed, puma


TOLERANCE = 1e-6  # m and rad


def kr210_arm() -> Arm:
    """Chain and limits of the rigid KR210."""
    robot = kr210().rigid()
    ends = [robot.from_maker(x) for x in (robot.limits.lower, robot.limits.upper)]
    return arm_of(robot.chain, jnp.minimum(*ends), jnp.maximum(*ends))


def arm_of(chain: SerialChain, lower, upper) -> Arm:
    n = chain.number
    names = tuple(f"A{k}" for k in range(1, n + 1))
    one = np.ones(n)
    return Arm(chain, lower, upper, one, one, 0 * one, {}, "arm", names)


ARMS = {"kr210": kr210_arm, "ur10e": ur10e, "iiwa14": iiwa14}


@jax.jit
def tool_poses(chain, q):
    return jax.vmap(lambda x: forward_kinematics(chain, x))(q)


@jax.jit
def find_all(arm, targets):
    return jax.vmap(lambda t: find_pose(arm, t, throw=False))(targets)


def random_targets(arm, count, seed=0):
    rng = np.random.default_rng(seed)
    shape = count, arm.chain.number
    q = rng.uniform(np.asarray(arm.lower), np.asarray(arm.upper), shape)
    return tool_poses(arm.chain, jnp.asarray(q))


def solved(arm, q, targets):
    """Which targets are reached within the limits, judged from the poses alone."""
    actual, targets = (
        np.asarray(tool_poses(arm.chain, jnp.asarray(q))),
        np.asarray(targets),
    )
    distance = np.linalg.norm(actual[:, :3, 3] - targets[:, :3, 3], axis=1)
    # the chord 2 sqrt(2) sin(angle / 2) of the rotation matrices
    chord = np.linalg.norm(actual[:, :3, :3] - targets[:, :3, :3], axis=(1, 2))
    q, lower, upper = (np.asarray(x) for x in (q, arm.lower, arm.upper))
    inside = ((q >= lower) & (q <= upper)).all(axis=1)
    # rounding of the other order of operations
    near = (distance < TOLERANCE + 1e-14) & (chord / math.sqrt(2) < TOLERANCE + 1e-14)
    return near & inside


@pytest.fixture(scope="module")
def searched():
    arm = kr210_arm()
    targets = random_targets(arm, 500)
    return arm, targets, find_all(arm, targets)


def test_500_targets(searched):
    arm, targets, found = searched
    reached = solved(arm, found.value, targets)
    assert np.array_equal(reached, found.reached)
    assert reached.sum() >= 500  # all of them: 0.1 % of 500 is less than one
    assert found.starts.min() == 1 and found.starts.max() <= 32
    assert np.all(found.steps >= found.starts - 1)
    assert found.position_error.max() <= TOLERANCE
    assert found.rotation_error.max() <= TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_10000_targets(name):
    """Acceptance: at least 99.9 % with up to 32 starts."""
    arm = ARMS[name]()
    targets = random_targets(arm, 10_000, seed=1)
    found = find_all(arm, targets)
    reached = solved(arm, found.value, targets)
    assert np.array_equal(reached, found.reached)
    assert reached.mean() >= 0.999


def test_batch_is_loop(searched):
    arm, targets, found = searched
    one = jax.jit(lambda a, t: find_pose(a, t, throw=False))
    for k in np.argsort(found.starts)[[0, 250, 499]]:  # few starts and many
        alone = one(arm, targets[k])
        assert int(alone.starts) == int(found.starts[k])
        assert int(alone.steps) == int(found.steps[k])
        # rounding over the smallest singular value
        assert_close(alone.value, found.value[k], rtol=0.0, atol=1e-6)


def test_other_devices_search_side_by_side(searched):
    """The loop over lanes that graphics cards run finds the same."""
    from elastax.kinematics import _ik_restarts

    arm, targets, found = searched
    chain, limits = arm.chain, jnp.stack([arm.lower, arm.upper])
    settings = (PoseSearch(), *map(jnp.array, (1.0, 1e-6, 1e-6)))
    settings = *settings, jnp.ones(6), jnp.array(32.0)

    def lanes(targets):
        def one(target):
            start = _ik_restarts._start(chain, limits, jnp.zeros(()))
            args = *_ik_restarts.without_base(chain, target), start, limits, settings
            return _ik_restarts._Lane.unpacked(_ik_restarts._search(*args))

        return jax.vmap(one)(targets)

    lane = jax.jit(lanes)(targets[:40])
    assert np.all(lane.reached == 1)
    assert np.array_equal(lane.start + 1, found.starts[:40])
    assert np.array_equal(lane.total, found.steps[:40])
    # rounding over the smallest singular value, which some poses come close to
    assert_close(lane.best, found.value[:40], rtol=0.0, atol=1e-6)


def test_first_start_and_its_turn(searched):
    """A given posture goes first, and its turns are kept."""
    arm = searched[0]
    find = jax.jit(lambda t, q: find_pose(arm, t, q))
    for q4 in (-340.0, -20.0, 340.0):  # the limits are +-350 deg
        q = jnp.deg2rad(jnp.array([20.0, -70.0, 80.0, q4, 60.0, 200.0]))
        target = forward_kinematics(arm.chain, q)
        found = find(target, q + 0.05)
        assert found.starts == 1 and found.steps <= 8
        assert_close(found.value, q, rtol=0.0, atol=1e-4)


@pytest.mark.slow
def test_out_of_reach():
    arm = ur10e()
    target = transform(jnp.eye(3), jnp.array([5.0, 0.0, 0.0]))
    found = jax.jit(lambda t: find_pose(arm, t, starts=5, throw=False))(target)
    assert found.result == SearchResults.not_found and not found.reached
    assert found.starts == 5 and np.all(np.isfinite(found.value))
    # 5 m less the reach of 1.3 m
    assert 3.5 < found.position_error < 4.5
    with pytest.raises(Exception, match="no start reached"):
        jax.jit(lambda t: find_pose(arm, t, starts=2))(target)


@pytest.mark.slow
def test_sliding_joints_with_tilted_axes():
    chain = mixed()
    arm = arm_of(chain, np.full(5, -1.5), np.full(5, 1.5))
    targets = random_targets(arm, 20)
    found = find_all(arm, targets)
    assert np.all(solved(arm, found.value, targets))


@pytest.mark.slow
def test_position_only():
    """Seven joints, three rows: poses out of reach, but not their points."""
    arm = iiwa14()
    targets = random_targets(arm, 20)
    turned = targets.at[:, :3, :3].set(jnp.eye(3))
    find = jax.jit(lambda a, t: jax.vmap(lambda x: find_pose(a, x, rows=(0, 1, 2)))(t))
    found = find(arm, turned)
    actual = tool_poses(arm.chain, found.value)
    distance = jnp.linalg.norm((actual - turned)[:, :3, 3], axis=1)
    assert distance.max() <= TOLERANCE and np.all(found.reached)
    inside = (found.value >= arm.lower[None]) & (found.value <= arm.upper[None])
    assert np.all(inside)


@pytest.mark.slow
def test_gradient():
    """The implicit function of a square arm."""
    chain = puma()
    q = jnp.array([0.4, 0.3, -0.5, 0.6, 0.9, -0.2])
    goal = forward_kinematics(chain, q)
    arm = arm_of(chain, np.full(6, -3.0), np.full(6, 3.0))

    def function(joints, vector):
        rotation = rotation_from_vector(vector[3:])
        target = transform(rotation @ goal[:3, :3], goal[:3, 3] + vector[:3])
        moved = dataclasses.replace(chain, joints=joints)
        return find_pose(
            dataclasses.replace(arm, chain=moved),
            target,
            q,
            position_tolerance=1e-12,
            rotation_tolerance=1e-12,
        ).value

    assert_gradient(function, chain.joints, jnp.full(6, 0.05))


def test_gradient_of_a_batch_and_at_a_singular_pose(searched):
    arm, targets, _ = searched
    aligned = jnp.deg2rad(jnp.array([20.0, -70.0, 80.0, 30.0, 0.0, 20.0]))
    singular = forward_kinematics(arm.chain, aligned)
    poses = jnp.stack([targets[0], singular, targets[1].at[0, 3].add(10.0)])

    def total(poses):
        found = jax.vmap(lambda t: find_pose(arm, t, starts=4, throw=False))(poses)
        return jnp.sum(found.value)

    # the last one is out of reach
    assert np.all(np.isfinite(jax.jit(jax.grad(total))(poses)))


def test_sequence_fills_the_cube():
    points = low_discrepancy(2, np.arange(1.0, 65.0))
    assert_close(low_discrepancy(2, 3.0), points[2], rtol=1e-14)
    assert np.all((points >= 0) & (points < 1))
    # each of 16 squares holds its share of four, give or take two
    counts, *_ = np.histogram2d(*np.asarray(points).T, bins=4, range=[[0, 1]] * 2)
    assert counts.min() >= 2 and counts.max() <= 6
    golden = (math.sqrt(5) - 1) / 2
    assert_close(low_discrepancy(1, 1.0), [golden], rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (dict(gain=0.0), "gain"),
        (dict(progress=1.5), "progress"),
        (dict(slack=0.5), "slack"),
        (dict(max_steps=0), "max_steps"),
    ],
)
def test_search_refuses(options, what):
    with pytest.raises(ValueError, match=what):
        PoseSearch(**options)


def test_refusals():
    with pytest.raises(ValueError, match="starts"):
        find_pose(ur10e(), jnp.eye(4), starts=0)
    with pytest.raises(ValueError, match="rows"):
        find_pose(ur10e(), jnp.eye(4), rows=(1, 1))
