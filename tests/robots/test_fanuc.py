"""The Fanuc arm: table, machine zero, senses, and every branch of 10,000 poses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SphericalWrist,
    forward_kinematics,
    inverse_kinematics,
    moving_frames,
)
from elastax.robots import fanuc, planar_2r

from tests.helpers import assert_close, load_vectors
from tests.kinematics.arms import turned


@pytest.fixture(scope="module")
def arm():
    return fanuc()


def test_machine_zero(arm):
    case = load_vectors("003 Tab 3-5")[0]
    q = arm.from_maker(arm.poses["zero"])
    assert_close(q, case["inputs"]["theta_DH"], rtol=0.0, atol=1e-12)
    pose = np.array(case["outputs"]["T06"])
    pose[:3, 3] *= 1e-3  # mm
    assert_close(forward_kinematics(arm.chain, q), pose, rtol=0.0, atol=case["tol"])
    wrist = moving_frames(arm.chain, q).position[4]
    centre = 1e-3 * np.array(case["outputs"]["WCP"])
    assert_close(wrist, centre, rtol=0.0, atol=case["tol"])


@pytest.mark.parametrize("case", load_vectors("003 (3-45)-(3-97)"), ids="12")
def test_published_poses(arm, case):
    pose = np.array(case["outputs"]["T06"])
    pose[:3, 3] *= 1e-3  # mm
    q = jnp.array(case["inputs"]["theta"])
    assert_close(forward_kinematics(arm.chain, q), pose, rtol=0.0, atol=case["tol"])


def test_limits_hold_the_named_poses_and_the_maker_sees_them(arm):
    for pose in arm.poses.values():
        q = arm.from_maker(pose)
        assert np.all((arm.lower <= q) & (q <= arm.upper))
        assert_close(arm.to_maker(q), pose, rtol=0.0, atol=1e-15)
    assert_close(np.rad2deg(arm.to_maker(arm.lower)[1]), -76.0, rtol=1e-12)
    assert_close(np.rad2deg(arm.to_maker(arm.upper)[1]), 60.0, rtol=1e-12)
    # senses, coupling, limits: what the text does not give
    assert len(arm.assumptions) == 3


def test_tool_down(arm):
    pose = forward_kinematics(arm.chain, arm.from_maker(arm.poses["tool down"]))
    assert_close(pose[:3, 2], [0.0, 0.0, -1.0], rtol=0.0, atol=1e-15)
    assert_close(pose[:3, 3], [1.592, 0.0, 1.3 - 0.215], rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_every_branch_of_many_poses(arm):
    """10,000 random reachable poses, all branches, in one call."""
    wrist = SphericalWrist.from_chain(arm.chain)
    q = jnp.asarray(np.random.default_rng(0).uniform(-np.pi, np.pi, (10_000, 6)))

    @jax.jit
    def check(wrist, q):
        def one(q):
            pose = forward_kinematics(wrist.chain, q)
            solutions, valid = inverse_kinematics(wrist, pose)
            again = jax.vmap(forward_kinematics, (None, 0))(wrist.chain, solutions)
            shift = jnp.sqrt(jnp.sum((again[:, :3, 3] - pose[None, :3, 3]) ** 2, -1))
            # |R - R_0|_F = sqrt(8) sin(angle / 2): the angle from below its rounding
            turn = again[:, :3, :3] - pose[None, :3, :3]
            angle = jnp.sqrt(jnp.sum(turn**2, (1, 2)) / 2)
            return solutions, valid, shift, angle

        return jax.vmap(one)(q)

    solutions, valid, shift, angle = map(np.asarray, check(wrist, q))
    assert np.all(np.isfinite(solutions))
    # four solutions always, eight where the arm reaches over its back
    assert set(np.unique(np.sum(valid, axis=1))) == {4, 8}
    assert np.max(shift[valid]) < 1e-9
    assert np.max(angle[valid]) < 1e-10
    # the angles it started from are among them
    distance = np.abs(np.asarray(turned(solutions, q[:, None]) - q[:, None]))
    nearest = np.min(np.where(valid, np.max(distance, axis=2), np.inf), axis=1)
    # rounding over the distance from the nearest singular pose of the batch
    assert np.max(nearest) < 1e-7


@pytest.mark.slow
def test_poses_out_of_reach_are_masked(arm):
    """Twice as far as the arm reaches: no branch, no NaN."""
    wrist = SphericalWrist.from_chain(arm.chain)
    q = jnp.asarray(np.random.default_rng(1).uniform(-np.pi, np.pi, (1000, 6)))
    poses = jax.vmap(forward_kinematics, (None, 0))(arm.chain, q)
    directions = poses[:, :3, 0]
    far = poses.at[:, :3, 3].set(6.0 * directions)
    solutions, valid = jax.jit(jax.vmap(inverse_kinematics, (None, 0)))(wrist, far)
    assert not np.any(valid)
    assert np.all(np.isfinite(solutions))


def test_planar_2r():
    arm = planar_2r()
    pose = forward_kinematics(arm.chain, arm.from_maker(arm.poses["square"]))
    assert_close(pose[:3, 3], [1.0, 0.7, 0.0], rtol=1e-15)
    assert_close(planar_2r(0.8, 0.5).chain.joints.a, [0.8, 0.5], rtol=0.0)
    assert arm.chain.number == 2 and arm.assumptions
