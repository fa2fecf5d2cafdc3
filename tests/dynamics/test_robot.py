"""The kinematic records of an elastic robot."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import SphericalWrist, forward_kinematics
from elastax.robots import kr210

from tests.helpers import assert_close


@pytest.fixture(scope="module")
def robot():
    return kr210()


def test_arm_has_the_limits_of_the_maker(robot):
    arm = robot.arm()
    assert np.all(np.asarray(arm.lower < arm.upper))
    # axis 1 is counted backwards: its limits change places
    assert float(arm.signs[0]) == -1.0
    for k in range(6):
        ends = sorted([float(arm.to_maker(x)[k]) for x in (arm.lower, arm.upper)])
        wanted = [float(robot.limits.lower[k]), float(robot.limits.upper[k])]
        # an angle passes through a product and a sum each way
        assert_close(ends, wanted, rtol=1e-14)


def test_limits_with_unequal_ends(robot):
    """Only here swapped ends show: the KR210's axis 1 has equal ones."""
    lower = robot.limits.lower.at[0].set(-1.0)
    shifted = eqx.tree_at(
        lambda r: (r.limits.lower, r.axis_zeros), robot, (lower, jnp.full(6, 0.2))
    )
    arm = shifted.arm()
    upper = float(robot.limits.upper[0])
    assert_close(arm.lower[0], 0.2 - upper, rtol=1e-14)
    assert_close(arm.upper[0], 0.2 + 1.0, rtol=1e-14)


def test_arm_has_the_pose_of_the_robot(robot):
    arm = robot.arm()
    q = arm.from_maker(arm.poses["cannon"])
    wanted = forward_kinematics(robot.rigid().chain, q)
    assert_close(forward_kinematics(arm.chain, q), wanted, rtol=0.0)
    assert_close(robot.from_maker(arm.poses["cannon"]), q, rtol=0.0)
    # and its closed form is accepted
    assert SphericalWrist.from_chain(arm.chain).chain.number == 6
    assert arm.name == "kr210" and arm.sources == robot.sources


def test_deformable_arm(robot):
    arm = robot.deformable_arm()
    q = robot.from_maker(robot.poses["cannon"]) + 0.1
    eta = jnp.linspace(-2e-3, 2e-3, robot.elastic)
    wanted = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))
    pose, matrix = arm.tool(q, eta)
    assert_close(pose, wanted, rtol=0.0, atol=1e-14)
    assert matrix.shape == (6, 6) and arm.axes == 6
