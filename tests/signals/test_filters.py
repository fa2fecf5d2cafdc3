"""Filters: equations (3.32), (3.33), exact steps, frequency responses."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
import scipy.special
import scipy.stats
from elastax.signals import BesselFilter, CriticallyDampedFilter

from tests.helpers import assert_close, assert_gradient, load_vectors


FAMILIES = [BesselFilter, CriticallyDampedFilter]
each_family = pytest.mark.parametrize("family", FAMILIES)
each_filter = pytest.mark.parametrize(
    "filter",
    [
        family(order, cutoff)
        for family in FAMILIES
        for order, cutoff in [(1, 5), (4, 20)]
    ]
    + [family(8, 100.0) for family in FAMILIES],
    ids=lambda f: f"{type(f).__name__}-{f.order}",
)


def prototype(filter):
    """Numerator and denominator of the transfer function in s / rate, by scipy."""
    if isinstance(filter, BesselFilter):
        return scipy.signal.bessel(filter.order, 1.0, analog=True, norm="phase")
    return np.array([1.0]), np.poly(-np.ones(filter.order))


def samples(dt=1e-3, count=400):
    """A smooth and a cornered channel."""
    t = dt * np.arange(count)
    ramp = np.interp(t, [0.0, 0.05, 0.15, 1.0], [0.0, 0.0, 1.0, 1.0])
    return t, np.stack([1.5 + np.sin(20.0 * t) * t, ramp], axis=1)


def test_vector_of_the_cascade():
    (vector,) = load_vectors("Reiner 3.32")
    order, corner = vector["inputs"]["n"], vector["inputs"]["f_c"]
    outputs, tol = vector["outputs"], vector["tol"]
    printed = CriticallyDampedFilter.from_corner(order, corner)
    normalised = CriticallyDampedFilter(order, corner)
    omega = 2 * math.pi * corner
    gain = lambda f: jnp.abs(f.frequency_response(omega))
    assert_close(gain(printed), outputs["gain_fc_printed"], rtol=tol)
    assert_close(gain(normalised), outputs["gain_fc_normalised"], rtol=tol)
    assert_close(printed.rate(), omega, rtol=1e-15)
    assert_close(normalised.rate(), outputs["omega_c_normalised_n4"], rtol=tol)
    for n, alpha in outputs["alpha_n"].items():
        rate = CriticallyDampedFilter(int(n), 1.0).rate()
        assert_close(2 * math.pi / rate, alpha, rtol=tol)
    # A step: the state rests at zero, the input is one from the first sample on.
    hold = normalised.discretise(0.01)
    state = hold(normalised.init(0.0), 1.0, 1.0)
    response = outputs["step_response_normalised_t_10ms"]
    assert_close(normalised.derivatives(state, 1.0, 0)[0], response, rtol=tol)


def test_vector_of_the_half_power_frequency():
    (vector,) = load_vectors("5.4 filter remark")
    for n, ratio in zip(vector["inputs"]["n"], vector["outputs"]["ratio"], strict=True):
        filter = CriticallyDampedFilter.from_corner(n, 10.0)
        assert_close(filter.cutoff / 10.0, ratio, rtol=vector["tol"])


def test_cascade_as_printed():
    filter = CriticallyDampedFilter(3, 7.0)
    u, x = jnp.array([0.4, -1.0]), jnp.array([[0.3, 2.0], [-0.2, 1.0], [0.1, 0.5]])
    w, (x1, x2, x3) = filter.rate(), x
    # [Reiner2010] (3.32b, c)
    field = jnp.stack([(u - x1) * w, (x1 - x2) * w, (x2 - x3) * w])
    assert_close(filter.vector_field(x, u), field, rtol=1e-15)
    # [Reiner2010] (3.32d), (3.33a, b, c)
    y = [
        x3,
        (x2 - x3) * w,
        ((x1 - x2) * w - (x2 - x3) * w) * w,
        (((u - x1) * w - (x1 - x2) * w) * w - ((x1 - x2) * w - (x2 - x3) * w) * w) * w,
    ]
    assert_close(filter.derivatives(x, u, 3), jnp.stack(y), rtol=1e-14, atol=1e-10)


@each_filter
def test_states_hold_the_derivatives(filter):
    """Each output differentiated along the vector field is the next output."""
    generator = np.random.default_rng(1)
    state = jnp.asarray(generator.standard_normal((filter.order, 2)))
    u = jnp.asarray(generator.standard_normal(2))
    n, rate = filter.order, float(filter.rate())
    outputs = lambda x: filter.derivatives(x, u, n - 1)
    _, slopes = jax.jvp(outputs, (state,), (filter.vector_field(state, u),))
    scale = rate ** np.arange(1, n + 1)[:, None]
    expected = filter.derivatives(state, u, n)[1:]
    # Differences along the cascade cancel up to comb(8, 4) = 70 times the rounding.
    assert_close(slopes / scale, expected / scale, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
@each_filter
def test_exact_for_piecewise_linear_input(filter):
    """Against scipy's first-order hold, on states of the size of the input."""
    t, u = samples()
    b, a = prototype(filter)
    n, rate = filter.order, float(filter.rate())
    companion = np.eye(n, k=1)
    companion[-1] = -a[:0:-1]
    inlet = np.zeros((n, 1))
    inlet[-1] = b[-1]
    system = (rate * companion, rate * inlet, np.eye(n), np.zeros((n, 1)))
    y = filter.apply(u, 1e-3, n)
    assert y.shape == (n + 1, *u.shape)
    for channel in range(2):
        rest = np.eye(n)[0] * u[0, channel]
        _, _, x = scipy.signal.lsim(system, u[:, channel], t, X0=rest)
        scaled = np.asarray(y[:n, :, channel]).T / rate ** np.arange(n)
        # Rounding of 400 steps; a cascade of eight cancels 70 times as much.
        assert_close(scaled, x.reshape(len(t), n), rtol=0.0, atol=1e-11)


