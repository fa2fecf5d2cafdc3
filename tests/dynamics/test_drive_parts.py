"""Robots with every part of the drive trains: two routes, plants, inverses, limits."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.control import CascadeMotorControl
from elastax.drivetrain import (
    AxisFriction,
    Backlash,
    BacklashStiffness,
    ConstantEfficiency,
    DirectionalEfficiency,
    ExactEfficiency,
    ExactStopBranch,
    LinearStiffness,
    LoadFriction,
    Motor,
    RateIndependentPlay,
    RelaxationBranch,
    StickSlipFriction,
    StopBranch,
    StribeckFriction,
    TransmissionError,
)
from elastax.dynamics import equations_of_motion, lagrange_forces, simulate
from elastax.inverse import ASIM, FlexibleJointInverse, RigidInverse

from tests import systems
from tests.helpers import assert_close


TWO = np.ones(2)
PLAY = RateIndependentPlay(
    np.array([[1e-3, 1e-3], [3e-3, 3e-3]]), 8e3 * TWO, 1e-4 * TWO
)
EFFICIENCY = DirectionalEfficiency(
    ConstantEfficiency(0.95), ConstantEfficiency(0.93), 0.05
)
ERROR = TransmissionError(
    np.array([[2e-4, 1e-4]]), np.array([[2.0, 7.0]]), np.array([[0.4, 1.0]]), 0.01 * TWO
)
SMOOTH = {
    "lag": {"motor": Motor(3e-4 * TWO, lag=2e-3 * TWO)},
    "stribeck": {
        "motor_friction": StribeckFriction(
            80.0 * TWO, 5.0 * TWO, 50.0 * TWO, 1.0 * TWO, 0.02 * TWO
        )
    },
    "efficiency": {"mesh": EFFICIENCY},
    "load friction": {
        "mesh": LoadFriction(0.03 * TWO, 0.02 * TWO, 0.1 * TWO, 50.0 * TWO, 5.0 * TWO)
    },
    "transmission error": {"transmission_error": ERROR},
    "soft backlash": {
        "stiffness": BacklashStiffness(3e4 * TWO, 8e-4 * TWO, 1.2e-3 * TWO, 0 * TWO)
    },
    "relaxation": {
        "branch": RelaxationBranch(9e3 * TWO, LinearStiffness(9e3 * TWO), 300.0 * TWO)
    },
    "hysteresis": {"branch": StopBranch(2e3 * np.ones((2, 2)), PLAY)},
}
SMOOTH["all together"] = {
    key: value
    for name in ("lag", "stribeck", "load friction", "transmission error", "relaxation")
    for key, value in SMOOTH[name].items()
}
EXACT = {
    "stick-slip": {
        "motor_friction": StickSlipFriction(8.0 * TWO, 4.0 * TWO, 1.2 * TWO)
    },
    "efficiency": {"mesh": ExactEfficiency(0.95 * TWO, 0.93 * TWO)},
    "hysteresis": {"branch": ExactStopBranch(2e3 * np.ones((2, 2)), PLAY.thresholds)},
    "backlash": {
        "stiffness": Backlash(LinearStiffness(3e4 * TWO), 4e-4 * TWO, 0.0 * TWO)
    },
}
each_smooth = pytest.mark.parametrize("parts", SMOOTH.values(), ids=SMOOTH)
each_exact = pytest.mark.parametrize("parts", EXACT.values(), ids=EXACT)
STATE = [
    jnp.array(x)
    for x in (
        [0.3, -0.7],
        [0.01, -0.02],
        [0.302, -0.69],
        [0.9, -1.4],
        [0.1, 0.2],
        [1.1, -1.2],
    )
]
START, CHANGE = [0.2, -0.5], [0.5, 0.4]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [n for n in SMOOTH if n not in ("lag", "all together")]
)
def test_blocks_are_those_of_lagrange(name):
    """h of the blocks and Lagrange's left-hand side at zero acceleration."""
    robot = systems.elastic_2r().with_drives(**SMOOTH[name])
    drives = robot.drives
    count = drives.memory_states
    memory = 1e-3 * jnp.arange(1.0, 2 * count + 1).reshape(count, 2) if count else None

    @jax.jit
    def both(*state):
        zero = jnp.zeros(2)
        eom = equations_of_motion(robot, *state, memory)
        accelerations = (zero, zero, zero)
        lagrange = lagrange_forces(robot, *state, *accelerations, memory)
        return (eom.h_a, eom.h_e, eom.h_m), lagrange

    blocks, lagrange = both(*STATE)
    for ours, desired in zip(blocks, lagrange):
        scale = float(jnp.max(jnp.abs(desired)))
        assert_close(ours, desired, rtol=0, atol=1e-10 * scale)


@eqx.filter_jit
def feedforward(model, reference):
    return FlexibleJointInverse().feedforward(model, reference)


# A program of its own: it serves commands of several models. The solver's tolerances
# lie a thousand times below the 2e-6 rad that the tests ask for.
@eqx.filter_jit
def moved(plant, command):
    return simulate(plant, command, CascadeMotorControl(), rtol=1e-9, atol=1e-11)


def driven(plant, model, dt):
    """Command of RLFJ and motion of the plant, as far as solvers bring them."""
    order = FlexibleJointInverse().order(model)
    reference = systems.smooth_reference(START, CHANGE, 0.3, dt=dt, order=order)
    command = feedforward(model, reference)
    return command, moved(plant, command)


