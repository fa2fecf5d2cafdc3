"""Limits of joints along motions, against counts by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import Arm, MotionLimits, check_motion, motion_margins

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import planar


TIMES = np.linspace(0.0, 2.0, 201)
LIMITS = MotionLimits(
    lower=np.array([-2.0, -1.0]),
    upper=np.array([2.0, 3.0]),
    velocity=np.array([4.0, 5.0]),
    acceleration=np.array([10.0, 30.0]),
    jerk=np.array([np.inf, 1e3]),
)


def sines(amplitudes=(1.0, 0.5), rate=np.pi, orders=5):
    """Sines about the middle of the ranges, derivatives along the first axis."""
    phases = rate * TIMES[None, :, None] + np.arange(orders)[:, None, None] * np.pi / 2
    waves = np.array(amplitudes) * rate ** np.arange(orders)[:, None, None]
    motion = waves * np.sin(phases)
    motion[0] += np.array([0.0, 1.0])
    return jnp.asarray(motion)


@pytest.mark.slow
def test_ratios_are_amplitudes_over_limits():
    check = check_motion(LIMITS, sines())
    amplitudes = np.array([1.0, 0.5]) * np.pi ** np.arange(4)[:, None]
    limits = [[2.0, 2.0], [4.0, 5.0], [10.0, 30.0], [np.inf, 1e3]]
    # the grid meets every crest of the waves
    assert_close(check.ratios, amplitudes / np.array(limits), rtol=1e-12, atol=1e-15)
    assert bool(check.holds)
    # crests of the position lie at a quarter of the period, those of the rate at zero
    assert TIMES[int(check.samples[0, 0])] in (0.5, 1.5)
    assert TIMES[int(check.samples[1, 0])] in (0.0, 1.0, 2.0)
    assert_close(check.slowdown, np.sqrt(np.pi**2 / 10), rtol=1e-12)


def test_slowdown_meets_the_limits():
    """A motion run slower by the factor uses the tightest limit to the full."""
    slow = float(check_motion(LIMITS, sines((1.5, 0.5), 4.0)).slowdown)
    assert slow > 1
    check = check_motion(LIMITS, sines((1.5, 0.5), 4.0 / slow))
    # crests of that rate fall between the samples, at most 0.02 rad away
    assert_close(jnp.max(check.ratios[1:]), 1.0, rtol=1e-3)


def test_margins():
    motion = sines((3.0, 0.5))
    margins = motion_margins(LIMITS, motion)
    assert margins.shape == (2, 4, 201, 2)
    # both margins of a range add up to its width over its half
    assert_close(margins[0, :3] + margins[1, :3], np.full((3, 201, 2), 2.0), rtol=1e-12)
    assert_close(jnp.min(margins[1, 0, :, 0]), -0.5, rtol=1e-12)
    assert_close(margins[:, 3, :, 0], np.ones((2, 201)), rtol=0)
    check = check_motion(LIMITS, motion)
    assert not bool(check.holds) and check.ratios[0, 0] > 1


def test_arm_and_missing_limits():
    chain = planar(0.5, 0.3)
    one = np.ones(2)
    arm = Arm(
        chain, -2 * one, 2 * one, 3 * one, one, 0 * one, {}, "planar", ("A1", "A2")
    )
    limits = MotionLimits.of_arm(arm, jerk=50 * one)
    check = check_motion(limits, sines()[:4])
    assert_close(check.ratios[1, 0], np.pi / 3, rtol=1e-12)
    assert not np.any(check.ratios[2])
    # a joint that turns forever, and one with a single end
    open_ = MotionLimits(np.array([-np.inf, 0.0]), np.array([np.inf, np.inf]))
    assert_close(check_motion(open_, sines()).ratios[0], [0.0, 0.5], rtol=1e-12)


def test_table_says_what_is_exceeded():
    text = check_motion(LIMITS, sines((3.0, 0.5))).table(TIMES)
    assert "position      150.0 % at 0.5 s !" in text
    assert "joint 2" in text and "limits are exceeded" in text
    text = str(check_motion(LIMITS, sines()))
    assert "50.0 % at sample 50" in text and "all limits hold" in text


@pytest.mark.slow
def test_gradients_and_batches():
    motion = sines()[:, ::20]
    one = np.ones(2)
    finite = MotionLimits(-2 * one, 3 * one, 4 * one, 10 * one, 50 * one)
    assert_gradient(motion_margins, finite, motion)
    slope = jax.jit(jax.jacrev(lambda m: motion_margins(LIMITS, m)))(motion)
    assert np.all(np.isfinite(slope))
    batch = jnp.stack([motion, 0 * motion])
    mapped = jax.jit(jax.vmap(check_motion, (None, 0)))(LIMITS, batch)
    loop = [check_motion(LIMITS, m) for m in batch]
    assert_close(mapped.ratios, jnp.stack([c.ratios for c in loop]), rtol=1e-14)
    # no motion at all: the root of the slowdown has no slope there
    still = jnp.zeros((4, 3, 2))
    slope = jax.jit(jax.grad(lambda m: check_motion(LIMITS, m).slowdown))(still)
    assert np.all(np.isfinite(slope))


def test_refusals():
    with pytest.raises(ValueError, match=r"\(order \+ 1, times, 2\)"):
        check_motion(LIMITS, jnp.zeros((3, 4, 3)))
    with pytest.raises(ValueError, match="at least one sample"):
        check_motion(LIMITS, jnp.zeros((3, 0, 2)))
    with pytest.raises(ValueError, match="`upper` limits must lie above"):
        MotionLimits(np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="`jerk` must hold one limit per joint"):
        MotionLimits(-np.ones(2), np.ones(2), jerk=np.ones(3))
    with pytest.raises(ValueError, match="`velocity` must be positive"):
        MotionLimits(-np.ones(2), np.ones(2), np.array([1.0, 0.0]))
