"""Smooth switches: values, derivatives with their digits, extremes."""

import functools
import math

import jax
import jax.numpy as jnp
import pytest
from elastax._smooth import logistic, smooth_maximum, smooth_minimum, softplus

from tests.helpers import assert_close, assert_gradient, load_vectors


def derivative(function, x):
    return jax.jvp(function, (x,), (jnp.ones_like(x),))[1]


def test_limits_vector():
    (vector,) = load_vectors("2.17")
    inputs, outputs = vector["inputs"], vector["outputs"]
    psi = jnp.array(inputs["psi"])
    a, b = jnp.array(inputs["pairs"]).T
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    assert_close(smooth_maximum(a, b, psi), outputs["max"], **tolerance)
    assert_close(smooth_minimum(a, b, psi), outputs["min"], **tolerance)
    bias = smooth_maximum(a[1], a[1], psi) - a[1]
    assert_close(bias, outputs["bias_max"], **tolerance)


def test_smooth_steps_of_a_play_vector():
    (vector,) = load_vectors("2.13+2.17")
    inputs, outputs = vector["inputs"], vector["outputs"]
    psi, r = jnp.array(inputs["psi"]), inputs["r_h"]

    def step(y, x):
        y = smooth_maximum(x - r, smooth_minimum(x + r, y, psi), psi)
        return y, y

    _, y = jax.lax.scan(step, jnp.array(inputs["y0"]), jnp.array(inputs["x"]))
    assert_close(y, outputs["y"], rtol=vector["tol"], atol=vector["tol"])
    held, _ = jax.lax.scan(step, jnp.array(0.3), jnp.zeros(400))
    assert_close(held, outputs["fixed_point_offset"], rtol=vector["tol"])
    leak = derivative(lambda y: step(y, jnp.array(0.0))[0], held)
    assert_close(leak, outputs["leak_factor"], rtol=vector["tol"])
    golden = math.log(0.5 * (1.0 + math.sqrt(5.0))) / inputs["psi"]
    assert_close(golden, outputs["golden_ratio_bias_r0"], rtol=vector["tol"])
    # the same with the limits themselves: y = smax(0, smin(0, y))
    zero, y = jnp.array(0.0), jnp.array(golden)
    again = smooth_maximum(zero, smooth_minimum(zero, y, psi), psi)
    assert_close(again, golden, rtol=1e-14)


@pytest.mark.parametrize("x", [0.0, 1e-300, 0.3, -2.0, 30.0, -30.0, 600.0, -600.0])
def test_derivatives_keep_their_digits(x):
    at = jnp.array(x)
    decay = math.exp(-abs(x))
    slope = decay / (1.0 + decay) ** 2
    value = (1.0 if x >= 0 else decay) / (1.0 + decay)
    turn = -math.tanh(0.5 * x)  # 1 - 2 logistic, without cancellation
    assert_close(logistic(at), value, rtol=1e-15)
    assert_close(softplus(at), max(x, 0.0) + math.log1p(decay), rtol=1e-15)
    first = functools.partial(derivative, softplus)
    second = functools.partial(derivative, first)
    third = functools.partial(derivative, second)
    assert_close(first(at), value, rtol=1e-15)
    # the exponential at 600 has lost 600 eps
    assert_close(second(at), slope, rtol=1e-13)
    # two functions of order one are subtracted, so near zero digits are absolute
    assert_close(third(at), slope * turn, rtol=1e-13, atol=1e-16)
    assert_close(jax.grad(jax.grad(logistic))(at), slope * turn, rtol=1e-13, atol=1e-16)


@pytest.mark.slow
def test_gradient():
    a, b = jnp.array([0.3, -0.2, 0.1]), jnp.array([0.35, 0.4, 0.1])
    psi = jnp.array([25.0, 3.0, 50.0])
    assert_gradient(smooth_maximum, a, b, psi, order=2)
    assert_gradient(smooth_minimum, a, b, psi, order=2)


@pytest.mark.parametrize("function", [smooth_maximum, smooth_minimum])
def test_extremes_are_finite(function):
    sizes = jnp.array([0.0, 1e-300, 1e8, -1e8])
    a, b = (grid.ravel() for grid in jnp.meshgrid(sizes, sizes))

    def everything(a, b, psi):
        gradient = jax.grad(function, argnums=(0, 1, 2))
        return (
            function(a, b, psi),
            gradient(a, b, psi),
            jax.hessian(function)(a, b, psi),
        )

    for sharpness in (1e-3, 25.0, 1e8):
        psi = jnp.full_like(a, sharpness)
        for leaf in jax.tree.leaves(jax.jit(jax.vmap(everything))(a, b, psi)):
            assert jnp.all(jnp.isfinite(leaf))


def test_minimum_is_below_and_maximum_above_by_at_most_their_bias():
    x = jnp.linspace(-1.0, 1.0, 401)
    psi = jnp.array(20.0)
    above = smooth_maximum(x, -x, psi) - jnp.abs(x)
    below = -jnp.abs(x) - smooth_minimum(x, -x, psi)
    for gap in (above, below):
        # rounding of the values
        assert jnp.all(gap >= -1e-15) and jnp.max(gap) <= math.log(2.0) / 20.0 + 1e-15
    assert_close(jnp.max(above), math.log(2.0) / 20.0, rtol=1e-13)
