"""Slipping springs from loops: recovery, noise, unknown start, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import PrandtlIshlinskii
from elastax.identification import fit_hysteresis, suggest_thresholds

from tests.helpers import assert_close


THRESHOLDS = np.array([5e-4, 1.2e-3, 2.5e-3])
STIFFNESS = np.array([2e4, 0.0, 1.5e4])
LINEAR, HARDENING, OFFSET = 1e5, 3e4, 12.0


def loop(start=0.0):
    """Torsion of falling and rising amplitude, and its torque, plays from `start`."""
    phase = np.linspace(0.0, 8.0 * np.pi, 1500)
    x = 5e-3 * np.sin(phase) * (0.65 + 0.35 * np.cos(0.31 * phase))
    stops = PrandtlIshlinskii(-STIFFNESS, THRESHOLDS, start * THRESHOLDS)
    slip = np.asarray(stops.apply(jnp.asarray(x))) + np.sum(STIFFNESS) * x
    return x, LINEAR * (1.0 + HARDENING * x**2) * x + slip + OFFSET


@pytest.mark.parametrize("start", [0.0, 1.0, -0.7])
def test_recovers_the_springs_whatever_the_plays_start_from(start):
    x, torque = loop(start)
    fit = fit_hysteresis(x, torque, THRESHOLDS)
    assert 0 < fit.first < len(x) // 4
    assert len(fit.residual) == len(x) - fit.first
    # rounding of torques of 600 N m, by the condition of the columns, 50
    assert_close(fit.spring.linear, LINEAR, rtol=1e-10)
    assert_close(fit.spring.hardening, HARDENING, rtol=1e-9)
    assert_close(fit.stiffness, STIFFNESS, rtol=1e-9, atol=1e-5)
    assert_close(fit.offset, OFFSET, rtol=1e-9)
    assert fit.deviation < 1e-10


def test_negative_stiffness_is_not_taken_and_noise_is_the_residual():
    x, torque = loop()
    noise = np.random.default_rng(0).normal(0.0, 2.0, x.shape)
    fit = fit_hysteresis(x, torque + noise, np.sort([*THRESHOLDS, 1.8e-3]))
    assert np.all(fit.stiffness >= 0)
    assert abs(fit.deviation - 2.0) < 0.1  # 2 per cent at 1400 samples
    # the energy of the largest loop, 4 c r (A - r), is what the noise leaves in place
    energy = lambda c, r: np.sum(4.0 * c * r * (5e-3 - r))
    expected = energy(STIFFNESS, THRESHOLDS)
    assert_close(energy(fit.stiffness, fit.thresholds), expected, rtol=0.03)


def test_a_reversed_loop_has_no_slipping_springs():
    # a torque that delivers energy cannot be fitted by springs that slip
    x, torque = loop()
    plain = LINEAR * (1.0 + HARDENING * x**2) * x + OFFSET
    fit = fit_hysteresis(x, 2.0 * plain - torque, THRESHOLDS)
    assert_close(fit.stiffness, np.zeros(3), rtol=0.0)
    assert fit.deviation > 5.0


def test_suggested_thresholds_describe_a_loop_of_others():
    x, torque = loop()
    thresholds = suggest_thresholds(x, 9)
    assert_close(thresholds, np.arange(1, 10) * 0.05 * np.ptp(x), rtol=1e-12)
    fit = fit_hysteresis(x, torque, thresholds)
    # kinks off by up to 2.5e-4 rad of springs of 2e4 N m/rad: a share of 5 N m
    assert fit.deviation < 1.0
    coarse = fit_hysteresis(x, torque, suggest_thresholds(x, 1))
    assert coarse.deviation > 2.0 * fit.deviation


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda x, t: (x, t * np.nan, THRESHOLDS), "must be finite"),
        (lambda x, t: (x, t, THRESHOLDS[::-1]), "must be positive and increase"),
        (lambda x, t: (x, t, THRESHOLDS - 5e-4), "must be positive and increase"),
        (lambda x, t: (x, t, 3.0 * THRESHOLDS), "below half of the stroke"),
        (lambda x, t: (x, -t, THRESHOLDS), "must rise with the torsion"),
        (lambda x, t: (x[:9] * 0.0, t[:9], THRESHOLDS), "below half of the stroke"),
        (
            lambda x, t: (
                np.array([5e-3, -5e-3, 5e-3, -5e-3]),
                np.array([1.0, -1.0, 1.0, -1.0]),
                THRESHOLDS,
            ),
            "must tell the springs apart",
        ),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        fit_hysteresis(*change(*loop()))


def test_refusals_of_a_suggestion():
    with pytest.raises(ValueError, match="`number` must be at least 1"):
        suggest_thresholds(np.arange(3.0), 0)
    with pytest.raises(ValueError, match="`torsion` must move"):
        suggest_thresholds(np.ones(3), 2)
