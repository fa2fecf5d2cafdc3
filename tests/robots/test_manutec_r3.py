"""Manutec r3 against the results of the Modelica Standard Library."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import locked_frequencies
from elastax.dynamics import holding_torque
from elastax.kinematics import forward_kinematics
from elastax.robots import manutec_r3

from tests.helpers import assert_close


@pytest.fixture(scope="module")
def robot():
    return manutec_r3()


def library_statics(degrees):
    """Torques of gravity about the axes, in the library's axes and in plain numpy.

    y is up, the axes are y, x, x, y, x, y, and no body frame is turned at zero.
    """
    axes = [np.eye(3)[k] for k in (1, 0, 0, 1, 0, 1)]
    to_next = [(0, 0.324, 0.3), (0, 0.65, 0), (0, 0.414, -0.155), (0, 0.186, 0)]
    to_next += [(0, 0.125, 0), (0, 0, 0)]
    masses = [1.0, 56.5, 26.4, 28.7, 5.2, 0.5]
    coms = [(0, 0, 0), (0.172, 0.205, 0), (0.064, -0.034, 0), (0, 0, 0), (0, 0, 0)]
    coms += [(0.05, 0.05, 0.05)]
    point, turn = np.array([0.0, 0.351, 0.0]), np.eye(3)
    joints, bodies = [], []
    for k, angle in enumerate(np.deg2rad(degrees)):
        joints.append((point, turn @ axes[k]))
        x, y, z = axes[k]
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = turn @ (
            np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
        )
        bodies.append((k, masses[k], point + turn @ np.array(coms[k])))
        point = point + turn @ np.array(to_next[k])
    bodies.append((5, 15.0, point + turn @ np.array([0.1, 0.25, 0.1])))
    torques = np.zeros(6)
    for carrier, mass, com in bodies:
        for k in range(carrier + 1):
            origin, axis = joints[k]
            weight = np.array([0.0, -9.81 * mass, 0.0])
            torques[k] -= axis @ np.cross(com - origin, weight)
    return torques


def test_gear_torsion_at_rest_meets_the_library(robot):
    q = robot.from_maker(robot.poses["start"])
    load = jax.jit(lambda robot, q: holding_torque(robot, q))(robot, q)
    torsion = robot.drives.to_motor_angle(robot.drives.stiffness.torsion(-load))
    # Dymola's FullRobot at t = 0, printed to 15 digits
    assert_close(torsion[1], 0.274150861706671, rtol=1e-12)
    assert_close(torsion[2], 0.0736781805449948, rtol=1e-12)
    assert_close(jnp.abs(load[1:3]), [460.5734, 256.4001], rtol=1e-6)
    assert abs(load[0]) < 1e-10


@pytest.mark.parametrize("pose", ["upright", "start", "end"])
def test_gravity_torque_of_all_axes(robot, pose):
    """Another route: statics in the library's own axes."""
    q = robot.from_maker(robot.poses[pose])
    load = jax.jit(lambda robot, q: holding_torque(robot, q))(robot, q)
    assert_close(load, library_statics(np.rad2deg(q)), rtol=0, atol=1e-11)


def test_geometry(robot):
    """At zero the arm points up; our axes are the library's z, x, y."""
    tool = jax.jit(lambda robot, q: forward_kinematics(robot.chain, q))(
        robot, jnp.zeros(6)
    )
    height = 0.351 + 0.324 + 0.65 + 0.414 + 0.186 + 0.125 + 0.25
    assert_close(tool[:3, 3], [0.3 - 0.155 + 0.1, 0.1, height], rtol=1e-14)


def test_gears_are_referred_to_the_output(robot):
    drives = robot.drives
    assert_close(drives.ratio[:3], [-105.0, 210.0, 60.0], rtol=0)
    stiffness = [43.0 * 105**2, 8.0 * 210**2, 58.0 * 60**2]
    assert_close(drives.stiffness.linear[:3], stiffness, rtol=1e-15)
    assert_close(drives.damping[:3], [55.125, 441.0, 144.0], rtol=1e-14)
    # a motor speed of 160 rad/s on axis 1: 0.4 + 0.13 N m on the motor side
    friction = drives.motor_friction.torque(jnp.full(6, 160 / 105))
    assert_close(friction[0], 105 * 0.53, rtol=1e-14)
    # axes 4 to 6: behind the gear
    assert_close(friction[3:], jnp.zeros(3), rtol=0)
    friction = drives.joint_friction.torque(jnp.ones(6))
    assert_close(friction, [0, 0, 0, 31.6, 30.13, 14.82], rtol=1e-14)


@pytest.mark.slow
def test_stiff_gears_stay_apart_from_the_elastic_ones(robot):
    find = eqx.filter_jit(locked_frequencies)
    for name, pose in robot.poses.items():
        frequencies = find(robot, robot.from_maker(pose))
        assert np.all(np.isfinite(frequencies)), name
        assert frequencies[3] > 4 * frequencies[2], name


def test_record(robot):
    assert robot.axes == 6 and robot.elastic == 0
    assert_close(robot.payload.mass, [15.0], rtol=0)
    for name, pose in robot.poses.items():
        inside = (pose >= robot.limits.lower) & (pose <= robot.limits.upper)
        assert np.all(inside), name
    assert robot.sources and robot.assumptions
