"""Observability indices: closed forms, laws, the Jacobian, limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    InverseConditionIndex,
    MeanVarianceIndex,
    NoiseAmplificationIndex,
    PointInstrument,
    ProductIndex,
    ReciprocalSumIndex,
    SmallestSingularValueIndex,
    forward_kinematics,
    observability,
    reading_jacobian,
)

from ..helpers import assert_close, assert_gradient
from .arms import planar
from .calibration_arms import heavy, poses


INDICES = (
    ProductIndex(),
    InverseConditionIndex(),
    SmallestSingularValueIndex(),
    NoiseAmplificationIndex(),
    ReciprocalSumIndex(),
    MeanVarianceIndex(),
)
each = pytest.mark.parametrize("index", INDICES, ids=lambda i: type(i).__name__)


def test_closed_forms():
    sigma, poses = jnp.array([8.0, 4.0, 2.0]), 9
    expected = (4 / 3, 0.25, 2.0, 0.5, 8 / 7, (1 / 64 + 1 / 16 + 1 / 4) ** -0.5)
    for index, value in zip(INDICES, expected, strict=True):
        assert_close(index.index(sigma, poses), value, rtol=1e-14)


@each
def test_zero_is_the_worst(index):
    for sigma in (jnp.array([3.0, 0.0]), jnp.zeros(2)):
        assert index.index(sigma, 4) == 0.0
        assert np.all(np.isfinite(jax.grad(lambda s: index.index(s, 4))(sigma)))


@each
def test_gradient(index):
    assert_gradient(lambda s: index.index(s, 5), jnp.array([3.0, 1.0, 0.2]))


def test_order_among_the_indices():
    """O4 = O2 O3; O5 lies below O3, which lies below the root of the sum."""
    for seed in range(5):
        sigma = jnp.asarray(np.random.default_rng(seed).uniform(0.1, 3, 6))
        o1, o2, o3, o4, o5, variance = (float(i.index(sigma, 1)) for i in INDICES)
        assert_close(o4, o2 * o3, rtol=1e-14)
        assert o5 < variance < o3 <= o1


def test_reading_jacobian_of_a_planar_arm():
    """Known derivatives, weighted, with lengths in units of half a metre."""
    chain = planar(1.0, 0.7)
    parameters = ChainParameters.of(chain).select(("a_2", "theta_2"))
    q, sigma = jnp.array([0.3, 0.5]), 1e-4
    instrument = PointInstrument(sigma)
    found = jax.jit(lambda q: reading_jacobian(parameters, instrument, q, 0.5))(q)
    c, s = np.cos(0.8), np.sin(0.8)
    expected = np.array([[0.5 * c, -0.7 * s], [0.5 * s, 0.7 * c], [0, 0]]) / sigma
    # rounding over 1e-4
    assert_close(found, expected, rtol=1e-12, atol=1e-11)


@pytest.mark.slow
def test_index_of_an_experiment():
    parameters = ChainParameters.of(heavy()).select(("a_2", "theta_3", "d_4"))
    q = poses(6)

    def place(x, q):
        return forward_kinematics(parameters.moved(x), q)[:3, 3]

    @jax.jit
    def indices(q, deviation):
        instrument = PointInstrument(deviation)
        return [observability(i, parameters, instrument, q) for i in INDICES]

    slopes = jax.jit(jax.vmap(lambda q: jax.jacfwd(place)(jnp.zeros(3), q)))(q)
    sigma = np.linalg.svd(np.asarray(slopes).reshape(-1, 3) / 5e-5, compute_uv=False)
    kinds = [type(index) for index in INDICES]
    values = dict(zip(kinds, indices(q, 5e-5), strict=True))
    assert_close(values[ProductIndex], np.prod(sigma) ** (1 / 3) / 6**0.5, rtol=1e-12)
    assert_close(values[SmallestSingularValueIndex], sigma[-1], rtol=1e-12)
    # twice the noise, half the index, but for the ratio
    doubled = dict(zip(kinds, indices(q, 1e-4), strict=True))
    # each pose twice: all but O1 and O2 grow as the root of two
    twice = dict(zip(kinds, indices(jnp.concatenate([q, q]), 5e-5), strict=True))
    for kind, value in values.items():
        halved = 1.0 if kind is InverseConditionIndex else 0.5
        assert_close(doubled[kind], value * halved, rtol=1e-12)
        same = kind in (ProductIndex, InverseConditionIndex)
        assert_close(twice[kind], value * (1 if same else 2**0.5), rtol=1e-12)


def test_too_few_readings():
    parameters = ChainParameters.of(heavy())
    with pytest.raises(ValueError, match="36 parameters need as many readings.* 6"):
        observability(ProductIndex(), parameters, PointInstrument(1e-4), poses(2))
