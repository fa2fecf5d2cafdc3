"""The deformed arm: exact by iteration, approximately by levers or with fewer axes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DeformableArm,
    SphericalWrist,
    correct_pose,
    forward_kinematics,
    geometric_correction,
    inverse_kinematics,
    select_branch,
)
from elastax.robots import kr210

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, planar


DEFORMATION = 3e-3  # rad, largest of each elastic coordinate


@pytest.fixture(scope="module")
def robot():
    return kr210()


@pytest.fixture(scope="module")
def cases(robot):
    """Poses inside the workspace and deformations of some mrad."""
    rng = np.random.default_rng(0)
    middle = np.deg2rad([0.0, -80.0, 90.0, 0.0, 40.0, 0.0])
    spread = np.deg2rad([90.0, 25.0, 30.0, 60.0, 20.0, 90.0])
    angles = middle + spread * rng.uniform(-1, 1, (100, 6))
    q = jnp.asarray(np.asarray(robot.axis_signs) * angles)
    eta = jnp.asarray(DEFORMATION * rng.uniform(-1, 1, (100, robot.elastic)))
    return q, eta


def rigid_pose(arm, q, eta):
    return arm.tool(q, jnp.zeros_like(eta))[0]


def distances(arm, q, eta, corrected):
    """Distance [m] and rotation [rad] between deformed tool and rigid one."""
    actual, target = arm.tool(corrected, eta)[0], rigid_pose(arm, q, eta)
    turn = jnp.sum((actual[:3, :3] - target[:3, :3]) ** 2)
    shift = jnp.sum((actual[:3, 3] - target[:3, 3]) ** 2)
    return jnp.sqrt(shift), jnp.sqrt(turn / 2)


@eqx.filter_jit
def compare(arm, wrist, q, eta):
    """Remaining distances of every variant."""

    def one(q, eta):
        target = rigid_pose(arm, q, eta)
        # the exact solution of the rigid kinematics is the start, as in the text
        start = select_branch(*inverse_kinematics(wrist, target), q)
        position_by = lambda axes: (
            correct_pose(arm, target, start, eta, axes=axes, rows=(0, 1, 2)).value
        )
        variants = {
            "rigid": start,
            "one step": correct_pose(arm, target, start, eta, steps=1).value,
            "iterated": correct_pose(arm, target, start, eta).value,
            "axis 2 kept": position_by((0, 2)),
            "axis 3 kept": position_by((0, 1)),
            "geometric": geometric_correction(arm, start, eta),
        }
        return {name: distances(arm, q, eta, x) for name, x in variants.items()}, (
            jnp.max(jnp.abs(variants["iterated"] - q)),
            jnp.max(jnp.abs(start - q)),
        )

    return jax.vmap(one)(q, eta)


@pytest.mark.slow
def test_variants(robot, cases):
    arm, wrist = robot.deformable_arm(), SphericalWrist.from_chain(robot.arm().chain)
    left, (change, start) = compare(arm, wrist, *cases)
    worst = {name: tuple(float(np.max(x)) for x in pair) for name, pair in left.items()}
    mean = {name: tuple(float(np.mean(x)) for x in pair) for name, pair in left.items()}
    # the rigid chain has the same zeros as the axes of the elastic one
    assert np.max(start) < 1e-10
    assert 1e-2 < worst["rigid"][0] < 2e-2 and mean["rigid"][0] > 5e-3
    # [Reiner2010] 3.6.1 iterated: the tool is held to rounding
    assert worst["iterated"][0] < 1e-12 and worst["iterated"][1] < 1e-12
    assert np.max(change) < 0.1
    # one step leaves the square of the deformation, 10 mrad in all at 2.7 m
    assert worst["one step"][0] < 0.01**2 * 2.7
    assert worst["one step"][1] < 0.01**2
    # two base axes instead of three: one direction of the position stays
    for name in ("axis 2 kept", "axis 3 kept"):
        assert 1e-4 < mean[name][0] < 0.6 * mean["rigid"][0]
    # [Reiner2010] 3.6.2: a tenth of the position error stays, the orientation all
    assert mean["geometric"][0] < 0.1 * mean["rigid"][0]
    assert worst["geometric"][0] < 0.15 * worst["rigid"][0]
    assert 0.5 < mean["geometric"][1] / mean["rigid"][1] < 2.0


def test_no_deformation_no_correction(robot, cases):
    arm, (q, eta) = robot.deformable_arm(), cases
    corrected = geometric_correction(arm, q[0], 0 * eta[0])
    assert_close(corrected, q[0], rtol=0.0, atol=1e-14)


def simple_arm(height=-0.035):
    """Hinges about y and z behind each of the axes 2 and 3 of a KUKA-like arm."""
    chain = kuka(wrist_height=height)
    joints = chain.joints
    order = [0, 1, 1, 1, 2, 2, 2, 3, 4, 5]
    first = np.array([True, True, False, False, True, False, False, True, True, True])
    hinges = np.array([[0.0, 1, 0], [0, 0, 1]])
    axes = np.asarray(joints.axis)[order]
    axes[[2, 3]] = hinges
    axes[[5, 6]] = hinges
    positions = np.where(first[:, None], np.asarray(joints.position)[order], 0.0)
    rotations = np.asarray(joints.rotation)[order]
    frames = type(joints)(rotations, positions, axes)
    long = type(chain)(frames, chain.base, chain.tool, (chain.kinds[0],) * 10)
    coupling = np.zeros((10, 10))
    axis_joints = (0, 1, 4, 7, 8, 9)
    for column, joint in enumerate((*axis_joints, 2, 3, 5, 6)):
        coupling[joint, column] = 1.0
    return DeformableArm(long, coupling, axis_joints)


def test_bending_in_line_with_axis_2_is_taken_back():
    """A hinge that lies in axis 2 is corrected by the opposite turn, exactly."""
    arm = simple_arm()
    q = jnp.array([0.4, -0.9, 1.1, 0.2, 0.6, -0.3])
    eta = jnp.array([4e-3, 0.0, 0.0, 0.0])
    corrected = geometric_correction(arm, q, eta, steepness=1e4)
    assert_close(corrected, q.at[1].add(-4e-3), rtol=0.0, atol=1e-12)
    # the same behind axis 3
    eta = jnp.array([0.0, 0.0, -3e-3, 0.0])
    corrected = geometric_correction(arm, q, eta, steepness=1e4)
    # where the tool lies beside the forearm's direction a second order is left
    assert_close(corrected, q.at[2].add(3e-3), rtol=0.0, atol=0.5 * 3e-3**2)


def test_sideways_bending_is_met_by_axis_1():
    """The correction of axis 1 is positive about its own axis, -z on a KUKA arm."""
    arm = simple_arm()
    q = jnp.array([0.4, -0.9, 1.1, 0.2, 0.6, -0.3])
    eta = jnp.array([0.0, 2e-3, 0.0, 0.0])
    before = distances(arm, q, eta, q)[0]
    corrected = geometric_correction(arm, q, eta)
    after = distances(arm, q, eta, corrected)[0]
    assert float(after) < 0.1 * float(before)
    # the arm has swung about +z at axis 2: axis 1 turns the same way about -z
    assert 1e-4 < float(corrected[0] - q[0]) < 3e-3


@pytest.mark.slow
def test_a_vanishing_lever_is_faded_out():
    """Wrist and tool above axis 1: no correction of axis 1 helps there."""
    arm = simple_arm(height=0.0)
    # upper arm upright, forearm back over axis 1, hand along it
    third = -np.arcsin(0.26 / 0.67)
    q = jnp.array([0.7, -np.pi / 2, third, 0.0, -third, 0.0])
    pose = arm.tool(q, jnp.zeros(4))[0]
    assert_close(pose[:2, 3], jnp.zeros(2), rtol=0.0, atol=1e-12)
    eta = jnp.array([0.0, 2e-3, 0.0, 1e-3])
    corrected = geometric_correction(arm, q, eta, steepness=1e3)
    assert np.all(np.isfinite(corrected))
    # [Reiner2010] (3.59): at most 0.6382 sqrt(s) times the deviation
    deviation = float(distances(arm, q, eta, q)[0])
    bound = 0.6382 * np.sqrt(1e3) * deviation
    assert abs(float(corrected[0] - q[0])) < bound
    function = lambda eta: geometric_correction(arm, q, eta)
    for derivative in (jax.jacfwd, jax.jacrev):
        assert np.all(np.isfinite(jax.jit(derivative(function))(eta)))


@pytest.mark.slow
def test_gradients():
    arm = simple_arm()
    q = jnp.array([0.4, -0.9, 1.1, 0.2, 0.6, -0.3])
    eta = jnp.array([1e-3, -2e-3, 3e-3, 1e-3])
    assert_gradient(lambda q, eta: geometric_correction(arm, q, eta), q, eta)


@pytest.mark.slow
def test_jit_vmap_and_loop_agree():
    arm = simple_arm()
    q = jnp.array([0.4, -0.9, 1.1, 0.2, 0.6, -0.3])
    eta = jnp.asarray(np.random.default_rng(3).uniform(-3e-3, 3e-3, (3, 4)))
    batch = jax.jit(jax.vmap(geometric_correction, (None, None, 0)))(arm, q, eta)
    one = jax.jit(geometric_correction)
    for k in range(3):
        assert_close(batch[k], one(arm, q, eta[k]), rtol=0.0, atol=1e-14)


def test_refusals():
    with pytest.raises(ValueError, match="must have an arm and a wrist, but has 2"):
        arm = DeformableArm.rigid(planar(1.0, 1.0))
        geometric_correction(arm, jnp.zeros(2), jnp.zeros(0))


def test_rigid_arm_needs_no_correction():
    arm = DeformableArm.rigid(kuka())
    q = jnp.array([0.4, -0.9, 1.1, 0.2, 0.6, -0.3])
    corrected = geometric_correction(arm, q, jnp.zeros(0))
    assert_close(corrected, q, rtol=0.0, atol=1e-15)
    wanted = forward_kinematics(arm.chain, q)
    assert_close(arm.tool(corrected, jnp.zeros(0))[0], wanted, rtol=0.0, atol=1e-14)
