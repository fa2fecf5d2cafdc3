"""The play in differential form: each of the bounds that its docstring states."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import DelayedPlay, PadeDelay, RateIndependentPlay, play

from tests.drivetrain.hysteresis.motion import follow
from tests.helpers import assert_close, assert_gradient


R, PSI, V0 = 0.25, 40.0, 1e-3
LIMIT = math.log(2.0) / PSI


def single(sharpness=PSI, reversal_speed=V0):
    return RateIndependentPlay([[R]], [sharpness], [reversal_speed])


def plays():
    thresholds = np.array([[0.1, 0.2], [0.25, 0.3]])
    return RateIndependentPlay(thresholds, np.array([25.0, 20.0]), np.array([0.1, 0.2]))


X, XD = jnp.array([0.3, -0.1]), jnp.array([0.05, -0.08])
STATES = jnp.array([[0.25, 0.05], [0.1, 0.08]])


def exact(x, y0):
    """Exact play along a sequence of inputs."""

    def step(y, x):
        y = play(x, y, jnp.array(R))
        return y, y

    return jax.lax.scan(step, jnp.asarray(y0), x)[1]


def wave(t):
    """Reversals at several heights, inner cycles, and accelerations of 3 and more."""
    return (
        jnp.sin(2.0 * t) * (0.4 + 0.5 * jnp.cos(0.37 * t)) + 0.2 * jnp.sin(9.0 * t)
    )[None]


def test_follows_its_closed_form_between_reversals():
    x, states = follow(
        single(), lambda t: t[None] - 0.2, 1.0, 4000, jnp.array([[-0.3]])
    )
    x, y = x[:, 0], states[:, 0, 0]
    constant = math.exp(PSI * -0.3) - math.exp(PSI * (-0.2 - R))
    expected = jnp.log(constant + jnp.exp(PSI * (x - R))) / PSI
    assert_close(y, expected, rtol=0.0, atol=1e-10)  # step error of fourth order
    x, states = follow(single(), lambda t: 0.2 - t[None], 1.0, 4000, jnp.array([[0.3]]))
    assert_close(states[:, 0, 0], -y, rtol=0.0, atol=1e-14)


def test_output_depends_on_the_path_and_not_on_the_speed():
    slow, fast = (
        follow(single(), lambda t, f=f: wave(f * t), 9.0 / f, 18_000)[1][:, 0, 0]
        for f in (1.0, 30.0)
    )
    # 13 reversals at accelerations of 3 or more, each by less than v0^2 / (2 a)
    assert jnp.max(jnp.abs(slow - fast)) < 13 * V0**2 / (2.0 * 3.0)


@pytest.mark.slow
def test_a_reversal_moves_it_by_less_than_its_bound():
    # Much slower: the same parabola at two values of v0, of which one is far below.
    for acceleration, v0 in ((1.0, 0.1), (4.0, 0.1), (1.0, 0.03)):
        motion = lambda t, a=acceleration: 0.3 - 0.5 * a * (t[None] - 0.5) ** 2
        start = motion(jnp.array(0.0)) - R
        ends = [
            follow(single(reversal_speed=v), motion, 1.0, 4000, start[None])[1][
                -1, 0, 0
            ]
            for v in (v0, 1e-4)
        ]
        moved = abs(float(ends[0] - ends[1]))
        bound = v0**2 / (2.0 * acceleration)
        # the bound is meant to be close, and the effect to be there
        assert 0.3 * bound < moved < bound


@pytest.mark.slow
def test_hold_keeps_the_memory_where_the_delayed_play_loses_it():
    at = jnp.array([0.1])
    start = jnp.array([[0.3]])
    hold = lambda t: at + 0.0 * t
    _, states = follow(single(), hold, 1e3, 100, start)
    assert_close(states[-1], start, rtol=0.0)
    delayed = DelayedPlay([[R]], [PSI], PadeDelay(0.01, 3))
    begin = delayed.delay.rest(start[0])
    x, states = follow(delayed, hold, 0.01 * math.exp(PSI * R), 200_000, begin)
    left = jax.vmap(delayed.outputs)(x[-1:], states[-1:])[0, 0] - at
    assert abs(float(left[0])) < 0.1 * 0.2


@pytest.mark.slow
def test_within_the_bounds_of_the_exact_play():
    x, states = follow(single(), wave, 12.0, 24_000)
    x, y = x[:, 0], states[:, 0, 0]
    assert jnp.max(jnp.abs(x - y)) < R + V0**2 / (2.0 * 3.0)
    turns = np.cumsum(np.diff(np.sign(np.diff(x)), prepend=[0, 0]) != 0)
    assert turns[-1] > 12
    error = np.abs(np.asarray(y - exact(x, y[0])))
    assert np.all(error < (turns + 1) * LIMIT)
    # Turns come and go without adding up, as wide ones erase the memory: this is what
    # a loop sees, here and with the delayed play of the same sharpness.
    assert LIMIT < 1.0001 * np.max(error) < 1.5 * LIMIT
    delayed = DelayedPlay([[R]], [PSI], PadeDelay(0.01, 3))
    x, states = follow(delayed, wave, 12.0, 24_000)
    late = jax.vmap(delayed.outputs)(x, states)[:, 0, 0] - exact(x[:, 0], y[0])
    assert np.max(np.abs(late)) > 2.0 * np.max(error)


def test_loop_error_is_that_of_one_soft_limit():
    x, states = follow(single(), lambda t: jnp.sin(t)[None], 6.0 * math.pi, 24_000)
    x, y = x[:, 0], states[:, 0, 0]
    error = jnp.abs(y - exact(x, y[0]))[8000:]
    # the sample next to the corner is up to 4e-4 away from it, of slopes of 1/2
    assert_close(jnp.max(error), LIMIT, rtol=0.0, atol=2e-4)
    # ten 1 / psi beyond the corner it is gone
    beyond = jnp.abs(x[8000:]) > 0.99
    assert jnp.max(error[beyond]) < math.exp(-9.5) / PSI


def test_inner_cycles_leak_less_than_the_bound():
    # cycles about x = 0.3 with y at 0.2: |x - y| at most 0.1 + 0.05 = R - m, m = 0.1
    cycles = 40
    motion = lambda t: 0.3 + 0.05 * jnp.sin(2.0 * math.pi * t)[None]
    _, states = follow(single(), motion, float(cycles), 40_000, jnp.array([[0.2]]))
    drift = float(states[-1, 0, 0] - 0.2) / cycles
    bound = -math.log1p(-math.exp(-PSI * 0.1)) / PSI
    assert 0.2 * bound < drift < bound  # half of a cycle leaks, but not the other


@pytest.mark.slow
def test_never_far_outside_at_any_speed():
    # from rest to a fifth of v0 and, for a while, much below it
    play = single(reversal_speed=1.0)
    for speed in (1e-6, 0.2):
        motion = lambda t, v=speed: v * jnp.sin(t / 50.0)[None] * 50.0 + v * t[None]
        x, states = follow(play, motion, 2.0 / speed, 40_000)
        gap = jnp.max(jnp.abs(x - states[:, 0]))
        assert R < gap < R + 0.74 / PSI


@pytest.mark.slow
def test_rest_is_what_a_slow_start_leads_to():
    for end in (0.1, 0.24, -0.26, 0.8):
        motion = lambda t, end=end: end * t[None]
        _, states = follow(single(reversal_speed=1e-6), motion, 1.0, 4000)
        rest = single().rest(jnp.array([end]))
        assert_close(states[-1], rest, rtol=0.0, atol=1e-10)  # steps of fourth order
    wide = single().rest(jnp.array([1e8]))
    assert_close(wide, [[1e8 - R]], rtol=1e-15)
    slope = jax.jacfwd(lambda x: single().rest(x)[0])(jnp.zeros(1))
    assert_close(slope, [[math.exp(-PSI * R)]], rtol=1e-14)


@pytest.mark.slow
def test_gradient():
    function = lambda p, x, xd, s: (p.outputs(x, s), p.rates(x, xd, s), p.rest(x))
    assert_gradient(function, plays(), X, XD, STATES, order=2)


@pytest.mark.slow
@pytest.mark.parametrize("at_limit", [False, True])
def test_derivatives_on_and_off_the_limit(at_limit):
    # The exponential goes over into its parabola there with two derivatives.
    y = jnp.array([[0.3 - R if at_limit else 0.2]])
    law = lambda x: single().rates(x, jnp.ones(1), y)[0, 0]
    first, second = jax.grad(law), jax.hessian(law)
    x = jnp.array([0.3])
    growth = math.exp(PSI * (0.3 - R - float(y[0, 0])))
    assert_close(first(x), [PSI * growth], rtol=1e-12)
    assert_close(second(x), [[PSI**2 * growth]], rtol=1e-12)


@pytest.mark.slow
def test_extremes_are_finite():
    def everything(play, x, xd, states):
        law = lambda p, x, xd, s: jnp.sum(p.rates(x, xd, s)) + jnp.sum(p.rest(x))
        every = (0, 1, 2, 3)
        slope = lambda x, xd: jax.grad(law, argnums=(1, 2))(play, x, xd, states)
        curvature = jax.jvp(slope, (x, xd), (jnp.ones(2), jnp.ones(2)))
        value = law(play, x, xd, states)
        return value, jax.grad(law, argnums=every)(play, x, xd, states), curvature

    sizes = jnp.array([0.0, 1e-300, 1e8])[:, None] * jnp.array([[1.0, -1.0]])
    for states in (jnp.zeros((2, 2)), jnp.full((2, 2), 1e8)):
        function = jax.jit(jax.vmap(everything, (None, 0, 0, None)))
        for leaf in jax.tree.leaves(function(plays(), sizes, sizes, states)):
            assert jnp.all(jnp.isfinite(leaf))


def test_jit_vmap_and_loop_agree():
    x = X[None] * jnp.linspace(-1.0, 2.0, 4)[:, None]
    rates = lambda x: plays().rates(x, XD, STATES)
    loop = jnp.stack([rates(one) for one in x])
    assert_close(jax.jit(jax.vmap(rates))(x), loop, rtol=1e-13)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: RateIndependentPlay([[0.0]], [1.0], [1.0]),
            "`thresholds` must be pos",
        ),
        (
            lambda: RateIndependentPlay([[1.0]], [0.0], [1.0]),
            "`sharpness` must be posi",
        ),
        (
            lambda: RateIndependentPlay([[1.0]], [1.0], [0.0]),
            "`reversal_speed` must be",
        ),
        (
            lambda: RateIndependentPlay([[1.0]], [1.0, 1.0], [1.0]),
            "must have the shape",
        ),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
