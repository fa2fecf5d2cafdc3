"""Aligned wrist axes: the published split, its optimality, paths through the pose."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SphericalWrist,
    WristWeights,
    forward_kinematics,
    inverse_kinematics,
    inverse_kinematics_path,
    select_branch,
)

from tests.helpers import assert_close, load_vectors
from tests.kinematics.arms import fanuc, kuka


WEIGHTS = WristWeights(2.0, 3.0)
poses_of = jax.jit(jax.vmap(forward_kinematics, (None, 0)))


@jax.jit
def solve(arm, pose, previous, weights):
    return inverse_kinematics(arm, pose, previous, wrist_weights=weights)


select = jax.jit(select_branch)


@jax.jit
def follow(arm, poses, start, weights):
    return inverse_kinematics_path(arm, poses, start, wrist_weights=weights)


def test_published_shares():
    case = load_vectors("004 singular configuration")[0]
    inputs, expected = case["inputs"], case["outputs"]
    weights = WristWeights(inputs["a"], inputs["b"])
    shares = weights.shares(jnp.array(inputs["D"]))
    assert_close(shares, (expected["d1"], expected["d2"]), rtol=case["tol"])


def test_shares_are_the_smallest():
    change = jnp.array(0.7)
    first, second = WEIGHTS.shares(change)
    assert_close(first + second, change, rtol=1e-15)
    cost = lambda x: 2.0 * x**2 + 3.0 * (change - x) ** 2
    assert_close(jax.grad(cost)(first), 0.0, rtol=0.0, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("bend", [0.0, np.pi], ids=["aligned", "opposed"])
@pytest.mark.parametrize("chain", [fanuc(1e-3), kuka()], ids=["fanuc", "kuka"])
def test_aligned_wrist_shares_the_turn(chain, bend):
    arm = SphericalWrist.from_chain(chain)
    before = jnp.array([0.3, 0.6, 0.4, 0.5, bend, -1.1])
    # the pose of another split: the sum, or the difference, has grown by 0.5
    pose = forward_kinematics(chain, before.at[5].add(0.5))
    solutions, valid = solve(arm, pose, before, WEIGHTS)
    q = select(solutions, valid, before)
    fourth, sixth = float(q[3] - before[3]), float(q[5] - before[5])
    sign = 1.0 if bend == 0.0 else -1.0
    assert_close((fourth, sixth), (sign * 0.3, 0.2), rtol=1e-9)
    reached = poses_of(chain, solutions)
    error = np.max(np.abs(np.asarray(reached - pose[None])), axis=(1, 2))
    # rounding of poses of order one
    assert np.max(error[np.asarray(valid)]) < 1e-12
    # without weights axis 4 rests
    rest = select(*solve(arm, pose, before, None), before)
    assert_close(rest[3], before[3], rtol=1e-12)
    # no other split costs less
    cost = lambda a, b: 2.0 * a**2 + 3.0 * b**2
    for shift in (-0.01, 0.01):
        assert cost(fourth + shift, sixth - sign * shift) > cost(fourth, sixth)


def test_elsewhere_the_weights_change_nothing():
    arm = SphericalWrist.from_chain(kuka())
    q = jnp.array([0.3, -0.6, 0.4, 0.5, 0.2, -1.1])
    pose = forward_kinematics(arm.chain, q)
    plain, weighted = solve(arm, pose, q, None), solve(arm, pose, q, WEIGHTS)
    assert_close(weighted, plain, rtol=0.0, atol=1e-14)


def test_extreme_weights():
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    before = jnp.array([0.3, -0.6, 0.4, 0.5, 0.0, -1.1])
    pose = forward_kinematics(chain, before.at[5].add(0.5))
    for weights, moved in ((WristWeights(0.0, 1.0), 3), (WristWeights(1.0, 0.0), 5)):
        q = select(*solve(arm, pose, before, weights), before)
        assert_close(q, before.at[moved].add(0.5), rtol=0.0, atol=1e-11)


@pytest.mark.slow
def test_turning_in_the_singular_pose_moves_both_axes():
    """The tool turns about its own axis with the wrist aligned all the way."""
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    start = jnp.array([0.3, -0.6, 0.4, 0.5, 0.0, -1.1])
    turns = jnp.linspace(0.0, 4.0, 41)
    path = start[None] + turns[:, None] * jnp.eye(6)[None, 5]
    q, valid = follow(arm, poses_of(chain, path), start, WEIGHTS)
    assert np.all(valid)
    expected = start[None] + turns[:, None] * jnp.array([[0, 0, 0, 0.6, 0, 0.4]])
    # the rounding of each step is kept by the next one
    assert_close(q, expected, rtol=0.0, atol=1e-10)


def through_the_singular_pose(samples):
    """Joint angles, poses and solution of a motion with axis 5 through zero."""
    chain = kuka()
    s = jnp.linspace(-1.0, 1.0, samples)
    start, rate = np.array([0.4, -1.1, 1.3, 0.3, 0, 0]), [0.5, 0.2, 0.1, 0, 0.4, 1.0]
    path = start[None] + s[:, None] * np.array(rate)[None]
    arm = SphericalWrist.from_chain(chain)
    poses = poses_of(chain, path)
    q, valid = follow(arm, poses, path[0], WEIGHTS)
    assert np.all(valid)
    return path, poses, q, chain


@pytest.mark.slow
def test_continuity_through_the_singular_pose():
    largest = []
    for samples in (41, 81, 161):
        path, poses, q, chain = through_the_singular_pose(samples)
        # the sample in the middle is singular, all poses are met
        assert abs(float(q[samples // 2, 4])) < 1e-10
        assert_close(poses_of(chain, q), poses, rtol=0.0, atol=1e-12)
        # the wrist passes without a flip
        assert float(q[0, 4]) < -0.3 and float(q[-1, 4]) > 0.3
        assert_close(q[-1], path[-1], rtol=0.0, atol=1e-10)
        largest.append(np.max(np.abs(np.diff(np.asarray(q), axis=0))))
    # halving the step halves the largest change: no jump is left
    assert_close(largest[0] / largest[1], 2.0, rtol=0.05)
    assert_close(largest[1] / largest[2], 2.0, rtol=0.05)


@pytest.mark.slow
def test_paths_in_one_call():
    """Whole paths, one start each, as a batch and as a loop."""
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    s = jnp.linspace(0.0, 1.0, 21)
    starts = jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (8, 6)))
    starts = starts + jnp.array([[0, -1.0, 1.4, 0, 0, 0]])
    rates = jnp.asarray(np.random.default_rng(1).uniform(-0.4, 0.4, (8, 6)))
    paths = starts[:, None] + s[None, :, None] * rates[:, None]
    poses = jax.vmap(poses_of, (None, 0))(chain, paths)
    batch = jax.jit(jax.vmap(inverse_kinematics_path, (None, 0, 0)))
    q, valid = batch(arm, poses, starts)
    assert np.all(valid)
    # over the smallest sine of axis 5 on these paths
    assert_close(q, paths, rtol=0.0, atol=1e-9)
    one, _ = jax.jit(inverse_kinematics_path)(arm, poses[3], starts[3])
    assert_close(q[3], one, rtol=0.0, atol=1e-13)


def test_gradients_stay_finite():
    arm = SphericalWrist.from_chain(kuka())
    q = jnp.array([0.3, -0.6, 0.4, 0.5, 0.0, -1.1])
    pose = forward_kinematics(arm.chain, q.at[5].add(0.5))
    slopes = jax.jit(jax.jacrev(lambda w, x: solve(arm, x, q, w)[0], (0, 1)))
    by_weights, by_pose = slopes(WEIGHTS, pose)
    assert np.all(np.isfinite(by_pose))
    # delta_6 = a D / (a + b), hence b D / (a + b)^2 and -a D / (a + b)^2, D = 0.5
    assert_close(by_weights.axis_4[0, 5], 3 * 0.5 / 25, rtol=1e-9)
    assert_close(by_weights.axis_6[0, 5], -2 * 0.5 / 25, rtol=1e-9)


def test_refusals():
    with pytest.raises(ValueError, match="`axis_4` must not be negative"):
        WristWeights(-1.0, 2.0)
    with pytest.raises(ValueError, match="`axis_6` must not be negative"):
        WristWeights(1.0, -2.0)
    with pytest.raises(ValueError, match="must not both be zero"):
        WristWeights(0.0, 0.0)
