"""Steps of the simulation: their length, their cost, derivatives through them."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.control import CascadeMotorControl
from elastax.dynamics import MotorSetpoint, resting_state, simulate

from tests import systems
from tests.helpers import assert_close


MASSES = {"load": 2.5, "rotor": 1.5, "stiffness": 9e3, "damping": 6.0}
TIMES = np.linspace(0.0, 0.2, 101)  # every 2 ms


def response(stiffness, *, rotor=1.5, damping=6.0, **options):
    """Motion of the two masses after a step of the torque."""
    masses = MASSES | {"rotor": rotor, "damping": damping}
    robot = systems.two_mass_oscillator(**masses)
    robot = eqx.tree_at(lambda r: r.drives.stiffness.linear, robot, stiffness[None])
    command = systems.constant_command(TIMES, jnp.zeros((1,)), jnp.array([[30.0]]))
    return simulate(robot, command, systems.TorqueControl(), **options)


STIFFNESS = jnp.array(MASSES["stiffness"])


@pytest.mark.slow
def test_constant_steps_cost_what_they_cost():
    """As many steps as asked for, and the closed form to the solver's fifth order."""

    @eqx.filter_jit
    def motion(stiffness):
        controller = dfx.ConstantStepSize()
        return response(stiffness, stepsize_controller=controller, step=1e-3)

    result, count = motion(STIFFNESS), 200
    assert int(result.steps) == count
    q, theta = systems.two_mass_response(TIMES, torque=30.0, **MASSES)
    # the local error of a step, (98 rad/s * step)^6 / 6!, adds up over the steps
    bound = count * (98.0 * TIMES[-1] / count) ** 6 / 720.0
    assert_close(result.q[:, 0], q, rtol=0, atol=bound * np.abs(q).max())
    assert_close(result.theta[:, 0], theta, rtol=0, atol=bound * np.abs(theta).max())


@pytest.mark.slow
def test_default_step_is_a_sample():
    """Within ten tolerances of a much finer run, with no more steps than samples."""
    motion = eqx.filter_jit(
        lambda rtol, atol: response(STIFFNESS, rtol=rtol, atol=atol)
    )
    coarse = motion(jnp.array(1e-6), jnp.array(1e-9))
    fine = motion(jnp.array(1e-10), jnp.array(1e-13))
    assert int(coarse.steps) <= TIMES.size + 20 < int(fine.steps)
    for name in ("q", "theta", "qd", "thetad", "qdd", "tau_gear"):
        wanted = getattr(fine, name)
        scale = float(jnp.max(jnp.abs(wanted)))
        assert_close(getattr(coarse, name), wanted, rtol=0, atol=1e-5 * scale)


def test_fast_modes_are_followed_by_shorter_steps():
    """A light rotor is faster than a sample: the steps must not stay that long."""
    light = {"rotor": 1e-3, "damping": 0.6}
    motion = eqx.filter_jit(lambda stiffness: response(stiffness, **light))
    result = motion(STIFFNESS)
    # sqrt(9e3 / 1e-3) = 3000 rad/s; explicit steps are stable up to 3.3 over that
    assert int(result.steps) > TIMES[-1] * 3000.0 / 3.3
    _, theta = systems.two_mass_response(TIMES, torque=30.0, **(MASSES | light))
    assert_close(result.theta[:, 0], theta, rtol=0, atol=1e-5 * np.abs(theta).max())


@pytest.mark.slow
def test_forward_and_reverse_derivatives_agree():
    def end(stiffness, adjoint):
        return response(stiffness, adjoint=adjoint).q[-1, 0]

    forward = jax.jit(jax.jacfwd(lambda k: end(k, dfx.ForwardMode())))(STIFFNESS)
    bounded = dfx.RecursiveCheckpointAdjoint(checkpoints=7)
    reverse = jax.jit(jax.grad(lambda k: end(k, bounded)))(STIFFNESS)
    # the same steps, differentiated: rounding
    assert_close(reverse, forward, rtol=1e-9)


def test_resting_state_and_its_derivative():
    """Motors give way to the gears' load by the loop's stiffness."""
    robot = systems.elastic_2r()
    zero = jnp.zeros((2,))
    setpoint = MotorSetpoint(
        jnp.array([0.4, -0.9]), zero, zero, jnp.array([25.0, -6.0])
    )
    inertia = robot.drives.reflected_inertia()

    def rest(gain):
        controller = CascadeMotorControl(position_gain=gain)
        q, eta, theta = resting_state(robot, setpoint, controller)
        return q, eta, theta

    gain = jnp.array(15.0)
    q, _, theta = jax.jit(rest)(gain)
    load = -robot.drives.gear_torque(q - theta, zero)
    stiffness = inertia * 60.0 * gain
    assert_close(
        theta, setpoint.theta + (setpoint.tau_m - load) / stiffness, rtol=1e-12
    )
    theta_of = lambda gain: rest(gain)[2]
    slope = jax.jit(jax.jacrev(theta_of))(gain)
    step = 1e-3
    ahead, behind = jax.jit(jax.vmap(theta_of))(jnp.stack([gain + step, gain - step]))
    assert_close(slope, (ahead - behind) / (2 * step), rtol=1e-6)
