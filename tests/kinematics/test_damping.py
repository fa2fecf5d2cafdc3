"""Damping law and limiters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import compose, from_derivatives
from elastax.kinematics import (
    ConstantDamping,
    CorrectionLimiter,
    SigmoidDamping,
    attenuate,
    limit,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


LIMITS = jnp.array(-1.0), jnp.array(2.0), jnp.array(20.0)


def published_damping():
    inputs = load_vectors("Reiner 3.66/3.67")[0]["inputs"]
    return SigmoidDamping.from_limits(
        inputs["lam_check"],
        inputs["lam_hat"],
        inputs["sigma_lim1"],
        inputs["sigma_lim2"],
        lower_factor=inputs["k1"],
        upper_factor=inputs["k2"],
    )


def test_damping_from_limits():
    case = load_vectors("Reiner 3.66/3.67")[0]
    expected, tol, damping = case["outputs"], case["tol"], published_damping()
    assert_close(damping.steepness, expected["s_sigma"], rtol=tol)
    assert_close(damping.midpoint, expected["sigma_mid"], rtol=tol)
    for smallest, value in expected["lam_at"].items():
        assert_close(damping(jnp.array(float(smallest))), value, rtol=tol)


def test_damping_is_the_printed_law():
    damping = SigmoidDamping(0.02, 0.5, 30.0, 0.1)
    smallest = jnp.linspace(0.0, 1.0, 11)
    expected = 0.5 - 0.48 / (1 + jnp.exp(-30.0 * (smallest - 0.1)))
    assert_close(damping(smallest), expected, rtol=1e-13)
    assert_close(ConstantDamping(0.3)(smallest), jnp.full(11, 0.3), rtol=0.0)


def test_damping_at_extremes():
    damping = published_damping()
    ends = damping(jnp.array([-1e8, 1e8, -1e300, 1e300]))
    assert_close(ends, [0.1, 1e-4, 0.1, 1e-4], rtol=1e-15)
    assert_close(damping(jnp.array(1e-300)), damping(jnp.array(0.0)), rtol=0.0)
    slopes = jax.vmap(jax.grad(jax.grad(damping)))(jnp.array([0.0, 1e-300, 1e8, -1e8]))
    assert np.all(np.isfinite(slopes))


def test_published_limiter():
    case = load_vectors("Reiner 3.71")[0]
    inputs, expected = case["inputs"], case["outputs"]
    lower, upper, steepness = (jnp.array(inputs[k]) for k in ("lo", "hi", "s"))
    law = lambda x: limit(x, lower, upper, steepness)
    x, tol = jnp.array(inputs["x"]), case["tol"]
    assert_close(law(x), expected["value"], rtol=tol, atol=1e-11)
    slopes = jax.vmap(jax.grad(law))(x)
    # the reference loses digits of the small tails: 1e-11 of a slope of order one
    assert_close(slopes, expected["derivative"], rtol=tol, atol=1e-11)


def test_limiter_is_the_corrected_formula():
    lower, upper, steepness = LIMITS
    x = jnp.linspace(-6.0, 7.0, 40)
    above = 0.5 + jnp.arctan((x - upper) * steepness) / np.pi
    below = 0.5 - jnp.arctan((x - lower) * steepness) / np.pi
    expected = x - x * (above + below) + upper * above + lower * below
    assert_close(limit(x, *LIMITS), expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("steepness", [0.3, 20.0, 1e6])
def test_limiter_is_monotone_and_bounded(steepness):
    x = jnp.concatenate([-jnp.logspace(8, -9, 60), jnp.logspace(-9, 8, 60)])
    value = limit(x, jnp.array(-1.0), jnp.array(2.0), jnp.array(steepness))
    # strictly so in exact arithmetic; here to one rounding of values up to 2
    assert np.all(np.diff(value) >= -5e-16)
    assert np.all((value >= -1 - 5e-16) & (value <= 2 + 5e-16))
    between = jnp.linspace(-1.0, 2.0, 50)
    inner = limit(between, jnp.array(-1.0), jnp.array(2.0), jnp.array(steepness))
    assert np.all(np.diff(inner) > 0)


def test_limiter_at_extremes():
    x = jnp.array([0.0, 1e-300, 1e8, -1e8, 1e150, -1e150])
    assert_close(limit(x[2:], *LIMITS), [2.0, -1, 2, -1], rtol=1e-12)
    law = lambda x: limit(x, *LIMITS)
    for derivative in (law, jax.grad(law), jax.grad(jax.grad(law))):
        assert np.all(np.isfinite(jax.vmap(derivative)(x)))


def test_limits_per_joint():
    limiter = CorrectionLimiter([-0.1, -0.2], [0.1, 0.3], 1e4)
    limited = limiter(jnp.array([1.0, -1.0]))
    # short of the limit by less than 1 / (pi s)
    assert_close(limited, [0.1, -0.2], rtol=0.0, atol=1e-4 / np.pi)


def test_attenuation():
    case = load_vectors("Reiner 3.59")[0]
    inputs, expected = case["inputs"], case["outputs"]
    correction, lever, steepness = (jnp.array(inputs[k]) for k in ("dphi", "l_x", "s"))
    value = attenuate(correction, lever, steepness)
    assert_close(value, expected["dphi_star"], rtol=case["tol"])
    # the bound is attained where the text of the errata says
    lever = expected["x_at_max"] / jnp.sqrt(steepness)
    bound = attenuate(1 / lever, lever, steepness) / jnp.sqrt(steepness)
    assert_close(bound, expected["K"], rtol=case["tol"])
    assert_close(attenuate(correction, 0 * lever, steepness), 0.0, rtol=0.0)


@pytest.mark.parametrize(
    "law",
    [lambda x: limit(x, *LIMITS), published_damping()],
    ids=["limit", "damping"],
)
def test_series_are_nested_jvps(law):
    motion = jnp.array([[0.04, 1.9], [0.1, 0.3], [-2.0, 0.2], [5.0, 4.0]])
    factors = jnp.array([1.0, 1, 2, 6])[:, None]

    @jax.jit
    def nested(t):
        values, f = [], lambda t: law(t ** jnp.arange(4.0) @ (motion / factors))
        for _ in range(4):
            values.append(f(t))
            f = lambda t, f=f: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack(values)

    composed = compose(law, from_derivatives(motion)).derivatives()
    expected = nested(jnp.array(1e-30))
    scale = float(jnp.max(jnp.abs(expected)))
    assert_close(composed, expected, rtol=1e-11, atol=1e-13 * scale)


def test_gradients():
    x = jnp.array([-1.3, -1.0, 0.2, 0.5, 1.7, 2.4])
    assert_gradient(limit, x, *LIMITS, order=2)
    smallest = jnp.array([0.0, 0.02, 0.5])
    assert_gradient(lambda d, x: d(x), SigmoidDamping(0.1, 0.5, 9.0, 0.2), smallest)
    assert_gradient(attenuate, x[:3], smallest, jnp.array(3.0))


def test_jit_vmap_and_loop_agree():
    x = jnp.linspace(-3.0, 3.0, 5)
    loop = jnp.stack([limit(value, *LIMITS) for value in x])
    mapped = jax.jit(jax.vmap(lambda x: limit(x, *LIMITS)))(x)
    assert_close(mapped, loop, rtol=1e-14, atol=1e-15)


def test_refusals():
    make = SigmoidDamping.from_limits
    for message, build in [
        ("`minimum` must be positive", lambda: make(0.0, 0.1, 0.01, 0.1)),
        ("`lower_factor`", lambda: make(1e-4, 0.1, 0.01, 0.1, lower_factor=1.0)),
        ("`upper_factor` must", lambda: make(1e-4, 0.1, 0.01, 0.1, upper_factor=1.0)),
        ("`upper` must exceed", lambda: make(1e-4, 0.1, 0.1, 0.1)),
        ("`upper_factor` times", lambda: make(0.09, 0.1, 0.01, 0.1)),
        ("`maximum` must exceed", lambda: SigmoidDamping(0.2, 0.1, 1.0, 0.0)),
        ("`steepness` must", lambda: SigmoidDamping(0.1, 0.2, -1.0, 0.0)),
        ("`value` must be positive", lambda: ConstantDamping(0.0)),
        ("`upper` must exceed `lower`", lambda: CorrectionLimiter(1.0, 1.0, 1.0)),
        ("`steepness` must", lambda: CorrectionLimiter(0.0, 1.0, 0.0)),
    ]:
        with pytest.raises(ValueError, match=message):
            build()
