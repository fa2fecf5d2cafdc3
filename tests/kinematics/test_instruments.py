"""Instruments: predictions, residuals, noise, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DistanceInstrument,
    PointInstrument,
    PoseInstrument,
    forward_kinematics,
    rotation_from_vector,
)

from ..helpers import assert_close, assert_gradient
from .arms import planar
from .calibration_arms import REFLECTORS, TOOL, heavy, poses


ANCHORS = np.array([[2.0, 1, 0], [-1, 2, 0.5]])
INSTRUMENTS = (
    PoseInstrument([1e-5, 2e-5, 3e-5], 1e-4),
    PointInstrument(5e-5),
    PointInstrument([1e-5, 2e-5, 3e-5], REFLECTORS),
    DistanceInstrument([1e-5, 2e-5], ANCHORS, [0.1, 0.2, 0.3]),
)
each = pytest.mark.parametrize(
    "instrument", INSTRUMENTS, ids=("pose", "point", "points", "distances")
)
Q = poses(1)[0]


def test_predictions_are_those_of_the_tool():
    chain = heavy()
    pose = np.asarray(forward_kinematics(chain, Q))
    assert_close(INSTRUMENTS[0].predict(chain, Q), pose, rtol=1e-14)
    assert_close(INSTRUMENTS[1].predict(chain, Q), pose[None, :3, 3], rtol=1e-14)
    points = np.array([pose @ np.append(p, 1.0) for p in REFLECTORS])[:, :3]
    assert_close(INSTRUMENTS[2].predict(chain, Q), points, rtol=1e-14)
    tip = (pose @ np.array([0.1, 0.2, 0.3, 1.0]))[:3]
    far = np.linalg.norm(tip - ANCHORS, axis=1)
    assert_close(INSTRUMENTS[3].predict(chain, Q), far, rtol=1e-14)


@each
def test_noise_comes_back_as_residual(instrument):
    chain = heavy()
    reading = instrument.predict(chain, Q)
    assert reading.shape == instrument.shape()
    residual = jax.jit(lambda y: instrument.residual(chain, Q, y))
    zero = residual(reading)
    assert_close(zero, np.zeros(zero.shape), rtol=0, atol=1e-12)
    noise = jnp.asarray(np.random.default_rng(0).uniform(-2, 2, zero.shape))
    found = residual(instrument.disturbed(reading, noise))
    # rotations: sine of the angle, 2e-4, whose cube counts; lengths: rounding of 3 m
    # over 1e-5 m
    assert_close(found, noise, rtol=1e-7, atol=1e-9)


@pytest.mark.slow
@each
def test_gradient(instrument):
    chain = heavy()
    reading = instrument.disturbed(
        instrument.predict(chain, Q), 0.5 * jnp.ones(_channels(instrument))
    )
    assert_gradient(lambda x: instrument.residual(chain, x, reading), Q)


def _channels(instrument):
    shape = instrument.shape()
    return 6 if shape == (4, 4) else int(np.prod(shape))


@pytest.mark.slow
def test_distance_at_an_anchor_has_a_finite_slope():
    chain = planar(1.0)
    q = jnp.zeros(1)
    instrument = DistanceInstrument(1e-4, np.array([[1.0, 0, 0]]))
    assert instrument.predict(chain, q) == 0.0
    slope = jax.jacfwd(lambda x: instrument.predict(chain, x))(q)
    assert_close(slope, np.zeros((1, 1)), rtol=0)


def test_pose_noise_turns_in_the_base_frame():
    instrument = PoseInstrument(1.0, 1e-3)
    noise = jnp.array([0.0, 0, 0, 1, -2, 3])
    turned = instrument.disturbed(TOOL, noise)
    expected = rotation_from_vector(1e-3 * noise[3:]) @ TOOL[:3, :3]
    assert_close(turned[:3, :3], expected, rtol=1e-14, atol=1e-16)


def test_refusals():
    with pytest.raises(ValueError, match="`position` must be positive"):
        PoseInstrument(0.0, 1e-4)
    with pytest.raises(ValueError, match="`deviation` must be one number or have"):
        PointInstrument([1e-4, 1e-4], REFLECTORS)
    with pytest.raises(ValueError, match="`deviation` must be positive"):
        DistanceInstrument(-1.0, ANCHORS)
