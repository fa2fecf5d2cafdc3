"""Rigid and flexible-joint inverses against each other and against the plant."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.control import CascadeMotorControl, IdealMotorControl
from elastax.dynamics import forward_dynamics, simulate
from elastax.inverse import (
    ASIM,
    FlexibleJointInverse,
    PositionCorrection,
    RigidInverse,
    feedforward_by_steps,
)
from elastax.structure import CubicStiffness, LimitedStiffness, LinearStiffness

from tests import systems
from tests.helpers import assert_close, assert_gradient


START, CHANGE = [0.3, -0.9], [0.4, 0.5]
LINEAR = np.array([3e4, 2e4])
SPRINGS = {
    "linear": LinearStiffness(LINEAR),
    "cubic": CubicStiffness(LINEAR, np.array([500.0, 900.0])),
    "limited": LimitedStiffness(
        LINEAR, np.array([500.0, 900.0]), 1.2 * LINEAR, 10.0 / LINEAR
    ),
}


def flexible_arm(spring):
    robot = systems.elastic_2r().flexible_joint()
    drives = dataclasses.replace(robot.drives, stiffness=spring)
    return dataclasses.replace(robot, drives=drives)


@eqx.filter_jit
def feedforward(inverse, model, reference):
    return inverse.feedforward(model, reference)


@eqx.filter_jit
def by_steps(inverse, model, reference):
    return feedforward_by_steps(inverse, model, reference)


@pytest.fixture(scope="module")
def reference():
    return systems.smooth_reference(START, CHANGE, 0.3, settle=0.1)


@pytest.mark.parametrize("name", SPRINGS)
def test_command_moves_the_plant_along_the_reference(name):
    """The plant's accelerations under the command are those of the reference."""
    reference = systems.smooth_reference(START, CHANGE, 0.3, dt=2.5e-4)
    robot = flexible_arm(SPRINGS[name])
    command = feedforward(FlexibleJointInverse(), robot, reference)

    @jax.jit
    @jax.vmap
    def accelerations(q, qd, theta, thetad, tau_m):
        none = jnp.zeros((0,))
        return forward_dynamics(robot, q, none, theta, qd, none, thetad, tau_m)

    q, qd, qdd = reference.derivatives[:3]
    got, _, motors = accelerations(q, qd, command.theta, command.thetad, command.tau_m)
    scale = float(jnp.max(jnp.abs(qdd)))
    assert_close(got, qdd, rtol=0, atol=1e-9 * scale)
    assert_close(motors, command.thetadd, rtol=0, atol=1e-9 * scale)
    # speeds and accelerations are the derivatives of the motor angles; the torsion's
    # error of third order in the sample counts times stiffness over damping, squared
    for value, rate, bound in (
        (command.theta, "thetad", 3e-7),
        (command.thetad, "thetadd", 3e-5),
    ):
        value = np.asarray(value)
        slope = (8 * (value[3:-1] - value[1:-3]) - value[4:] + value[:-4]) / 3e-3
        desired = np.asarray(getattr(command, rate))[2:-2]
        assert_close(slope, desired, rtol=0, atol=bound * np.abs(desired).max())


@pytest.mark.slow
def test_plant_follows_to_the_tolerance_of_the_solver(reference):
    """Under the exact inverse nothing is left to the controllers."""
    robot = flexible_arm(SPRINGS["limited"])

    @eqx.filter_jit
    def drive(robot, controller):
        command = FlexibleJointInverse().feedforward(robot, reference)
        motion = simulate(robot, command, controller, rtol=1e-9, atol=1e-11)
        return command, motion

    # a command sampled at 1 ms and interpolated: angles to fourth order, 9e-10 and
    # 2e-9 rad here, torques to third order, 3e-7 and 7e-7 rad
    for controller, bound in (
        (CascadeMotorControl(), 1e-6),
        (IdealMotorControl(), 1e-8),
    ):
        command, motion = drive(robot, controller)
        assert_close(motion.q, reference.positions, rtol=0, atol=bound)
        assert_close(motion.theta, command.theta, rtol=0, atol=1.5 * bound)
        peak = float(jnp.max(jnp.abs(command.tau_m)))
        assert_close(motion.tau_m, command.tau_m, rtol=0, atol=1e-4 * peak)


