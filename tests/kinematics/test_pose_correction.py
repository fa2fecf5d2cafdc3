"""Newton's corrections: the pose is met, derivatives are those of the inverse."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DeformableArm,
    correct_pose,
    forward_kinematics,
    jacobian,
    pose_error,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, mixed, planar, puma


Q = jnp.array([0.3, -1.0, 0.8, 0.5, 0.9, -0.4])
NOTHING = jnp.zeros(0)
solve = jax.jit(correct_pose, static_argnames=("axes", "rows", "steps", "tolerance"))


@pytest.fixture(scope="module")
def arm():
    return DeformableArm.rigid(puma())


@pytest.mark.slow
def test_rigid_arm_is_the_chain(arm):
    pose, matrix = arm.tool(Q, NOTHING)
    assert_close(pose, forward_kinematics(arm.chain, Q), rtol=0.0, atol=1e-15)
    assert_close(matrix, jacobian(arm.chain, Q), rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_each_step_squares_the_error(arm):
    target = forward_kinematics(arm.chain, Q + 0.05)
    errors = []
    for steps in range(5):
        solution = solve(arm, target, Q, NOTHING, steps=steps, largest_step=1.0)
        errors.append(float(solution.position_error))
        wanted = pose_error(target, forward_kinematics(arm.chain, solution.value))
        size = jnp.linalg.norm(wanted[:3])
        assert_close(solution.position_error, size, rtol=1e-6, atol=1e-15)
    assert errors[0] > 1e-2
    for before, after in zip(errors[:3], errors[1:4], strict=True):
        # a constant of the order of one over the smallest singular value, and rounding
        assert after < 20 * before**2 + 1e-14
    assert errors[4] < 1e-14
    assert bool(solution.reached)
    assert_close(solution.value, Q + 0.05, rtol=0.0, atol=1e-13)


def test_one_common_factor_keeps_the_direction(arm):
    """[Reiner2010] (3.58): the largest change meets the limit, all shrink alike."""
    target = forward_kinematics(arm.chain, Q + jnp.linspace(0.1, 0.4, 6))
    free = solve(arm, target, Q, NOTHING, steps=1, largest_step=10.0).value - Q
    limited = solve(arm, target, Q, NOTHING, steps=1, largest_step=0.05).value - Q
    assert_close(jnp.max(jnp.abs(limited)), 0.05, rtol=1e-12)
    assert_close(limited, free * 0.05 / jnp.max(jnp.abs(free)), rtol=1e-9)


def test_fewer_axes_give_the_least_error(arm):
    """With axis 3 at rest the weighted error cannot be reduced any further."""
    target = forward_kinematics(arm.chain, Q + 0.01)
    axes = (0, 1, 3, 4, 5)
    solution = solve(arm, target, Q, NOTHING, axes=axes, steps=8)
    assert not bool(solution.reached)
    assert_close(solution.value[2], Q[2], rtol=0.0)
    error = pose_error(target, forward_kinematics(arm.chain, solution.value))
    slope = jacobian(arm.chain, solution.value)[:, np.array(axes)].T @ error
    # the Jacobian changes by the error along the way: second order in it
    assert np.max(np.abs(slope)) < 10 * float(solution.position_error) ** 2
    assert 1e-4 < float(solution.position_error) < 1e-2


def test_positions_alone(arm):
    target = forward_kinematics(arm.chain, Q + 0.02)
    solution = solve(arm, target, Q, NOTHING, axes=(0, 1, 2), rows=(0, 1, 2))
    assert bool(solution.reached) and float(solution.rotation_error) == 0.0
    assert_close(solution.value[3:], Q[3:], rtol=0.0)
    actual = forward_kinematics(arm.chain, solution.value)
    assert_close(actual[:3, 3], target[:3, 3], rtol=0.0, atol=1e-13)


def test_elastic_coordinates_and_followers():
    """Joints that share an elastic coordinate by a factor, as end slopes do."""
    # axis, bending hinge, its end slope, axis, axis
    coupling = np.zeros((5, 4))
    coupling[[0, 3, 4], [0, 1, 2]] = 1.0
    coupling[[1, 2], [3, 3]] = 1.0, 0.5
    arm = DeformableArm(planar(0.5, 0.4, 0.3, 0.3, 0.2), coupling, (0, 3, 4))
    q, eta = jnp.array([0.3, -0.7, 0.9]), jnp.array([0.01])
    wanted = forward_kinematics(arm.chain, jnp.array([0.3, 0.01, 0.005, -0.7, 0.9]))
    assert_close(arm.tool(q, eta)[0], wanted, rtol=0.0, atol=1e-15)
    target = arm.tool(q, jnp.zeros(1))[0]
    # position in the plane and direction: three rows for three axes
    rows = (0, 1, 5)
    solution = solve(arm, target, q, eta, rows=rows)
    assert bool(solution.reached)
    actual = arm.tool(solution.value, eta)[0]
    assert_close(actual, target, rtol=0.0, atol=1e-13)
    # the deformation is 15 mrad in all; the axes make up for it
    assert_close(jnp.sum(solution.value - q), -0.015, rtol=0.0, atol=1e-13)


def test_prismatic_joints():
    arm = DeformableArm.rigid(mixed())
    q = jnp.array([0.3, 0.2, -0.5, 0.1, 0.7])
    target = forward_kinematics(arm.chain, q + 0.02)
    solution = solve(arm, target, q, NOTHING)
    assert bool(solution.reached)
    assert_close(solution.value, q + 0.02, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_derivative_is_the_inverse_jacobian(arm, derivative):
    def roundtrip(x):
        target = forward_kinematics(arm.chain, x)
        return correct_pose(arm, target, Q, NOTHING).value

    matrix = jax.jit(derivative(roundtrip))(Q + 0.01)
    # damping of the solver, 1e-13 over the squared smallest singular value
    assert_close(matrix, jnp.eye(6), rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_gradient_by_parameters_and_deformations():
    chain = kuka()
    coupling = np.concatenate([np.eye(6), np.eye(6)[:, [1, 2]]], axis=1)
    eta = jnp.array([2e-3, -1e-3])
    target = forward_kinematics(chain, Q)

    def function(positions, eta, resting):
        joints = type(chain.joints)(chain.joints.rotation, positions, chain.joints.axis)
        moved = type(chain)(joints, chain.base, chain.tool, chain.kinds)
        arm = DeformableArm(moved, coupling, (0, 1, 2, 3, 4, 5))
        start = Q.at[3].set(resting)
        rows, axes = (0, 1, 2, 4, 5), (0, 1, 2, 4, 5)
        return correct_pose(arm, target, start, eta, axes=axes, rows=rows).value

    assert_gradient(function, chain.joints.position, eta, Q[3])


@pytest.mark.slow
def test_singular_pose_stays_finite():
    """Wrist aligned: the Jacobian has no inverse."""
    arm = DeformableArm.rigid(kuka())
    q = Q.at[4].set(0.0)
    pose = forward_kinematics(arm.chain, q)
    target = pose.at[1, 3].add(1e-3)

    def value(target):
        return correct_pose(arm, target, q, NOTHING).value

    solution = solve(arm, target, q, NOTHING)
    assert np.all(np.isfinite(solution.value))
    assert np.max(np.abs(solution.value - q)) <= 4 * 0.1 + 1e-12
    for derivative in (jax.jacfwd, jax.jacrev):
        assert np.all(np.isfinite(jax.jit(derivative(value))(target)))


def test_out_of_reach_is_reported(arm):
    target = forward_kinematics(arm.chain, Q).at[0, 3].add(5.0)
    solution = solve(arm, target, Q, NOTHING)
    assert not bool(solution.reached)
    assert float(solution.position_error) > 3.0
    assert np.all(np.isfinite(solution.value))


def test_half_a_turn_is_no_solution(arm):
    """The error vector vanishes there as well."""
    pose = forward_kinematics(arm.chain, Q)
    half = pose.at[:3, :3].set(pose[:3, :3] @ jnp.diag(jnp.array([1.0, -1.0, -1.0])))
    solution = solve(arm, half, Q, NOTHING, steps=0)
    assert not bool(solution.reached)


def test_jit_vmap_and_loop_agree(arm):
    targets = jnp.stack([forward_kinematics(arm.chain, Q + s) for s in (0.01, 0.03)])
    batch = jax.jit(jax.vmap(lambda t: correct_pose(arm, t, Q, NOTHING)))(targets)
    for k in range(2):
        one = solve(arm, targets[k], Q, NOTHING)
        assert_close(batch.value[k], one.value, rtol=1e-13)
        assert bool(batch.reached[k]) == bool(one.reached)


def test_refusals(arm):
    target = forward_kinematics(arm.chain, Q)
    with pytest.raises(ValueError, match="`axes` must be distinct indices from 0 to 5"):
        correct_pose(arm, target, Q, NOTHING, axes=(0, 6))
    with pytest.raises(ValueError, match="`rows` must be distinct indices from 0 to 5"):
        correct_pose(arm, target, Q, NOTHING, rows=(1, 1))
    with pytest.raises(ValueError, match="`steps` must not be negative"):
        correct_pose(arm, target, Q, NOTHING, steps=-1)
    with pytest.raises(ValueError, match="`coupling` must have one row per joint"):
        DeformableArm(arm.chain, np.eye(5), (0, 1, 2, 3, 4))
