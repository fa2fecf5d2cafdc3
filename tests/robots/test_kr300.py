"""The KR300 against the terms that the authors of its recordings stored."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import RigidBodies, inverse_dynamics, multibody
from elastax.kinematics import forward_kinematics
from elastax.robots import kr300
from scipy.io import loadmat

from tests.helpers import assert_close


ROUNDING = 5.1e-5  # the terms are stored with four digits behind the point


@pytest.fixture(scope="module")
def robot():
    return kr300()


@pytest.fixture(scope="module", params="AB")
def stored(request, data_dir):
    path = data_dir / "kuka_kr300" / f"kr300_10s_FF_{request.param}.mat"
    if not path.is_file():
        pytest.skip(f"{path.name} is absent: see the README for where to get it")
    return loadmat(path, simplify_cells=True)


def with_stored_link_6(robot):
    """Rigid robot whose flange and payload are the sixth link of the stored terms."""
    robot = robot.rigid()
    tensor = np.array(
        [
            [0.060429, 0.000021, 0.000004],
            [0.000021, 0.060382, 0.000006],
            [0.000004, 0.000006, 0.090701],
        ]
    )
    link = RigidBodies(
        np.array([150.0]), np.array([[0.0, 0.0, 0.1]]), tensor[None], (5,), ("link 6",)
    )
    bodies = robot.bodies
    others = RigidBodies(
        bodies.mass[:5],
        bodies.com[:5],
        bodies.inertia[:5],
        bodies.joint[:5],
        bodies.names[:5],
    )
    return dataclasses.replace(robot, bodies=others, payload=link.moved(robot.flange))


@jax.jit
def terms(robot, q, qd):
    """Gravity, velocity terms and diagonal of the mass matrix with rotors."""

    def one(q, qd):
        zero = jnp.zeros_like(q)
        gravity, _ = inverse_dynamics(robot, q, zero, zero)
        moving, _ = inverse_dynamics(robot, q, qd, zero)
        mass, _ = multibody(robot, q, jnp.zeros((0,)), qd, jnp.zeros((0,)))
        return gravity, moving - gravity, jnp.diag(mass)

    gravity, velocity, mass = jax.vmap(one)(q, qd)
    return gravity, velocity, mass + robot.drives.reflected_inertia()[None]


def terms_along(robot, stored):
    motion = stored["ref_kin"]
    q = motion["phi_r_all"] + np.asarray(robot.poses["cannon"])
    return [np.asarray(x).T for x in terms(robot, q, motion["phi_r_all_d1"])]


def test_stored_terms(robot, stored):
    gravity, velocity, mass = terms_along(with_stored_link_6(robot), stored)
    pairs = {
        "tau_g_all": gravity - gravity[:, :1],
        "m_all": mass,
        "tau_c_all": velocity,
    }
    for name, ours in pairs.items():
        assert_close(ours, stored[name], rtol=0.0, atol=ROUNDING)
        largest = np.max(np.abs(stored[name]), axis=1)
        error = np.max(np.abs(ours - stored[name]), axis=1)
        # a signal of less than one newton metre is rounded more coarsely than that
        assert np.all(error[largest > 1.0] < 1e-4 * largest[largest > 1.0]), name
    assert_close(gravity[:, 0], stored["tau_g_init"], rtol=0.0, atol=1e-6)


def test_record_splits_link_6(robot, stored):
    """First moments are kept: the record holds the same gravity, and more inertia."""
    gravity, _, mass = terms_along(robot.rigid(), stored)
    assert_close(gravity - gravity[:, :1], stored["tau_g_all"], rtol=0.0, atol=ROUNDING)
    more = mass - stored["m_all"]
    assert np.min(more) > -ROUNDING
    # 17.78 kg and 132.22 kg 0.17 m apart, and a disc of 0.4 m
    assert np.max(more) < 0.454 + 2.645


def test_mass_of_link_6(robot):
    assert_close(robot.bodies.mass[-1] + robot.payload.mass[0], 150.0, rtol=1e-15)
    assert robot.bodies.names[-1] == "flange"


def test_poses(robot):
    """Reach in three poses and directions of the axes, from the table's lengths."""
    chain = robot.rigid().chain
    place = jax.jit(jax.vmap(lambda q: forward_kinematics(chain, q)))
    angles = [
        robot.poses["stretched"],
        robot.poses["cannon"],
        robot.poses["upright"],
        jnp.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
        jnp.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]),
    ]
    poses = np.asarray(place(jnp.stack([robot.from_maker(a) for a in angles])))
    long = 0.350 + 1.150 + 1.240
    reach = poses[:, :3, 3]
    assert_close(reach[0], [long, 0.0, 0.675 - 0.041], rtol=0.0, atol=1e-12)
    assert_close(reach[1], [1.59, 0.0, 1.825 - 0.041], rtol=0.0, atol=1e-12)
    assert_close(reach[2], [0.350 + 0.041, 0.0, 3.065], rtol=0.0, atol=1e-12)
    turned = [long * np.cos(0.5), -long * np.sin(0.5), 0.634]
    assert_close(reach[3], turned, rtol=0.0, atol=1e-12)
    assert reach[4, 2] < reach[0, 2]  # positive A3 lowers the arm
    assert_close(poses[0, :3, 0], [1.0, 0.0, 0.0], rtol=0.0, atol=1e-12)


def test_poses_lie_within_limits(robot):
    for pose in robot.poses.values():
        assert np.all(pose >= robot.limits.lower) and np.all(pose <= robot.limits.upper)


def test_angles_are_the_makers(robot):
    angles = jnp.arange(6.0)
    assert_close(robot.from_maker(angles), angles, rtol=0.0)


def test_counterbalance(robot):
    """-3073.8, 631.7 and 6179.3 N m, against gravity's sign."""
    angle = jnp.deg2rad(jnp.array([-120.0, -90.0, -40.0]))
    torque = -robot.counterbalance.torque(angle)
    assert_close(torque, [-3073.7735, 631.72999, 6179.3192], rtol=1e-7)


def test_friction_is_the_sources(robot):
    """At 0.1 rad/s, by hand."""
    torque = robot.drives.motor_friction.torque(jnp.full((6,), 0.1))
    first = 54.024 + 205.035 + 285.36 * np.tanh(1.0) + 70.135
    assert_close(torque[0], first, rtol=1e-12)


def test_levels_of_detail(robot):
    assert (robot.axes, robot.elastic) == (6, 8)
    assert robot.flexible_joint().elastic == 0
    assert robot.assumptions and robot.sources