def test_stiff_gears_are_rigid(reference):
    """The difference to the rigid inverse falls with the compliance."""
    model = flexible_arm(SPRINGS["linear"])
    rigid = feedforward(RigidInverse(), model, reference)
    assert_close(rigid.theta, reference.positions, rtol=0)
    differences = []
    for factor in (1e2, 1e4):
        drives = dataclasses.replace(
            model.drives, stiffness=model.drives.stiffness.scaled(factor)
        )
        stiff = dataclasses.replace(model, drives=drives)
        command = feedforward(FlexibleJointInverse(), stiff, reference)
        differences.append(
            [
                float(jnp.max(jnp.abs(getattr(command, name) - getattr(rigid, name))))
                for name in ("theta", "tau_m")
            ]
        )
    ratio = np.divide(*differences)
    assert np.all((ratio > 80) & (ratio < 120)), ratio
    assert differences[1][1] < 1e-4 * float(jnp.max(jnp.abs(rigid.tau_m)))


def test_rigid_inverse_is_computed_torque(reference):
    model = systems.elastic_2r()
    command = feedforward(RigidInverse(), model, reference)
    rigid = model.rigid()
    q, qd, qdd = reference.derivatives[:3]
    none = jnp.zeros((0,))

    @jax.jit
    @jax.vmap
    def accelerations(q, qd, tau):
        return forward_dynamics(rigid, q, none, q, qd, none, qd, tau)[0]

    got = accelerations(q, qd, command.tau_m)
    assert_close(got, qdd, rtol=0, atol=1e-9 * float(jnp.max(jnp.abs(qdd))))


@pytest.mark.parametrize("inverse", [RigidInverse(), FlexibleJointInverse()])
def test_streaming_is_offline(inverse, reference):
    model = systems.elastic_2r()
    assert_close(
        by_steps(inverse, model, reference),
        feedforward(inverse, model, reference),
        rtol=1e-9,
        atol=1e-9,
    )


@pytest.mark.slow
def test_without_structural_elasticity_asim_is_flexible_joint(reference):
    model = systems.elastic_2r().flexible_joint()
    asim = ASIM(PositionCorrection(axes=(0, 1)))
    assert_close(
        feedforward(asim, model, reference),
        feedforward(FlexibleJointInverse(), model, reference),
        rtol=1e-11,
        atol=1e-11,
    )


@pytest.mark.slow
def test_gradient():
    model = flexible_arm(SPRINGS["cubic"])
    short = systems.smooth_reference(START, CHANGE, 0.3, dt=0.05)

    def last(drives, derivatives):
        moved = dataclasses.replace(model, drives=drives)
        reference = dataclasses.replace(short, derivatives=derivatives)
        return FlexibleJointInverse().feedforward(moved, reference).tau_m

    assert_gradient(last, model.drives, short.derivatives)


def test_refusals(reference):
    model = systems.elastic_2r()
    inverse = FlexibleJointInverse()
    low = dataclasses.replace(reference, derivatives=reference.derivatives[:3])
    with pytest.raises(ValueError, match="filter of too low an order"):
        inverse.feedforward(model, low)
    with pytest.raises(ValueError, match="filter of too low an order"):
        ASIM().feedforward(
            model, dataclasses.replace(reference, derivatives=reference.derivatives[:4])
        )
    one = dataclasses.replace(reference, derivatives=reference.derivatives[..., :1])
    with pytest.raises(ValueError, match="`elastic 2R` has 2 axes.*reference 1"):
        inverse.feedforward(model, one)
    with jax.enable_x64(False), pytest.raises(ValueError, match="double precision"):
        inverse.feedforward(model, reference)
