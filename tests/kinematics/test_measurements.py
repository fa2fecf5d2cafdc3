"""Measurements: simulation, encoder offsets and noise, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    Measurements,
    PointInstrument,
    PoseInstrument,
)

from ..helpers import assert_close
from .arms import planar
from .calibration_arms import REFLECTORS, heavy, poses


Q = poses(1)[0]


@pytest.mark.slow
def test_simulated_readings():
    chain, instrument = heavy(), PoseInstrument(1e-4, 1e-4)

    @jax.jit
    def residuals(q, key):
        exact = Measurements.simulated(instrument, chain, q)
        noisy = Measurements.simulated(instrument, chain, q, key)
        return exact.residuals(chain), noisy.residuals(chain)

    exact, noisy = residuals(poses(300), jax.random.key(0))
    # rounding of 3 m over 1e-4 m
    assert_close(exact, np.zeros(1800), rtol=0, atol=1e-10)
    # 1800 normal numbers: their variance is uncertain by 3 %
    assert abs(np.var(noisy) - 1.0) < 0.12


def test_offsets_are_added_to_the_encoders():
    chain, instrument = planar(1.0, 1.0), PointInstrument(1e-4)
    q, offset = jnp.array([[0.2, 0.4]]), jnp.array([0.01, -0.02])
    measured = Measurements(
        instrument,
        q,
        jax.vmap(lambda x: instrument.predict(chain, x))(q + offset[None]),
    )
    assert_close(measured.residuals(chain, offset), np.zeros(3), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_whitening_of_encoder_noise():
    """Residuals of an arm with noisy encoders are uncorrelated, of variance one."""
    chain, instrument = heavy(), PointInstrument(5e-5, REFLECTORS)
    encoders = jnp.full(6, 1e-4)
    q = jnp.broadcast_to(Q, (2000, 6))

    @jax.jit
    def run(key):
        measured = Measurements.simulated(instrument, chain, q, key, encoders)
        whitening = measured.whitening(chain)
        white = measured.residuals(chain, None, whitening)
        return whitening, measured.residuals(chain), white

    whitening, raw, white = run(jax.random.key(1))
    raw, white = (np.asarray(x).reshape(-1, 9) for x in (raw, white))
    assert np.var(raw) > 4.0  # 1e-4 rad at 2 m against 5e-5 m
    # entries of a covariance from 2000 samples scatter by 2 to 3 %
    assert_close(np.cov(white.T), np.eye(9), rtol=0, atol=0.12)
    # (3-137) by hand
    slope = jax.jacfwd(lambda x: instrument.predict(chain, x).reshape(-1))(Q) / 5e-5
    covariance = np.eye(9) + slope @ np.diag(encoders**2) @ slope.T
    factor = np.asarray(whitening[0])
    assert_close(factor @ covariance @ factor.T, np.eye(9), rtol=0, atol=1e-10)
    exact = Measurements(instrument, q[:1], np.zeros((1, 3, 3)))
    assert exact.whitening(chain) is None


def test_refusals():
    q = poses(3)
    readings = np.zeros((3, 1, 3))
    with pytest.raises(ValueError, match=r"shape \(3, 3, 3\), but have the shape"):
        Measurements(PointInstrument(1e-4, REFLECTORS), q, readings)
    readings[1] = np.nan
    with pytest.raises(ValueError, match=r"leave out the poses \[1\]"):
        Measurements(PointInstrument(1e-4), q, readings)
    readings[1] = 0.0
    with pytest.raises(ValueError, match="`joint_deviation` must have one entry"):
        Measurements(PointInstrument(1e-4), q, readings, jnp.ones(2))
    with pytest.raises(ValueError, match="`joint_deviation` must not be negative"):
        Measurements(PointInstrument(1e-4), q, readings, -jnp.ones(6))
