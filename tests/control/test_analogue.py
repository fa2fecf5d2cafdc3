"""Cascade over an analogue current loop: steady states, law, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import MotorSetpoint
from elastax.robots import manutec_r3_control

from tests.helpers import assert_close


CONTROL = manutec_r3_control()
ANGLE = jnp.linspace(-1.0, 1.0, 6)
LOAD = jnp.array([100.0, -300.0, 80.0, 20.0, -10.0, 5.0])
ZERO = jnp.zeros(6)
SETPOINT = MotorSetpoint(ANGLE, ZERO, ZERO, ZERO)


def test_a_load_is_held_at_rest():
    """At the setpoint nothing changes, and the current brings the load."""
    memory = CONTROL.resting_memory(SETPOINT, LOAD, ZERO)
    assert memory.shape == (CONTROL.states, 6)
    still = CONTROL.rates(SETPOINT, ANGLE, ZERO, memory)
    # rounding of currents up to 60 A over times of 1e-6 s
    assert_close(still, np.zeros((3, 6)), rtol=0, atol=1e-7)
    torque = CONTROL.torque(SETPOINT, ANGLE, ZERO, ZERO, LOAD, memory)
    assert_close(torque, LOAD, rtol=1e-14)


def test_away_from_the_setpoint_only_the_integrator_moves():
    theta = ANGLE - 0.01
    memory = CONTROL.steady_memory(SETPOINT, theta, LOAD)
    rates = CONTROL.rates(SETPOINT, theta, ZERO, memory)
    error = 5.0 * np.asarray(CONTROL.ratio) * 0.01  # kp = 5 1/s, motor side
    assert_close(rates[0], error / 0.05, rtol=1e-12)
    assert_close(rates[1:], np.zeros((2, 6)), rtol=0, atol=1e-7)


def test_current_loop_has_the_frequency_and_damping_of_its_motor():
    """Poles of voltage and current at a locked rotor: w^2 and 2 D w."""

    def rates(electric):
        memory = jnp.concatenate([ZERO[None], electric])
        return CONTROL.rates(SETPOINT, ANGLE, ZERO, memory)[1:]

    matrix = jax.jacfwd(rates)(jnp.zeros((2, 6)))
    for k, (w, damping) in enumerate([(4590.0, 0.6), (5500.0, 0.6)]):
        block = np.asarray(matrix)[:, k, :, k]
        assert_close(-np.trace(block), 2 * damping * w, rtol=1e-12)
        assert_close(np.linalg.det(block), w**2, rtol=1e-12)


@pytest.mark.parametrize("name", ["inductance", "speed_gain", "amplification"])
def test_refusals(name):

    value = -getattr(CONTROL, name)
    with pytest.raises(ValueError, match=f"`{name}` must be positive"):
        dataclasses.replace(CONTROL, **{name: value})