@pytest.mark.slow
@each_smooth
def test_exact_inverse_moves_the_plant(parts):
    """RLFJ on a robot with rigid links: joints along the reference.

    Laws that are straight over many samples come to 1e-7 rad. A soft gap, crossed in
    some samples of 0.5 ms, leaves 9e-6 rad, which falls with the third power of the
    sample; the corners of plays leave more.
    """
    robot = systems.elastic_2r().flexible_joint().with_drives(**parts)
    command, motion = driven(robot, robot, 5e-4)
    plays = parts.get("branch") is SMOOTH["hysteresis"]["branch"]
    bound = 5e-5 if plays else 2e-5 if "stiffness" in parts else 2e-6
    assert_close(motion.q, command.q, rtol=0, atol=bound)
    # and the part matters: an inverse without it is worse by far
    plain = systems.elastic_2r().flexible_joint()
    _, blind = driven(robot, plain, 5e-4)
    assert np.max(np.abs(np.asarray(blind.q - command.q))) > 4 * bound


@pytest.mark.slow
@each_exact
def test_exact_parts_in_the_plant(parts):
    """The plant runs, stays near the command, and modes tell where motors stick."""
    robot = systems.elastic_2r().flexible_joint()
    plant = robot.with_drives(**parts)
    command, motion = driven(plant, robot, 1e-3)
    assert np.all(np.isfinite(np.asarray(motion.q)))
    # 7 % of 150 N m against the loop's stiffness, inertia x 60 x 15 = 2700 N m/rad,
    # with the swing that it starts
    assert np.max(np.abs(np.asarray(motion.q - command.q))) < 0.05
    if plant.drives.sticks:
        assert motion.modes is not None
        assert set(np.unique(np.asarray(motion.modes))) <= {-1.0, 0.0, 1.0}
        still = np.asarray(motion.modes) == 0
        assert np.all(np.asarray(motion.thetad)[still] == 0.0)
    with pytest.raises(ValueError, match="have an inverse"):
        reference = systems.smooth_reference(START, CHANGE, 0.3)
        ASIM().feedforward(plant, reference)


@pytest.mark.slow
def test_steep_friction_tends_to_the_exact_one():
    """Smooth friction of rising steepness approaches sticking and sliding."""
    robot = systems.elastic_2r().flexible_joint()
    exact = robot.with_drives(motor_friction=EXACT["stick-slip"]["motor_friction"])
    exact = eqx.tree_at(lambda r: r.drives.motor_friction.peak, exact, jnp.ones(2))
    _, desired = driven(exact, robot, 1e-3)
    errors = []
    for steepness in (200.0, 2000.0):
        smooth = systems.friction(8.0 * TWO, 4.0, steepness)
        plant = robot.with_drives(motor_friction=smooth)
        _, motion = driven(plant, robot, 1e-3)
        errors.append(float(jnp.max(jnp.abs(motion.q - desired.q))))
    assert errors[1] < 0.3 * errors[0]


def test_laws_per_axis():
    """Another friction on each axis acts like each by itself."""
    stribeck = SMOOTH["stribeck"]["motor_friction"]
    one = jax.tree.map(lambda leaf: leaf[:1], stribeck)
    other = systems.friction(3.0 * np.ones(1), 2.0, 40.0)
    mixed = AxisFriction((one, other), ((0,), (1,)))
    speed = jnp.array([0.3, -0.7])
    expected = jnp.concatenate([one.torque(speed[:1]), other.torque(speed[1:])])
    robot = systems.elastic_2r()
    plain = equations_of_motion(robot, *STATE).h_m
    swapped = equations_of_motion(robot.with_drives(motor_friction=mixed), *STATE).h_m
    before = robot.drives.motor_friction.torque(STATE[5])
    assert_close(swapped - plain, mixed.torque(STATE[5]) - before, rtol=1e-10)
    assert_close(mixed.torque(speed), expected, rtol=1e-14)


@pytest.mark.parametrize("name", ["efficiency", "transmission error"])
def test_rigid_gears_refuse_what_they_cannot_know(name):
    robot = systems.elastic_2r().with_drives(**SMOOTH[name], stiffness=None)
    with pytest.raises(ValueError, match="rigid gears know neither"):
        equations_of_motion(robot, *STATE)


def test_memory_must_be_handed_over():
    robot = systems.elastic_2r().with_drives(**SMOOTH["hysteresis"])
    with pytest.raises(ValueError, match="hand its states over"):
        equations_of_motion(robot, *STATE)


def test_lag_asks_for_one_derivative_more():
    model = systems.elastic_2r().with_drives(**SMOOTH["lag"])
    plain = systems.elastic_2r()
    for inverse in (RigidInverse(), FlexibleJointInverse(), ASIM()):
        assert inverse.order(model) == inverse.order(plain) + 1
    reference = systems.smooth_reference(START, CHANGE, 0.3)
    with pytest.raises(ValueError, match="derivative"):
        ASIM().feedforward(model, reference)


def test_rigid_inverse_with_a_lag():
    """Computed torque behind a lag: the command is torque plus T times its rate."""
    parts = SMOOTH["lag"] | SMOOTH["transmission error"]
    model = systems.elastic_2r().with_drives(**parts)
    reference = systems.smooth_reference(START, CHANGE, 0.3, dt=1e-4, order=3)
    plain = dataclasses.replace(model.drives, motor=Motor(3e-4 * TWO))
    without = dataclasses.replace(model, drives=plain)
    feed = jax.jit(lambda m: RigidInverse().feedforward(m, reference).tau_m)
    torque, command = np.asarray(feed(without)), np.asarray(feed(model))
    rate = (8 * (torque[3:-1] - torque[1:-3]) - torque[4:] + torque[:-4]) / 12e-4
    expected = torque[2:-2] + 2e-3 * rate
    scale = np.abs(expected).max()
    # a difference of four points of a torque that friction bends within 10 ms
    assert_close(command[2:-2], expected, rtol=0, atol=1e-6 * scale)