def test_closed_form_at_order_eight():
    """The ramp response of the cascade is a sum of incomplete gamma functions."""
    filter = CriticallyDampedFilter(8, 100.0)
    dt = 2.5e-4
    t = dt * np.arange(200)
    w = float(filter.rate())
    step = scipy.special.gammainc(8, w * t)
    y = filter.apply(t[:, None], dt, 3)[:, :, 0]
    ramp = t * step - 8 / w * scipy.special.gammainc(9, w * t)
    density = lambda n: w * scipy.stats.gamma.pdf(w * t, n)
    desired = np.stack([ramp * w, step, density(8) / w])
    actual = np.stack([y[0] * w, y[1], y[2] / w])
    assert_close(actual, desired, rtol=0.0, atol=1e-12 * w * t[-1])
    third = (density(7) - density(8)) / w
    assert_close(np.asarray(y[3]) / w**2, third, rtol=0.0, atol=1e-11)


@each_filter
def test_gain_at_the_cutoff_and_slow_delay(filter):
    omega = 2 * math.pi * float(filter.cutoff)
    response = filter.frequency_response(jnp.array([0.0, omega]))
    assert_close(jnp.abs(response), jnp.array([1.0, math.sqrt(0.5)]), rtol=1e-13)
    _, slope = jax.jvp(
        lambda w: jnp.angle(filter.frequency_response(w)), (0.0,), (1.0,)
    )
    assert_close(-slope, filter.delay(), rtol=1e-13)


@each_filter
def test_ramp_lags_by_the_delay(filter):
    dt = 1e-2
    t = dt * np.arange(200)
    y = filter.apply(t[:, None], dt, min(filter.order, 2))
    assert_close(y[0, -1, 0], t[-1] - filter.delay(), rtol=1e-12)
    assert_close(y[1, -1, 0], 1.0, rtol=1e-11)


@pytest.mark.slow
@each_filter
def test_frequency_response_of_the_states(filter):
    """The product over the poles against the vector field, two routes."""
    omega = 2 * math.pi * float(filter.cutoff) * np.array([0.1, 1.0, 3.0])
    state, u = filter.init(0.0), jnp.array(0.0)
    system = np.asarray(jax.jacfwd(filter.vector_field)(state, u))
    inlet = np.asarray(jax.jacfwd(filter.vector_field, argnums=1)(state, u))
    output = np.asarray(jax.jacfwd(lambda x: filter.derivatives(x, u, 0)[0])(state))
    identity = np.eye(filter.order)
    states = [
        output @ np.linalg.solve(1j * w * identity - system, inlet) for w in omega
    ]
    actual = filter.frequency_response(omega)
    assert_close(actual, np.array(states), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 5, 12, 25])
def test_bessel_as_in_scipy(order):
    """All three normalisations; scipy computes them from the poles."""
    omega = np.array([0.3, 1.0, 2.0])
    filters = {
        "mag": BesselFilter(order, 1 / (2 * math.pi)),
        "phase": BesselFilter.from_asymptote(order, 1 / (2 * math.pi)),
        "delay": BesselFilter.from_delay(order, 1.0),
    }
    for norm, filter in filters.items():
        z, p, k = scipy.signal.bessel(order, 1.0, analog=True, norm=norm, output="zpk")
        _, response = scipy.signal.freqs_zpk(z, p, k, worN=omega)
        # scipy finds the half power to about 1e-12 of the frequency only.
        assert_close(filter.frequency_response(omega), response, rtol=1e-10)
    assert_close(filters["delay"].delay(), 1.0, rtol=1e-14)


