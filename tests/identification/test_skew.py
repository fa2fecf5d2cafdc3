"""Skew of two encoders."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.identification import estimate_skew

from tests.helpers import assert_close, assert_gradient


TIMES = np.arange(2001) * 2e-3
PHASE = 2 * np.pi * TIMES[:, None] * np.array([0.5, 0.75])
SPEED = jnp.asarray(np.cos(PHASE) + 0.1)
DELAY = np.array([3e-3, -1e-3])
CONSTANT = np.array([0.02, -0.01])


def angles(residual=0.0):
    motor = np.cumsum(np.asarray(SPEED), axis=0) * 2e-3
    link = motor - DELAY * np.asarray(SPEED) - CONSTANT - residual
    return jnp.asarray(motor), jnp.asarray(link)


def test_recovers_delay_and_constant():
    motor, link = angles()
    skew = estimate_skew(motor, link, SPEED)
    assert_close(skew.delay, DELAY, rtol=1e-12)
    assert_close(skew.constant, CONSTANT, rtol=1e-12)
    assert_close(skew.residual, np.zeros(link.shape), rtol=0.0, atol=1e-14)


def test_residual_is_orthogonal():
    """The law of least squares: nothing of speed or constant is left."""
    motor, link = angles(1e-3 * np.random.default_rng(0).standard_normal((2001, 2)))
    residual = np.asarray(estimate_skew(motor, link, SPEED).residual)
    scale = 1e-3 * len(TIMES)
    assert np.all(np.abs(residual.sum(axis=0)) < 1e-12 * scale)
    assert np.all(np.abs((residual * np.asarray(SPEED)).sum(axis=0)) < 1e-12 * scale)


def test_time_shift_of_a_real_motion():
    """A true delay instead of the linear form; the error is of second order."""
    delay = 3e-3
    link = jnp.asarray(np.sin(2 * np.pi * 0.5 * (TIMES - delay)))
    motor = jnp.asarray(np.sin(2 * np.pi * 0.5 * TIMES))
    speed = jnp.asarray(np.pi * np.cos(2 * np.pi * 0.5 * TIMES))
    skew = estimate_skew(motor, link, speed)
    assert_close(skew.delay, delay, rtol=(np.pi * delay) ** 2)


def test_axis_at_rest():
    rest = jnp.zeros((100,))
    skew, gradient = jax.value_and_grad(
        lambda speed: estimate_skew(rest + 1.0, rest, speed).delay
    )(rest)
    assert float(skew) == 0.0
    assert np.all(np.isfinite(gradient))


def test_vmap_and_jit_are_the_loop():
    motor, link = angles()
    both = jax.jit(estimate_skew)(motor, link, SPEED)
    mapped = jax.vmap(estimate_skew, in_axes=1, out_axes=-1)(motor, link, SPEED)
    single = [estimate_skew(motor[:, k], link[:, k], SPEED[:, k]) for k in range(2)]
    loop = jax.tree.map(lambda *x: jnp.stack(x, axis=-1), *single)
    assert_close(both, loop, rtol=1e-12, atol=1e-14)
    assert_close(mapped, loop, rtol=1e-12, atol=1e-14)


def test_gradient():
    motor, link = angles(1e-3)
    assert_gradient(
        lambda m, s: estimate_skew(m, link[::100], s).delay, motor[::100], SPEED[::100]
    )


@pytest.mark.parametrize("scale", [1e-290, 1e150])
def test_extremes(scale):
    motor, link = angles()
    skew = estimate_skew(scale * motor, scale * link, scale * SPEED)
    assert_close(skew.delay, DELAY, rtol=1e-10)
