"""Exact plays and their sums: vectors, rate independence, inverses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import PrandtlIshlinskii, play
from hypothesis import given, settings, strategies as st

from tests.helpers import assert_close, assert_gradient, load_vectors


WEIGHTS = np.array([0.7, 0.3, -0.25, 0.15])
THRESHOLDS = np.array([0.0, 0.1, 0.22, 0.4])
INITIAL = np.array([0.05, 0.12, 0.2, 0.08])
X = jnp.array([0.05, 0.3, 0.62, 0.41, 0.18, -0.35, -0.8, -0.55, -0.1, 0.45, 0.9])


def operator():
    return PrandtlIshlinskii(WEIGHTS, THRESHOLDS, INITIAL)


def test_play_vector():
    (vector,) = load_vectors("2.13")
    inputs = vector["inputs"]
    single = PrandtlIshlinskii([1.0], [inputs["r_h"]], [inputs["y0"]])
    y = single.apply(jnp.array(inputs["x"]))
    assert_close(y, vector["outputs"]["y"], rtol=vector["tol"], atol=vector["tol"])
    state = jnp.array(inputs["y0"])
    for x, expected in zip(inputs["x"], vector["outputs"]["y"], strict=True):
        state = play(jnp.array(x), state, jnp.array(inputs["r_h"]))
        assert_close(state, expected, rtol=vector["tol"], atol=vector["tol"])


def test_prandtl_ishlinskii_vector():
    (vector,) = load_vectors("2.14-2.16 (corrected initial state)")
    inputs, outputs = vector["inputs"], vector["outputs"]
    forward = PrandtlIshlinskii(inputs["w_h"], inputs["r_h"], inputs["y0"])
    inverse = forward.inverse()
    x = jnp.array(inputs["x"])
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    assert_close(forward.apply(x), outputs["H_x"], **tolerance)
    assert_close(inverse.weights, outputs["w_inv"], **tolerance)
    assert_close(inverse.thresholds, outputs["r_inv"], **tolerance)
    assert_close(inverse.initial, outputs["y0_inv"], **tolerance)
    assert_close(inverse.apply(x), outputs["Hinv_of_x"], **tolerance)
    assert_close(inverse.apply(forward.apply(x)), outputs["roundtrip"], **tolerance)


def test_steps_give_the_sequence():
    forward = operator()
    state, outputs = forward.init(X[0]), []
    assert_close(forward.output(state), jnp.sum(WEIGHTS * state), rtol=1e-14)
    for x in X:
        output, state = forward.step(state, x)
        outputs.append(output)
    assert_close(jnp.stack(outputs), forward.apply(X), rtol=1e-15)


def test_samples_between_turns_change_nothing():
    forward = operator()
    fine = jnp.interp(jnp.arange(0.0, 10.0 + 1e-9, 0.125), jnp.arange(11.0), X)
    assert_close(forward.apply(fine)[::8], forward.apply(X), rtol=1e-14, atol=1e-15)
    twice = forward.apply(jnp.repeat(X, 2))
    assert_close(twice[::2], twice[1::2], rtol=0.0)


def test_columns_are_joints():
    scale = np.array([1.0, 0.5])
    both = PrandtlIshlinskii(
        WEIGHTS[:, None] * np.ones(2),
        THRESHOLDS[:, None] * scale,
        INITIAL[:, None] * scale,
    )
    y = jax.jit(lambda h, x: h.apply(x))(both, X[:, None] * scale[None])
    assert_close(y[:, 0], operator().apply(X), rtol=1e-15)
    assert_close(y[:, 1], 0.5 * operator().apply(X), rtol=1e-14, atol=1e-16)
    back = jax.jit(lambda h, y: h.inverse().apply(y))(both, y)
    assert_close(back, X[:, None] * scale[None], rtol=1e-13, atol=1e-14)


@jax.jit
def round_trips(forward, x):
    inverse = forward.inverse()
    undone, redone = inverse.apply(forward.apply(x)), forward.apply(inverse.apply(x))
    return undone, redone, inverse.inverse()


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(
    slopes=st.lists(st.floats(-2.0, 2.0), min_size=5, max_size=5),
    gaps=st.lists(st.floats(-3.0, 0.0), min_size=4, max_size=4),
    steps=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5),
    seed=st.integers(0, 10**6),
)
def test_inverse_from_either_side(slopes, gaps, steps, seed):
    # partial sums of the weights within 1e-2 to 1e2, gaps of the thresholds of 1e-3 up
    total, gaps = 10.0 ** np.array(slopes), 10.0 ** np.array(gaps)
    weights = np.diff(total, prepend=0.0)
    thresholds = np.concatenate([[0.0], np.cumsum(gaps)])
    steps = np.array(steps) * np.concatenate([[1.0], gaps * (1.0 - 1e-12)])
    forward = PrandtlIshlinskii(weights, thresholds, np.cumsum(steps))
    inverse = forward.inverse()
    x = jnp.asarray(np.random.default_rng(seed).uniform(-1.0, 1.0, 40))
    undone, redone, twice = round_trips(forward, x)
    # Sums of five products each round to 5 eps of what is added, and the slope of the
    # other operator, up to the sum of its weights, takes that back: 1e-14 for weights
    # of order one, 1e-10 for partial sums that jump between 1e-2 and 1e2.
    condition = np.sum(np.abs(weights)) * np.sum(np.abs(inverse.weights))
    for result, first in ((undone, forward), (redone, inverse)):
        reach = 1.0 + np.minimum(np.abs(first.initial), 1.0 + first.thresholds)
        tolerance = 10 * np.finfo(float).eps * condition * np.max(reach)
        assert_close(result, x, rtol=0.0, atol=tolerance)
    # 1/(1/W) of sums that hold to eps of the largest of both operators: 1e4 eps
    size = np.max(np.abs(weights))
    assert_close(twice.weights, weights, rtol=1e-11, atol=1e-11 * size)
    assert_close(twice.thresholds, thresholds, rtol=1e-11)
    assert_close(twice.initial, forward.initial, rtol=1e-11, atol=1e-11)
    inverse.inverse()  # outside of jit it refuses what is not admissible


def test_inverse_of_moderate_weights():
    generator = np.random.default_rng(0)
    x = jnp.asarray(generator.uniform(-1.0, 1.0, 40))
    for _ in range(20):
        weights = np.diff(10.0 ** generator.uniform(-1.0, 1.0, 5), prepend=0.0)
        gaps = 10.0 ** generator.uniform(-3.0, 0.0, 4)
        thresholds = np.concatenate([[0.0], np.cumsum(gaps)])
        initial = np.cumsum(np.append(0.5, gaps * generator.uniform(-1.0, 1.0, 4)))
        forward = PrandtlIshlinskii(weights, thresholds, initial)
        for result in round_trips(forward, x)[:2]:
            assert_close(result, x, rtol=0.0, atol=1e-12)


def test_inverse_with_exactly_admissible_states():
    # neighbouring states as far apart as the thresholds allow, up to rounding
    thresholds = np.cumsum([0.0, *([0.1] * 11)])
    for sign in (1.0, -1.0):
        initial = 0.3 - sign * thresholds
        forward = PrandtlIshlinskii(np.full(12, 0.1), thresholds, initial)
        there = forward.apply(X)
        assert_close(forward.inverse().apply(there), X, rtol=1e-14, atol=1e-14)
        back = forward.inverse().inverse()
        assert_close(back.initial, initial, rtol=1e-13, atol=1e-14)


def test_a_printed_first_threshold_is_a_dead_zone():
    # Table 2.1 prints 0.1 to 0.5: undone as if it were (0, ..., 0.4), 0.1 stays.
    weights, initial = np.full(5, 0.2), np.zeros(5)
    printed = PrandtlIshlinskii(weights, 0.1 * np.arange(1.0, 6.0), initial)
    shifted = PrandtlIshlinskii(weights, 0.1 * np.arange(5.0), initial)
    x = jnp.sin(jnp.linspace(0.0, 12.0, 500))
    with pytest.raises(ValueError, match="first of `thresholds` must be zero"):
        printed.inverse()
    error = printed.apply(shifted.inverse().apply(x)) - x
    assert_close(jnp.max(jnp.abs(error)), 0.1, rtol=1e-12)
    exact = shifted.apply(shifted.inverse().apply(x)) - x
    assert jnp.max(jnp.abs(exact)) < 1e-14


@pytest.mark.slow
def test_gradient():
    # Nowhere at a corner: X itself drops by twice a threshold, and so is a threshold of
    # zero, from which only larger ones are admissible.
    x = X + 0.013 * jnp.sin(jnp.arange(11.0))
    forward = PrandtlIshlinskii(WEIGHTS, THRESHOLDS + 0.02, INITIAL)
    assert_gradient(lambda h, x: h.apply(x), forward, x)

    def undone(weights, gaps, initial, x):
        thresholds = jnp.concatenate([jnp.zeros(1), jnp.cumsum(gaps)])
        return PrandtlIshlinskii(weights, thresholds, initial).inverse().apply(x)

    gaps = jnp.diff(jnp.asarray(THRESHOLDS))
    assert_gradient(undone, jnp.asarray(WEIGHTS), gaps, jnp.asarray(INITIAL), x)


def test_extremes_are_finite():
    x = jnp.array([0.0, 1e-300, 1e8, -1e8, 0.0])

    def everything(forward, x):
        law = lambda h, x: jnp.sum(h.apply(x)) + jnp.sum(h.inverse().apply(x))
        return law(forward, x), jax.grad(law, argnums=(0, 1))(forward, x)

    for leaf in jax.tree.leaves(jax.jit(everything)(operator(), x)):
        assert jnp.all(jnp.isfinite(leaf))


def test_jit_vmap_and_loop_agree():
    inputs = jnp.stack([X, -0.4 * X, X**2])
    loop = jnp.stack([operator().apply(x) for x in inputs])
    assert_close(jax.jit(jax.vmap(operator().apply))(inputs), loop, rtol=1e-14)


def changed(**changes):
    fields = {"weights": WEIGHTS, "thresholds": THRESHOLDS, "initial": INITIAL}
    return PrandtlIshlinskii(**(fields | changes))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: changed(thresholds=-THRESHOLDS), "`thresholds` must not be negative"),
        (lambda: changed(thresholds=THRESHOLDS[[0, 2, 1, 3]]), "must increase"),
        (lambda: changed(thresholds=np.array([0.0, 0.1, 0.1, 0.4])), "must increase"),
        (lambda: changed(weights=WEIGHTS[:3]), "must have the shape"),
        (lambda: changed(thresholds=THRESHOLDS + 0.1).inverse(), "must be zero"),
        (lambda: changed(weights=-WEIGHTS).inverse(), "must be positive"),
        (
            lambda: changed(weights=np.array([0.7, -0.8, 0.2, 0.2])).inverse(),
            "all partial sums of `weights` must be positive",
        ),
        (lambda: changed(initial=3.0 * INITIAL).inverse(), "`initial` must be admissi"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
