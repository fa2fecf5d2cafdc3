"""Figures of a run against closed forms."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import criterion, judge
from elastax.dynamics import SimulationResult

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


def test_criterion_of_the_vectors():
    """Decaying vibrations; linear pieces of 5 us leave 1e-8."""
    (vector,) = load_vectors("Reiner 6.1")
    t = jnp.linspace(0.0, 1.0, 200_001)[:, None]
    size, decay, rate, offset = jnp.array(
        [[1.0, 4.0, 40.0, 0.0], [0.5, 3.0, 55.0, 0.0], [0.8, 5.0, 35.0, 9.81]]
    ).T[:, None]
    a = size * jnp.exp(-decay * t) * jnp.sin(rate * t) + offset
    window = vector["inputs"]["T"]
    value = jax.jit(criterion)(t[:, 0], a, jnp.array(0.0), window)
    assert_close(value, vector["outputs"]["C"], rtol=vector["tol"])


def test_criterion_is_exact_for_linear_pieces():
    """A triangle of height 1 on a window that cuts pieces of the samples."""
    times = jnp.linspace(0.0, 2.0, 9)
    triangle = jnp.interp(times, jnp.array([0.0, 1.0, 2.0]), jnp.array([0.0, 1.0, 0.0]))
    acceleration = jnp.stack([triangle, 0 * triangle, 9.81 + 0 * triangle], axis=1)
    # over [0, 2] the mean is 1/2 and |a - 1/2| has the area 1/2
    value = criterion(times, acceleration, jnp.array(0.0), 2.0)
    assert_close(value, 0.5, rtol=1e-14)
    # over [0.1, 0.9] the line runs from 0.1 to 0.9: mean 1/2, two triangles 0.4 x 0.4
    value = criterion(times, acceleration, jnp.array(0.1), 0.8)
    assert_close(value, 0.16, rtol=1e-13)


def run_with(position, wrist, tau_m, times) -> SimulationResult:
    """A simulation result in which only what is judged matters."""
    n = len(times)
    one, six = np.zeros((n, 1)), np.zeros((n, 6))
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, 3] = position
    arrays = [one, one[:, :0], one] * 3
    tau = np.broadcast_to(tau_m, (n, 1))
    fields = (times, *arrays, tau, -2.0 * tau, pose, six, six, wrist, np.array(7))
    return SimulationResult(*map(jnp.asarray, fields))


@pytest.fixture(scope="module")
def robot():
    return systems.two_mass_oscillator(load=1.0, rotor=1.0, stiffness=1.0, damping=1.0)


def test_figures_of_a_decaying_error(robot):
    """Constant offset of 3 mm along x, a decaying one of 4 mm along y."""
    times = np.linspace(0.0, 2.0, 4001)
    rest, decay = 0.5, 8.0
    swing = 4e-3 * np.exp(-decay * times)
    path = np.stack([times, 0 * times, 0 * times], axis=1)
    position = path + np.stack([3e-3 + 0 * times, swing, 0 * times], axis=1)
    result = run_with(position, 0 * path, np.sin(times)[:, None], times)
    figures = jax.jit(judge)(robot, result, jnp.asarray(path), jnp.array(rest))
    end = rest + 0.9
    assert_close(figures.rest_time, rest, rtol=0)
    assert_close(figures.path_error_max, 5e-3, rtol=1e-12)
    relative = 4e-3 * (1 - np.exp(-decay * times))
    within = times <= end + 1e-9
    assert_close(figures.path_error_max_relative, relative[within][-1], rtol=1e-9)
    integral = 4e-3 * (end - (1 - np.exp(-decay * end)) / decay)
    assert_close(figures.path_error_integral_relative, integral, rtol=1e-5)
    fine = np.linspace(0.0, end, 100_001)
    whole = np.trapezoid(np.hypot(3e-3, 4e-3 * np.exp(-decay * fine)), fine)
    assert_close(figures.path_error_integral, whole, rtol=1e-5)
    assert_close(figures.path_error, np.hypot(3e-3, swing), rtol=1e-9)
    assert_close(figures.criterion, 0.0, rtol=0)
    # torques: motor side through the ratio of 10, output side as they are
    assert_close(figures.peak_motor_torque, [0.1], rtol=1e-6)
    assert_close(figures.peak_gear_torque, [2.0], rtol=1e-6)


@pytest.mark.slow
def test_settling_time(robot):
    """The tool stays within 0.1 mm of its final place from the known time on."""
    times = np.linspace(0.0, 2.0, 4001)
    rest, decay = 0.3, 6.0
    swing = 2e-3 * np.exp(-decay * np.maximum(times - rest, 0.0))
    position = np.stack([swing, 0 * times, 0 * times], axis=1)
    result = run_with(position, 0 * position, np.zeros(1), times)
    figures = judge(robot, result, 0 * jnp.asarray(position), jnp.array(rest))
    final = swing[-1]
    settled = np.log(2e-3 / (1e-4 + final)) / decay
    # the last sample outside: one sample of 0.5 ms
    assert_close(figures.settling_time, settled, rtol=0, atol=5.1e-4)
    still = run_with(0 * position, 0 * position, np.zeros(1), times)
    figures = judge(robot, still, 0 * jnp.asarray(position), jnp.array(rest))
    assert_close(figures.settling_time, 0.0, rtol=0)
    assert_close(figures.path_error_max, 0.0, rtol=0)


@pytest.mark.slow
def test_gradient(robot):
    """Also without any error, where the norm has a corner."""
    times = np.linspace(0.0, 1.5, 16)
    wave = 1e-3 * np.stack([np.sin(9 * times), np.cos(5 * times), times], axis=1)
    result = run_with(wave, 50.0 * wave, np.ones(1), times)

    def figures(pose, wrist, result):
        moved = dataclasses.replace(result, tool_pose=pose, wrist_acceleration=wrist)
        j = judge(robot, moved, jnp.zeros((16, 3)), jnp.array(0.31))
        return j.criterion, j.path_error_integral, j.path_error_integral_relative

    plain = functools.partial(figures, result=result)
    assert_gradient(plain, result.tool_pose, result.wrist_acceleration)
    still = result.tool_pose.at[:, :3, 3].set(0.0)
    gradient = jax.grad(lambda pose: plain(pose, 0 * result.wrist_acceleration)[1])
    assert np.all(np.isfinite(gradient(still)))
