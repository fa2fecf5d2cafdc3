"""Choice of poses: against all choices, against random ones, limits, refusals."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    MeanVarianceIndex,
    NoiseAmplificationIndex,
    PointInstrument,
    ProductIndex,
    SmallestSingularValueIndex,
    observability,
    random_joints,
    select_poses,
)

from ..helpers import assert_close
from .arms import planar
from .calibration_arms import heavy, poses


INSTRUMENT = PointInstrument(5e-5)
NAMES = ("theta_2", "a_2", "alpha_2", "theta_3", "a_3", "alpha_3", "theta_4", "d_4")
EXCHANGED = (ProductIndex(), NoiseAmplificationIndex(), MeanVarianceIndex())


@pytest.mark.slow
@pytest.mark.parametrize("index", EXCHANGED, ids=lambda i: type(i).__name__)
def test_better_than_random_choices(index):
    parameters = ChainParameters.of(heavy()).select(NAMES)
    candidates, number = poses(60), 8
    run = jax.jit(
        lambda key: select_poses(
            parameters, INSTRUMENT, candidates, number, key=key, index=index
        )
    )
    chosen = run(jax.random.key(0))
    assert len(set(np.asarray(chosen.indices).tolist())) == number
    assert_close(chosen.q, candidates[chosen.indices], rtol=0)
    assert chosen.exchanges > 0
    assert chosen.index > chosen.random_index
    # the index from the eigenvalues is that from the singular values; their squares
    # lose half the digits in the smallest
    value = jax.jit(lambda q: observability(index, parameters, INSTRUMENT, q))
    assert_close(chosen.index, value(chosen.q), rtol=1e-8)
    # one hundred choices of other keys, none better
    draw = lambda key: jax.random.choice(key, candidates, (number,), replace=False)
    draws = jax.vmap(draw)(jax.random.split(jax.random.key(1), 100))
    random = jax.jit(
        jax.vmap(lambda q: observability(index, parameters, INSTRUMENT, q))
    )(draws)
    assert chosen.index > np.max(random)
    # deterministic
    again = run(jax.random.key(0))
    assert_close(again.indices, chosen.indices, rtol=0)


@pytest.mark.slow
def test_finds_the_best_of_all_choices():
    """A problem small enough to try every choice."""
    parameters = ChainParameters.of(planar(1.0, 0.7)).select(("a_1", "a_2", "theta_2"))
    candidates = random_joints(
        -2 * jnp.ones(2), 2 * jnp.ones(2), 9, key=jax.random.key(0)
    )
    value = jax.jit(
        jax.vmap(lambda q: observability(ProductIndex(), parameters, INSTRUMENT, q))
    )
    choices = np.array(list(itertools.combinations(range(9), 3)))
    values = value(candidates[choices])
    run = jax.jit(
        lambda key: select_poses(parameters, INSTRUMENT, candidates, 3, key=key)
    )
    chosen = run(jax.random.key(1))
    assert_close(chosen.index, np.max(values), rtol=1e-10)
    assert_close(chosen.indices, choices[np.argmax(values)], rtol=0)


def test_all_candidates():
    parameters = ChainParameters.of(planar(1.0, 0.7)).select(("a_1", "a_2"))
    candidates = jnp.array([[0.1, 0.2], [0.5, -0.4], [1.0, 1.2]])
    index = SmallestSingularValueIndex()
    run = jax.jit(
        lambda key: select_poses(
            parameters, INSTRUMENT, candidates, 3, key=key, index=index
        )
    )
    chosen = run(jax.random.key(0))
    assert_close(chosen.indices, np.arange(3), rtol=0)
    assert chosen.exchanges == 0


def test_random_joints_lie_within_the_limits():
    lower, upper = jnp.array([-1.0, 0.5]), jnp.array([2.0, 0.6])
    q = random_joints(lower, upper, 500, key=jax.random.key(3))
    assert q.shape == (500, 2)
    assert np.all(q >= lower[None]) and np.all(q <= upper[None])
    # of 500 uniform numbers some come within 3 % of either end
    assert np.all(np.min(q, axis=0) < lower + 0.03 * (upper - lower))
    assert np.all(np.max(q, axis=0) > upper - 0.03 * (upper - lower))


@pytest.mark.slow
def test_refusals():
    parameters = ChainParameters.of(planar(1.0, 0.7)).select(("a_1", "a_2"))
    run = lambda number, names=("a_1", "a_2"): select_poses(
        ChainParameters.of(planar(1.0, 0.7)).select(names),
        INSTRUMENT,
        jnp.array([[0.1, 0.2], [0.5, -0.4]]),
        number,
        key=jax.random.key(0),
    )
    with pytest.raises(ValueError, match="from 1 to the 2 candidates, but is 3"):
        run(3)
    with pytest.raises(ValueError, match="4 parameters need as many .* give 3"):
        run(1, ("a_1", "a_2", "theta_1", "theta_2"))
    # one point at the tool's origin says nothing about rotations of the tool
    with pytest.raises(Exception, match="candidates cannot tell"):
        run(2, ("a_1", "tool_rx"))
    with pytest.raises(ValueError, match="`upper` limits must lie above"):
        random_joints(jnp.ones(2), jnp.zeros(2), 3, key=jax.random.key(0))
    with pytest.raises(ValueError, match="limits must be finite"):
        random_joints(jnp.zeros(1), jnp.full(1, jnp.inf), 3, key=jax.random.key(0))
    assert parameters.number == 2
