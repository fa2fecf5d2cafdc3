"""Simulation against closed forms, balances and derivatives."""

import dataclasses

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from elastax.control import IdealMotorControl
from elastax.dynamics import (
    MotorCommand,
    dissipated_power,
    kinetic_energy,
    potential_energy,
    simulate,
)

from tests import systems
from tests.helpers import assert_close


MASSES = {"load": 2.5, "rotor": 1.5, "stiffness": 9e3, "damping": 6.0}
TORQUE = 30.0
TIMES = np.linspace(0.0, 0.3, 61)


def step_response(robot, torque, *, rtol=1e-8, **options):
    """Motion after a step of the motor torque."""
    command = systems.constant_command(TIMES, jnp.zeros((1,)), torque[None])
    return simulate(
        robot, command, systems.TorqueControl(), rtol=rtol, atol=1e-11, **options
    )


step_response_jit = eqx.filter_jit(step_response)


@pytest.mark.slow
def test_two_mass_oscillator():
    """Damped oscillation and the torque in the gear, to the solver's tolerance."""
    robot = systems.two_mass_oscillator(**MASSES)
    result = step_response_jit(robot, jnp.array(TORQUE))
    q, theta = systems.two_mass_response(TIMES, torque=TORQUE, **MASSES)
    scale = np.abs(q).max()
    assert_close(result.q[:, 0], q, rtol=0, atol=1e-7 * scale)
    assert_close(result.theta[:, 0], theta, rtol=0, atol=1e-7 * scale)
    # what the gear transmits accelerates the load
    qdd = result.qdd[:, 0]
    assert_close(result.tau_gear[:, 0], MASSES["load"] * qdd, rtol=1e-12, atol=1e-9)
    assert_close(result.tau_m[:, 0], np.full_like(TIMES, TORQUE), rtol=0)
    # the tool is at the end of a link of 1 m
    position = np.stack([np.cos(result.q), np.sin(result.q)], axis=1)[..., 0]
    assert_close(result.tool_pose[:, :2, 3], position, rtol=1e-14)
    assert_close(result.tool_velocity[:, 5], result.qd[:, 0], rtol=1e-14)
    assert_close(result.tool_acceleration[:, 5], qdd, rtol=1e-14)
    assert 0 < result.steps < 1000


def test_energy_balance():
    """A falling arm: what it loses in energy its friction and dampers take."""
    cylinder = systems.spring_counterbalance(60.0)
    robot = systems.elastic_2r(counterbalance=cylinder, hinge_hardening=50.0)
    steep = systems.friction(np.full(2, 8.0), 3.0, 20.0)
    drives = dataclasses.replace(robot.drives, motor_friction=steep)
    robot = dataclasses.replace(robot, drives=drives)
    times = np.linspace(0.0, 0.4, 1601)
    torque = jnp.array([25.0, -6.0])
    command = systems.constant_command(times, jnp.array([0.4, -0.9]), torque)

    def account(robot):
        motion = simulate(
            robot, command, systems.TorqueControl(), rtol=1e-9, atol=1e-12
        )

        def energies(q, eta, theta, qd, etad, thetad, tau_m):
            total = kinetic_energy(robot, q, eta, qd, etad, thetad)
            total = total + potential_energy(robot, q, eta, theta)
            lost = dissipated_power(robot, q, theta, qd, etad, thetad)
            return total, lost, jnp.sum(tau_m * thetad)

        fields = ("q", "eta", "theta", "qd", "etad", "thetad", "tau_m")
        return jax.vmap(energies)(*(getattr(motion, name) for name in fields))

    energy, lost, given = systems.run(account, robot)
    integral = lambda power: scipy.integrate.cumulative_simpson(
        power, x=times, initial=0.0
    )
    lost, given = integral(lost), integral(given)
    assert lost[-1] > 1.0 and np.ptp(energy) > 1.0
    # ten times the relative tolerance of the solver, of the energy turned over
    bound = 1e-8 * (lost[-1] + np.ptp(energy))
    assert_close(energy - energy[0], given - lost, rtol=0, atol=bound)


@pytest.mark.slow
def test_reverse_gradient_is_a_finite_difference():
    robot = systems.two_mass_oscillator(**MASSES)

    def cost(stiffness):
        moved = eqx.tree_at(lambda r: r.drives.stiffness.linear, robot, stiffness[None])
        motion = step_response(
            moved, jnp.array(TORQUE), rtol=1e-10, max_steps=256, solver=dfx.Dopri8()
        )
        return jnp.mean(motion.tool_pose[:, 1, 3] ** 2) + motion.theta[-1, 0]

    value = MASSES["stiffness"]
    both = jax.jit(jax.value_and_grad(cost))
    _, gradient = both(jnp.array(value))
    step = 1e-4 * value
    ahead, _ = both(jnp.array(value + step))
    behind, _ = both(jnp.array(value - step))
    # the solver's tolerance over the step, and the step's square
    assert_close(gradient, (ahead - behind) / (2 * step), rtol=1e-5)


@pytest.mark.slow
def test_vmap_is_a_loop():
    robots = [
        systems.two_mass_oscillator(**(MASSES | {"stiffness": c})) for c in (2e3, 5e4)
    ]
    stacked = jax.tree.map(
        lambda *x: jnp.stack(x) if eqx.is_array(x[0]) else x[0], *robots
    )
    together = eqx.filter_jit(eqx.filter_vmap(step_response, in_axes=(0, None)))(
        stacked, jnp.array(TORQUE)
    )
    for k, robot in enumerate(robots):
        alone = step_response_jit(robot, jnp.array(TORQUE))
        assert_close(together.q[k], alone.q, rtol=0, atol=1e-12)
        assert int(together.steps[k]) == int(alone.steps)


@pytest.mark.slow
def test_ideal_control_imposes_the_motors():
    """The load swings on its gear behind motors that move as commanded."""
    robot = systems.two_mass_oscillator(**MASSES)
    rows = systems.smooth_motion([0.0], [0.2], 0.2, TIMES, 2)
    zero = np.zeros_like(rows[0])
    command = MotorCommand(TIMES, *rows, zero, zero, zero, zero[:, :0])

    @eqx.filter_jit
    def motion(robot):
        return simulate(robot, command, IdealMotorControl(), rtol=1e-8, atol=1e-11)

    result = motion(robot)
    assert_close(result.theta, rows[0], rtol=0, atol=1e-15)
    # convolution of the base motion with the oscillator's impulse response
    load, c, d = MASSES["load"], MASSES["stiffness"], MASSES["damping"]
    decay = d / (2 * load)
    omega = np.sqrt(c / load - decay**2)
    fine = np.linspace(0.0, TIMES[-1], 12001)
    theta, thetad = systems.smooth_motion([0.0], [0.2], 0.2, fine, 1)[..., 0]
    push = (c * theta + d * thetad) / load
    last = TIMES[-1] - fine
    kernel = np.exp(-decay * last) * np.sin(omega * last) / omega
    # the command is interpolated over 5 ms: fourth order in the step
    q = scipy.integrate.simpson(kernel * push, x=fine)
    assert_close(result.q[-1, 0], q, rtol=0, atol=1e-5)
    balance = np.asarray(result.tau_m - MASSES["rotor"] * result.thetadd)
    assert result.thetadd.shape == balance.shape


def test_rigid_gears_are_refused():
    robot = systems.two_mass_oscillator(**MASSES).rigid()
    command = systems.constant_command(TIMES, jnp.zeros((1,)), jnp.zeros((1,)))
    with pytest.raises(ValueError, match="elastic gears"):
        simulate(robot, command, systems.TorqueControl())
