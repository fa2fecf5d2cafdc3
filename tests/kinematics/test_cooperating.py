"""Closed loops of a master and a slave: poses, velocities, accelerations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    Cooperation,
    SphericalWrist,
    forward_kinematics,
    inverse_kinematics,
    led_motion,
    loop_error,
    rotation_from_rpy,
    select_branch,
    slave_motion,
    slave_pose,
    tool_motion,
    transform,
    transform_from_twist,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import kuka, planar


Q = jnp.array([0.3, -1.1, 1.4, 0.4, 0.8, -0.6])
QD = jnp.array([0.5, -0.3, 0.2, 0.9, -0.4, 0.7])
QDD = jnp.array([1.0, 2.0, -1.5, 0.5, -2.0, 1.2])
SLAVE = jnp.array([-0.4, -0.9, 1.3, -0.5, 0.9, 0.3])


def pose_of(rpy, position):
    return transform(rotation_from_rpy(jnp.array(rpy)), jnp.array(position))


@pytest.fixture(scope="module")
def pair():
    """Two arms side by side; the grasp closes the loop at Q and SLAVE."""
    master, slave = kuka(wrist_height=0.0), kuka(wrist_height=0.0)
    relation = pose_of([0.1, -0.2, 2.5], [1.8, 0.3, -0.1])
    ahead = relation @ forward_kinematics(master, Q)
    grasp = jnp.linalg.solve(ahead, forward_kinematics(slave, SLAVE))
    return Cooperation(master, slave, relation, grasp)


@pytest.fixture(scope="module")
def follow():
    return jax.jit(slave_motion)


def test_published_slave_pose():
    case = load_vectors("003 (3-139)/(3-140)")[0]
    names = ("T_Aeta_Am", "T_Am_TCPm", "T_TCPm_TCPeta")
    inputs = [case["inputs"][name] for name in names]
    poses = [pose_of(x["Theta"], np.array(x["t"], float)) for x in inputs]
    expected, tol = case["outputs"]["T_Aeta_TCPeta"], case["tol"]
    found = slave_pose(*poses)
    assert_close(found, expected, rtol=tol, atol=tol)
    assert_close(loop_error(*poses, found), jnp.zeros(6), rtol=0.0, atol=1e-15)


def test_loop_error_is_what_the_slave_has_to_move():
    poses = [pose_of([0.1 * k, -0.2, k], [1.0 * k, 0.3, -0.1]) for k in (1, 2, 3)]
    off = jnp.array([0.01, -0.02, 0.03, 0.1, 2.0, -1.5])
    actual = slave_pose(*poses) @ transform_from_twist(-off)
    found = loop_error(*poses, actual)
    assert_close(found, off, rtol=1e-13)


@pytest.mark.slow
def test_motion_closes_the_loop(pair, follow):
    """Along the motion of both the loop stays closed to third order in time."""
    motion = follow(pair, Q, QD, QDD, SLAVE)

    def error(t):
        q = Q + t * QD + t**2 / 2 * QDD
        slave = SLAVE + t * motion.qd + t**2 / 2 * motion.qdd
        master_pose = forward_kinematics(pair.master, q)
        pose = forward_kinematics(pair.slave, slave)
        return loop_error(pair.relation, master_pose, pair.grasp, pose)

    along = lambda f: lambda t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
    derivatives = jax.jit(lambda t: (error(t), along(error)(t), along(along(error))(t)))
    value, first, second = derivatives(jnp.array(0.0))
    assert_close(value, jnp.zeros(6), rtol=0.0, atol=1e-14)
    # rates of 1/s and accelerations of 10/s^2 cancel
    assert_close(first, jnp.zeros(6), rtol=0.0, atol=1e-13)
    assert_close(second, jnp.zeros(6), rtol=0.0, atol=1e-12)
    for residual in (motion.velocity_residual, motion.acceleration_residual):
        assert_close(residual, jnp.zeros(6), rtol=0.0, atol=1e-12)


def test_motion_is_that_of_the_slave(pair, follow):
    motion = follow(pair, Q, QD, QDD, SLAVE)
    velocity, acceleration = tool_motion(pair.slave, SLAVE, motion.qd, motion.qdd)
    assert_close(velocity, motion.velocity, rtol=1e-11, atol=1e-13)
    assert_close(acceleration, motion.acceleration, rtol=1e-10, atol=1e-12)
    led = led_motion(pair, Q, QD, QDD)
    assert_close(led, (motion.velocity, motion.acceleration), rtol=1e-14)


def test_path_by_the_inverse_is_that_of_the_rates(pair, follow):
    """Second route: the closed-form inverse along the path, by differences."""
    arm = SphericalWrist.from_chain(pair.slave)

    @jax.jit
    def slave_at(t):
        q = Q + t * QD + t**2 / 2 * QDD
        ahead = forward_kinematics(pair.master, q)
        pose = slave_pose(pair.relation, ahead, pair.grasp)
        return select_branch(*inverse_kinematics(arm, pose), SLAVE)

    step = 1e-3
    before, now, after = (slave_at(jnp.array(t)) for t in (-step, 0.0, step))
    motion = follow(pair, Q, QD, QDD, SLAVE)
    assert_close(now, SLAVE, rtol=1e-12)
    # central differences leave step^2 times third derivatives of some 10/s^3
    assert_close((after - before) / (2 * step), motion.qd, rtol=0.0, atol=1e-4)
    second = (after - 2 * now + before) / step**2
    assert_close(second, motion.qdd, rtol=0.0, atol=1e-3)


def test_singular_slave_reports_what_it_does_not_follow(pair, follow):
    aligned = SLAVE.at[4].set(0.0)
    motion = follow(pair, Q, QD, QDD, aligned)
    assert np.all(np.isfinite(motion.qd)) and np.all(np.isfinite(motion.qdd))
    assert float(jnp.linalg.norm(motion.velocity_residual)) > 1e-3


def test_planar_slave_follows_in_its_plane(follow):
    """Four joints of a planar slave: a redundant arm with rows that it cannot move."""
    master, slave = planar(0.5, 0.4), planar(0.5, 0.4, 0.3, 0.2)
    q, qd, qdd = jnp.array([[0.3, 0.8], [1.0, -0.5], [0.2, 0.7]])
    relation = pose_of([0.0, 0.0, 0.4], [0.3, -0.2, 0.0])
    pair = Cooperation(master, slave, relation, jnp.eye(4))
    motion = follow(pair, q, qd, qdd, jnp.array([0.2, 0.5, -0.9, 0.6]))
    for residual in (motion.velocity_residual, motion.acceleration_residual):
        assert_close(residual, jnp.zeros(6), rtol=0.0, atol=1e-13)


def test_refuses_what_is_no_pose():
    with pytest.raises(ValueError, match="`grasp` of Cooperation must have the shape"):
        Cooperation(planar(1.0), planar(1.0), jnp.eye(4), jnp.eye(3))
    with pytest.raises(ValueError, match="`relation`: `rotation` must be orthogonal"):
        bent = jnp.eye(4).at[0, 1].set(0.1)
        Cooperation(planar(1.0), planar(1.0), bent, jnp.eye(4))


@pytest.mark.slow
def test_gradient_and_batches(pair, follow):
    rates = lambda q, qd: slave_motion(pair, q, qd, QDD, SLAVE)[:2]
    assert_gradient(rates, Q, QD)
    batch = jnp.stack([QD, -QD, 2 * QD])
    loop = jnp.stack([follow(pair, Q, qd, QDD, SLAVE).qdd for qd in batch])
    mapped = jax.jit(jax.vmap(slave_motion, (None, None, 0, None, None)))
    found = mapped(pair, Q, batch, QDD, SLAVE).qdd
    assert_close(found, loop, rtol=1e-11, atol=1e-12)
