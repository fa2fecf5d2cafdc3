"""KUKA KR210: kinematics, signs, eigenfrequencies, static deflection."""

import dataclasses
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import locked_frequencies
from elastax.dynamics import holding_torque, no_bodies, static_equilibrium
from elastax.kinematics import forward_kinematics, moving_frames
from elastax.robots import kr210

from tests.helpers import assert_close


LOAD = 0.24  # m in front of the flange
HEIGHT = 0.2256 + 0.4494


@pytest.fixture(scope="module")
def robot():
    return kr210()


@eqx.filter_jit
def tool_and_wrist(robot, angles):
    rigid = robot.rigid()
    q = robot.from_maker(angles)
    tool = forward_kinematics(rigid.chain, q)
    return tool[:3, 3], moving_frames(rigid.chain, q).position[rigid.wrist]


@eqx.filter_jit
def rest(robot, theta):
    """Joint angles, deformations and tool at rest on locked motors."""
    q, eta = static_equilibrium(robot, theta)
    coordinates = robot.joint_coordinates(q, eta)
    return q, eta, forward_kinematics(robot.chain, coordinates)


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["stretched", "cannon", "upright"])
def test_first_eigenfrequency(robot, pose):
    """Arms of this size with full load lie between 3 and 10 Hz."""
    theta = robot.from_maker(robot.poses[pose])
    frequencies = eqx.filter_jit(locked_frequencies)(robot, theta)
    assert np.all(np.isfinite(frequencies))
    assert 3.0 < frequencies[0] < 10.0
    assert frequencies.shape == (14,)


def test_named_poses(robot):
    tool, wrist = tool_and_wrist(robot, robot.poses["stretched"])
    assert_close(wrist, [0.35 + 1.15 + 1.2, 0, HEIGHT - 0.041], rtol=0, atol=1e-14)
    assert_close(tool - wrist, [0.215 + LOAD, 0, 0], rtol=0, atol=1e-14)
    tool, wrist = tool_and_wrist(robot, robot.poses["cannon"])
    wanted = [0.35 + 1.2, 0, HEIGHT + 1.15 - 0.041]
    assert_close(wrist, wanted, rtol=0, atol=1e-14)
    tool, wrist = tool_and_wrist(robot, robot.poses["upright"])
    wanted = [0.35 + 0.041, 0, HEIGHT + 1.15 + 1.2]
    assert_close(wrist, wanted, rtol=0, atol=1e-14)


def test_signs_are_those_of_the_maker(robot):
    zero, wrist = tool_and_wrist(robot, jnp.zeros(6))

    def moved(axis):
        angles = jnp.zeros(6).at[axis].set(0.1)
        return tool_and_wrist(robot, angles)

    reach = 0.35 + 1.15 + 1.2
    # A1 turns about -z
    _, turned = moved(0)
    wanted = [reach * np.cos(0.1), -reach * np.sin(0.1), wrist[2]]
    assert_close(turned, wanted, rtol=1e-14)
    # positive A2, A3 and A5 lower the arm
    for axis, arm in ((1, 2.35), (2, 1.2)):
        _, lowered = moved(axis)
        drop = arm * np.sin(0.1) + 0.041 * (np.cos(0.1) - 1)
        assert_close(wrist[2] - lowered[2], drop, rtol=1e-12)
    lowered, _ = moved(4)
    assert_close(zero[2] - lowered[2], (0.215 + LOAD) * np.sin(0.1), rtol=1e-12)
    # the axes of the wrist meet in its centre
    for axis in (3, 4, 5):
        assert_close(moved(axis)[1], wrist, rtol=0, atol=1e-14)
    # A4 and A6 turn about the outward axis' opposite: no displacement on the axis
    for axis in (3, 5):
        assert_close(moved(axis)[0], zero, rtol=0, atol=1e-14)
    assert_close(
        robot.to_maker(robot.from_maker(jnp.arange(6.0))), jnp.arange(6.0), rtol=0
    )


def test_payload_lowers_the_tool_as_by_hand(robot):
    """Stretched arm without weight of its own, small load at the tool.

    In the vertical plane give way: the gears 2, 3 and 5, the tilt 1 y and the forearm,
    whose hinge is followed by half its angle at the wrist. The weight of 1 g keeps the
    linear calculation by hand exact.
    """
    weight = 1e-3 * 9.81
    light = robot.with_payload(1e-3, np.array([0.0, 0.0, LOAD]), 1e-6 * np.eye(3))
    bare = dataclasses.replace(light, bodies=no_bodies(), counterbalance=None)
    _, eta, pose = rest(bare, jnp.zeros(6))
    gear = np.asarray(robot.drives.stiffness.linear)
    spring = dict(zip(robot.elastic_names, robot.structure_stiffness.linear.tolist()))
    reach = 0.35 + 1.15 + 1.2 + 0.215 + LOAD
    wrist = 1.2 + 0.215 + LOAD  # from axis 3, without the drop of 41 mm
    hand = 0.215 + LOAD
    drop = weight * (
        reach**2 / spring["tilt 1 y"]
        + (reach - 0.35) ** 2 / gear[1]
        + wrist**2 / gear[2]
        + (wrist + 0.5 * hand) ** 2 / spring["forearm y"]
        + hand**2 / gear[4]
    )
    assert_close(HEIGHT - 0.041 - pose[2, 3], drop, rtol=1e-6)
    bent = dict(zip(robot.elastic_names, np.abs(eta).tolist()))
    assert bent.pop("tilt 1 y") > 1e-9 and bent.pop("forearm y") > 1e-9
    assert max(bent.values()) < 1e-15


def test_gravity_torque_by_hand(robot):
    """Load torque of axis 5 of the stretched arm: wrist, flange and payload."""
    torque = eqx.filter_jit(holding_torque)(robot.rigid(), jnp.zeros(6))
    # centres of mass in front of the wrist centre [m]: the wrist's 46.7 mm along -z of
    # its frame, the flange's 50 mm behind its face
    moment = 29.53 * 0.0467 + 17.78 * (0.215 - 0.050) + 210.0 * (0.215 + LOAD)
    assert_close(torque[4], -9.81 * moment, rtol=1e-12)


def test_record(robot):
    assert robot.axes == 6 and robot.elastic == 8
    for name, pose in robot.poses.items():
        inside = (pose >= robot.limits.lower) & (pose <= robot.limits.upper)
        assert np.all(inside), name
    assert robot.sources and robot.assumptions


def test_levels_of_detail(robot):
    assert robot.flexible_joint().elastic == 0
    assert robot.flexible_joint().has_elastic_gears
    assert not robot.rigid().has_elastic_gears


def test_record_is_built_fast(robot):
    """Nothing large is compiled for a record; the second one compiles nothing."""
    start = time.perf_counter()
    jax.block_until_ready(kr210())
    assert time.perf_counter() - start < 0.5
