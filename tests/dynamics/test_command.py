"""Motor commands between their samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import CommandInterpolant, MotorCommand, MotorSample

from tests import systems
from tests.helpers import assert_close


def sine_command(dt: float) -> MotorCommand:
    times = dt * np.arange(round(0.5 / dt) + 1)
    sine, cosine = np.sin(9.0 * times)[:, None], np.cos(9.0 * times)[:, None]
    zero = np.zeros_like(sine)
    return MotorCommand(
        times, sine, 9.0 * cosine, -81.0 * sine, 5.0 * cosine, zero, zero, zero[:, :0]
    )


def errors(dt: float) -> np.ndarray:
    """Largest errors of angle, speed, acceleration and torque between samples."""
    t = jnp.linspace(0.1, 0.4, 200)
    setpoints = jax.jit(jax.vmap(CommandInterpolant(sine_command(dt))))(t)
    sine, cosine = np.sin(9.0 * t), np.cos(9.0 * t)
    exact = {
        "theta": sine,
        "thetad": 9.0 * cosine,
        "thetadd": -81.0 * sine,
        "tau_m": 5.0 * cosine,
    }
    return np.array(
        [
            np.abs(getattr(setpoints, name)[:, 0] - value).max() / np.abs(value).max()
            for name, value in exact.items()
        ]
    )


@pytest.mark.slow
def test_order_of_the_interpolation():
    """Fourth order with known slopes, third with slopes by differences."""
    coarse, fine = errors(0.02), errors(0.01)
    order = np.log2(coarse / fine)
    assert np.all(order[:2] > 3.8)
    assert np.all(order[2:] > 2.8)
    # h^4 / 384 times the fourth derivative
    assert np.all(coarse[:2] < 1.1 * (9.0 * 0.02) ** 4 / 384.0)


def test_last_sample_holds_on():
    command = sine_command(0.02)
    setpoint = systems.setpoint(command, 3.0)
    assert_close(setpoint.theta, command.theta[-1], rtol=0)
    assert_close(setpoint.tau_m, command.tau_m[-1], rtol=0)


def test_command_from_samples():
    command = sine_command(0.1)
    names = ("theta", "thetad", "thetadd", "tau_m", "tau_a", "q", "eta")
    sample = lambda k: MotorSample(*(getattr(command, name)[k] for name in names))
    samples = jax.tree.map(lambda *x: jnp.stack(x), *(sample(k) for k in range(6)))
    assert_close(MotorCommand.from_samples(command.times, samples), command, rtol=0)
