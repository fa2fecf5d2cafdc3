"""The smooth play of the text: its vector and the errors that it cannot avoid."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import DelayedPlay, PadeDelay

from tests.drivetrain.hysteresis.motion import follow
from tests.helpers import assert_close, assert_gradient, load_vectors


def plays():
    thresholds = np.array([[0.1, 0.2], [0.25, 0.3]])
    return DelayedPlay(thresholds, np.array([25.0, 20.0]), PadeDelay(0.01, 3))


X, XD = jnp.array([0.3, -0.1]), jnp.array([0.5, 2.0])
STATES = jnp.linspace(-0.3, 0.4, 12).reshape(6, 2)


def test_vector():
    (vector,) = load_vectors("2.13+2.17+2.18")
    inputs = vector["inputs"]
    delay = PadeDelay(inputs["T_t"], inputs["n"])
    single = DelayedPlay([[inputs["r_h"]]], [inputs["psi"]], delay)
    motion = lambda t: 0.6 * jnp.sin(jnp.pi * t)[None]
    steps = 20_000  # of 1e-4 s: the error falls by 16 with half of it, to 1e-9 here
    x, states = follow(single, motion, 2.0, steps)
    y = jax.vmap(single.outputs)(x, states)[:, 0, 0]
    at = np.round(np.array(inputs["t"]) / 2.0 * steps).astype(int)
    assert_close(y[at], vector["outputs"]["y"], rtol=0.0, atol=vector["tol"])


@pytest.mark.slow
def test_memory_is_lost_to_a_biased_rest():
    (vector,) = load_vectors("2.13+2.17")
    psi, r = vector["inputs"]["psi"], vector["inputs"]["r_h"]
    single = DelayedPlay([[r]], [psi], PadeDelay(0.01, 3))
    offset = vector["outputs"]["fixed_point_offset"]
    at = jnp.array([0.3])
    rest = single.outputs(at, single.rest(at))
    # the offset is what two numbers of 0.3 differ by: rounding over 1.6e-3
    assert_close(rest[0] - at, [offset], rtol=1e-13)
    # rounding of 0.3 times 60 / delay is 4e-13
    still = single.rates(at, 0.0 * at, single.rest(at))
    assert_close(still, np.zeros((3, 1)), rtol=0.0, atol=1e-12)
    # From both ends of the play, within ten times the time that the docstring states.
    constant = 0.01 * math.exp(psi * r) / 2.0
    for start in (0.3 - r, 0.3 + r):
        begin = single.delay.rest(jnp.array([start]))
        x, states = follow(single, lambda t: at + 0.0 * t, 10.0 * constant, 2000, begin)
        gap = jax.vmap(single.outputs)(x, states)[:, 0, 0] - rest[0, 0]
        assert jnp.abs(gap[0]) > 0.07 and jnp.abs(gap[-1]) < 1e-4
        # the last decay is the linearised leak, 1 / (1 + E e^(-psi r))^2 per delay
        per_delay = 1.0 / (1.0 + math.exp(psi * (offset - r))) ** 2
        k = round(2000 * 0.01 / (10.0 * constant))
        ratio = gap[1200 + k] / gap[1200]
        # linearised: the gap of 1e-3 that is left there times psi, a percent, over 8
        assert_close(ratio, per_delay, rtol=2e-3)


@pytest.mark.slow
def test_bias_on_a_ramp_grows_with_a_shorter_delay():
    (vector,) = load_vectors("2.13+2.17 ramp bias")
    for row, bias in zip(
        vector["inputs"]["psi_v_T"], vector["outputs"]["bias"], strict=True
    ):
        psi, speed, delay = row
        # so wide that the other limit has no part in it
        single = DelayedPlay([[0.4]], [psi], PadeDelay(delay, 3))
        # the limit is reached after 0.4 / speed: 60 and more delays are left
        end = 1.0 / speed
        x, states = follow(single, lambda t, v=speed: v * t[None], end, 10_000)
        y = single.outputs(x[-1], states[-1])[0]
        # the reference is a closed form; rounding of 0.6 over a bias of 1e-2
        assert_close(y - (x[-1] - 0.4), [bias], rtol=1e-12)


@pytest.mark.slow
def test_a_sudden_turn_costs_a_quarter_of_the_way_of_a_delay():
    # The delay holds the last y and the first x + r of the turn: a triangle of the
    # height v T / 2, which it levels out. All else is sharp: psi v T = 80.
    delay, r = 0.02, 0.25
    single = DelayedPlay([[r]], [4000.0], PadeDelay(delay, 3))
    x, states = follow(single, lambda t: jnp.abs(t - 1.0)[None], 2.0, 8000)
    y = jax.vmap(single.outputs)(x, states)[:, 0, 0]
    # falls from 1 to 0, then rises: the exact play hangs at 0.25 until x is at 0.5
    # the corners of the triangle are round: ln 2 / psi at most, 1.7e-4
    assert_close(y[5600], r + delay / 4.0, rtol=0.0, atol=math.log(2.0) / 4000.0)
    # on a ramp the bias e^(-psi v T) / psi is nothing; rounding of 0.75
    assert_close(y[8000], 0.75, rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_gradient():
    function = lambda p, x, s: (p.outputs(x, s), p.rates(x, XD, s), p.rest(x))
    assert_gradient(function, plays(), X, STATES, order=2)


@pytest.mark.slow
def test_extremes_are_finite():
    def everything(play, x, xd, states):
        law = lambda p, x, s: jnp.sum(p.outputs(x, s)) + jnp.sum(p.rates(x, xd, s))
        slope = lambda x: jax.grad(law, argnums=1)(play, x, states)
        curvature = jax.jvp(slope, (x,), (jnp.ones(2),))
        return law(play, x, states), jax.grad(law)(play, x, states), curvature

    sizes = jnp.array([0.0, 1e-300, 1e8])[:, None] * jnp.array([[1.0, -1.0]])
    states = jnp.zeros((6, 2))
    function = jax.jit(jax.vmap(everything, (None, 0, 0, None)))
    for leaf in jax.tree.leaves(function(plays(), sizes, sizes, states)):
        assert jnp.all(jnp.isfinite(leaf))


def test_jit_vmap_and_loop_agree():
    x = X[None] * jnp.linspace(-2.0, 3.0, 4)[:, None]
    rates = jax.jit(lambda x: plays().rates(x, XD, STATES))
    loop = jnp.stack([rates(one) for one in x])
    # rates are differences of values times 60 / delay
    assert_close(jax.jit(jax.vmap(rates))(x), loop, rtol=1e-12, atol=1e-11)


def test_plays_do_not_mix():
    both = plays()
    second = DelayedPlay(both.thresholds[1:], both.sharpness, both.delay)
    rates = jax.jit(lambda p, s: p.rates(X, XD, s))
    assert_close(rates(second, STATES[3:]), rates(both, STATES)[3:], rtol=1e-14)
    assert (both.number, both.states) == (2, 6)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: DelayedPlay([[0.0]], [25.0], PadeDelay(0.01, 3)),
            "`thresholds` must be positive: the play of width zero is the input",
        ),
        (
            lambda: DelayedPlay([[0.1]], [0.0], PadeDelay(0.01, 3)),
            "`sharpness` must be positive",
        ),
        (
            lambda: DelayedPlay([[0.1, 0.1]], [25.0], PadeDelay(0.01, 3)),
            "must have the shape",
        ),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
