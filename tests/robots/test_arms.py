"""Kinematic records UR10e and iiwa 14 against the frames of their URDF descriptions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import SerialChain, forward_kinematics, transform
from elastax.robots import iiwa14, ur10e

from tests.helpers import assert_close


RIGHT, HALF = np.pi / 2, np.pi


def described_ur10e() -> SerialChain:
    """Joint origins of Universal_Robots_ROS2_Description, from `base_link_inertia`."""
    position = [
        [0, 0, 0.1807],
        [0, 0, 0],
        [-0.6127, 0, 0],
        [-0.57155, 0, 0.17415],
        [0, -0.11985, 0],
        [0, 0.11655, 0],
    ]
    rpy = [[0, 0, 0], [RIGHT, 0, 0], [0, 0, 0], [0, 0, 0], [RIGHT, 0, 0]]
    rpy += [[RIGHT, HALF, HALF]]
    return described(position, rpy)


def described_iiwa14() -> SerialChain:
    """Joint origins of iiwa_stack, iiwa14.xacro."""
    position = [
        [0, 0, 0.1575],
        [0, 0, 0.2025],
        [0, 0.2045, 0],
        [0, 0, 0.2155],
        [0, 0.1845, 0],
        [0, 0, 0.2155],
        [0, 0.081, 0],
    ]
    rpy = [[0, 0, 0], [RIGHT, 0, HALF], [RIGHT, 0, HALF], [RIGHT, 0, 0]]
    rpy += [[-RIGHT, HALF, 0], [RIGHT, 0, 0], [-RIGHT, HALF, 0]]
    tool = transform(jnp.eye(3), jnp.array([0, 0, 0.045]))
    return described(position, rpy, tool)


def described(position, rpy, tool=None) -> SerialChain:
    axes = np.tile([0.0, 0, 1], (len(rpy), 1))
    return SerialChain.from_rpy(
        np.array(position, float), np.array(rpy, float), axes, tool=tool
    )


@pytest.mark.parametrize(
    ("arm", "described"),
    [(ur10e, described_ur10e), (iiwa14, described_iiwa14)],
    ids=["ur10e", "iiwa14"],
)
def test_same_kinematics_as_the_description(arm, described):
    arm, chain = arm(), described()
    rng = np.random.default_rng(0)
    q = jnp.asarray(rng.uniform(-3, 3, (20, arm.chain.number)))
    every = jax.jit(lambda c, q: jax.vmap(lambda x: forward_kinematics(c, x))(q))
    # rounding of right angles in radians
    assert_close(every(arm.chain, q), every(chain, q), rtol=0.0, atol=1e-14)


def test_record_ur10e():
    arm = ur10e()
    reach = forward_kinematics(arm.chain, arm.from_maker(arm.poses["zero"]))
    # stretched along -x: both links; sideways the offsets of the wrist  # rounding
    expected = [-0.6127 - 0.57155, -0.17415 - 0.11655, 0.1807 - 0.11985]
    assert_close(reach[:3, 3], expected, rtol=0.0, atol=1e-15)
    assert_close(jnp.rad2deg(arm.upper), [360.0] * 6, rtol=1e-15)


def test_record_iiwa14():
    arm = iiwa14()
    upright = forward_kinematics(arm.chain, arm.from_maker(arm.poses["upright"]))
    # 0.36 + 0.42 + 0.40 + 0.126  # rounding
    expected = np.eye(4)
    expected[2, 3] = 1.306
    assert_close(upright, expected, rtol=0.0, atol=1e-15)
    limits = [170.0, 120, 170, 120, 170, 120, 175]
    assert_close(jnp.rad2deg(arm.upper), limits, rtol=1e-15)  # rounding
    assert_close(arm.lower, -arm.upper, rtol=0.0)


@pytest.mark.parametrize("build", [ur10e, iiwa14])
def test_poses_are_within_the_limits(build):
    arm = build()
    for name, pose in arm.poses.items():
        q = arm.from_maker(pose)
        assert bool(jnp.all((q >= arm.lower) & (q <= arm.upper))), name
    assert arm.sources and len(arm.axis_names) == arm.chain.number