@each_family
def test_streaming_is_offline(family):
    filter = family(4, 30.0)
    _, u = samples(count=20)
    offline = filter.apply(u, 1e-3, 4)
    hold = filter.discretise(1e-3)
    state = filter.init(u[0])
    scale = float(filter.rate()) ** np.arange(5)[:, None]
    for k in range(1, 20):
        state = hold(state, u[k - 1], u[k])
        streamed = filter.derivatives(state, u[k], 4)
        assert_close(streamed / scale, offline[:, k] / scale, rtol=0.0, atol=1e-14)
    direct = filter.step(filter.init(u[0]), u[0], u[1], 1e-3)
    assert_close(direct, hold(filter.init(u[0]), u[0], u[1]), rtol=1e-15)


@pytest.mark.slow
@each_family
def test_jit_vmap_loop(family):
    _, u = samples(count=30)
    cutoffs = jnp.array([5.0, 50.0])

    def run(cutoff, u):
        return family(3, cutoff).apply(u, 1e-3, 2)

    loop = jnp.stack([run(cutoff, u) for cutoff in cutoffs])
    mapped = jax.jit(jax.vmap(run, in_axes=(0, None)))(cutoffs, u)
    # Derivatives carry the rounding of the samples, multiplied by powers of the rate.
    rates = [float(family(3, cutoff).rate()) for cutoff in cutoffs]
    scale = np.array(rates)[:, None] ** np.arange(3)
    scale = scale[:, :, None, None]
    assert_close(mapped / scale, loop / scale, rtol=0.0, atol=1e-14)
    channels = jax.vmap(lambda c: run(5.0, c), in_axes=1, out_axes=2)(u)
    assert_close(channels / scale[0], loop[0] / scale[0], rtol=0.0, atol=1e-14)


@pytest.mark.slow
@each_family
def test_gradient(family):
    _, u = samples(count=25)
    run = lambda filter, u, dt: filter.apply(u, dt, 3)[0:2]
    assert_gradient(run, family(3, 20.0), jnp.asarray(u), jnp.asarray(1e-3))
    response = lambda filter, w: jnp.abs(filter.frequency_response(w))
    assert_gradient(response, family(4, 20.0), jnp.array([3.0, 100.0]), order=2)


@pytest.mark.slow
@each_family
def test_limits(family):
    _, u = samples(count=10)
    # A filter far faster than the sampling lags by its delay; a slow one rests.
    fast = family(5, 1e8)
    lag = float(fast.delay()) * np.max(np.abs(np.diff(u, axis=0))) / 1e-3
    # Twenty squarings of the matrix exponential double its rounding twenty times.
    rounding = 2.0**20 * np.finfo(float).eps * np.max(u)
    assert_close(fast.apply(u, 1e-3, 0)[0], u, rtol=0.0, atol=lag + rounding)
    slow = family(5, 1e-300).apply(u, 1e-3, 3)
    assert_close(slow[0], np.broadcast_to(u[0], u.shape), rtol=1e-14)
    assert_close(slow[1:], np.zeros_like(slow[1:]), rtol=0.0, atol=1e-290)
    # Constant input stays at rest, at any size.
    for size in (0.0, 1e-300, 1e8):
        y = family(4, 20.0).apply(np.full((50, 1), size), 1e-3, 2)
        assert_close(y[0], np.full((50, 1), size), rtol=1e-13)
        rate = float(family(4, 20.0).rate())
        assert_close(y[2] / rate**2, np.zeros((50, 1)), rtol=0.0, atol=1e-13 * size)
    gain = family(4, 20.0).frequency_response(jnp.array([1e-300, 1e300]))
    assert_close(gain, np.array([1.0, 0.0]) + 0j, rtol=1e-15)
    slope = eqx.filter_grad(lambda f: f.apply(u, 1e-3, 0)[0, -1, 0])(family(5, 1e8))
    assert jnp.isfinite(slope.cutoff)


@each_family
def test_refusals(family):
    with pytest.raises(ValueError, match="`cutoff` must be positive"):
        family(3, 0.0)
    with pytest.raises(ValueError, match="`cutoff` must be positive"):
        family(3, math.nan)
    with pytest.raises(ValueError, match="`cutoff`.* must have the shape"):
        family(3, jnp.ones(2))
    with pytest.raises(ValueError, match="`order` must be a positive whole number"):
        family(0, 1.0)
    filter = family(3, 10.0)
    with pytest.raises(ValueError, match="order 4 or higher"):
        filter.apply(jnp.zeros((5, 2)), 1e-3, 4)
    with pytest.raises(ValueError, match="order 5 or higher"):
        filter.derivatives(filter.init(0.0), 0.0, 5)
    with pytest.raises(ValueError, match="`order` must not be negative"):
        filter.derivatives(filter.init(0.0), 0.0, -1)


def test_bessel_order_is_bounded():
    with pytest.raises(ValueError, match="must not be above 25"):
        BesselFilter(26, 1.0)
