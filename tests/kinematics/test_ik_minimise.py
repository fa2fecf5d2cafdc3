"""Inverse kinematics by minimisation, at singular poses."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    PoseResults,
    forward_kinematics,
    jacobian,
    minimise_pose,
    pose_difference,
    transform,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, puma


WRIST = jnp.array([0.3, -1.1, 1.3, 0.4, 0.0, -0.3])


@pytest.fixture(scope="module")
def find():
    chain = kuka()
    limits = dict(lower=jnp.full(6, -3.0), upper=jnp.full(6, 3.0))
    return jax.jit(lambda t, q: minimise_pose(chain, t, q, **limits, throw=False))


@pytest.mark.slow
@pytest.mark.parametrize("bend", [0.0, 1e-6, 1e-3])
def test_aligned_hand_axes(find, bend):
    """Axes 4 and 6 aligned, or nearly: reached, with a small change of the joints."""
    chain, pose = kuka(), WRIST.at[4].set(bend)
    near = pose + jnp.array([0.02, -0.01, 0.02, 0.03, 0.02, -0.02])
    found = find(forward_kinematics(chain, pose), near)
    assert found.result == PoseResults.successful
    assert found.position_error <= 1e-6 and found.rotation_error <= 1e-6
    # axes 4 and 6 share their sum, which is what the pose determines
    assert_close(found.value[:3], pose[:3], rtol=0.0, atol=1e-5)
    total = pose[3] + pose[5]
    assert_close(found.value[3] + found.value[5], total, rtol=0.0, atol=1e-5)
    assert jnp.linalg.norm(found.value - near) < 0.1
    assert found.smallest_singular_value < 2e-3


@pytest.mark.slow
def test_out_of_reach_is_the_nearest(find):
    """The arm stretches towards the target."""
    chain = kuka()
    stretched = jnp.zeros(6)
    pose = forward_kinematics(chain, stretched)
    target = pose.at[0, 3].add(0.05)
    found = find(target, stretched + 0.02)
    assert found.result != PoseResults.successful
    assert 0.0 < found.position_error <= 0.05
    # stationary: the gradient of the squared error
    actual = forward_kinematics(chain, found.value)
    slope = pose_difference(target, actual) @ jacobian(chain, found.value)
    # the search ends where steps of 1e-12 remain; it gets there by a constant factor
    assert_close(slope, jnp.zeros(6), rtol=0.0, atol=1e-8)


def test_limits_are_kept(find):
    chain = kuka()
    beyond = WRIST.at[0].set(3.1).at[4].set(0.5)
    found = find(forward_kinematics(chain, beyond), WRIST.at[0].set(2.9))
    assert jnp.all(jnp.abs(found.value) <= 3.0)
    assert found.result != PoseResults.successful


@pytest.mark.slow
def test_gradient_is_finite_at_singular_poses(find):
    chain = kuka()
    target = forward_kinematics(chain, WRIST)
    slopes = jax.jacfwd(lambda t: find(t, WRIST).value)(target)
    assert np.all(np.isfinite(slopes))


@pytest.mark.slow
def test_gradient():
    q = jnp.array([0.4, 0.3, -0.5, 0.6, 0.9, -0.2])
    goal = forward_kinematics(puma(), q)

    def function(joints, shift):
        target = transform(goal[:3, :3], goal[:3, 3] + shift)
        chain = dataclasses.replace(puma(), joints=joints)
        return minimise_pose(chain, target, q, neighbours=0).value

    # the minimisation stops at 1e-12
    assert_gradient(function, puma().joints, jnp.full(3, 0.01))


def test_refusals():
    chain, pose = kuka(), jnp.eye(4)
    with pytest.raises(ValueError, match="neighbours"):
        minimise_pose(chain, pose, WRIST, neighbours=-1)
    with pytest.raises(ValueError, match="lower"):
        minimise_pose(chain, pose, WRIST, lower=WRIST + 1, upper=WRIST)
