"""Pade delay: coefficients, transfer function, orders, refusals."""

import cmath

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import PadeDelay

from tests.helpers import assert_close, assert_gradient, load_vectors


@jax.jit
def matrices(delay: PadeDelay):
    """State space of the delay, which is linear."""
    zero = jnp.zeros(delay.order), jnp.zeros(())
    return *jax.jacfwd(delay.rates, argnums=(0, 1))(*zero), jax.grad(delay.output)(
        zero[0]
    )


def transfer(delay: PadeDelay, s: complex) -> complex:
    """G(s) from the state space: c (s I - A)^-1 b."""
    n = delay.order
    a, b, c = map(np.asarray, matrices(delay))
    return complex(c @ np.linalg.solve(s * np.eye(n) - a, b))


def test_vector():
    (vector,) = load_vectors("2.18")
    inputs, outputs = vector["inputs"], vector["outputs"]
    for n in inputs["n"]:
        delay = PadeDelay(0.01, n)
        a, b = delay.coefficients()
        assert_close([1.0, *a], outputs[f"a{n}"], rtol=vector["tol"])
        assert_close([1.0, *b], outputs[f"b{n}"], rtol=vector["tol"])
        real = transfer(delay, inputs["x_real"] / 0.01)
        assert_close(real.real, outputs[f"G{n}_real"], rtol=vector["tol"])
        imaginary = transfer(delay, 1j * inputs["x_imag"] / 0.01)
        ours = np.array([imaginary.real, imaginary.imag])
        assert_close(ours, outputs[f"G{n}_imag"], rtol=vector["tol"])


@pytest.mark.parametrize("order", [1, 2, 3])
def test_error_is_of_twice_the_order(order):
    delay = PadeDelay(0.3, order)
    # large enough to stand out of rounding; the next term takes about 1 - x of it
    big, small = (transfer(delay, x / 0.3) - cmath.exp(-x) for x in (0.25, 0.125))
    assert abs(np.log2(abs(big / small)) - 2 * order) < 0.3


def test_rest_stays():
    delay = PadeDelay(0.02, 4)
    value = jnp.array([0.3, -2.0])
    states = delay.rest(value)
    assert_close(delay.output(states), value, rtol=0.0)
    assert_close(delay.rates(states, value), jnp.zeros((4, 2)), rtol=0.0)


@pytest.mark.slow
def test_gradient_and_extremes():
    states = jnp.array([[0.3, -1.0], [0.2, 0.4], [0.1, -0.3]])
    value = jnp.array([0.5, 0.1])
    function = lambda d, w, u: (d.output(w), d.rates(w, u))
    assert_gradient(function, PadeDelay(0.01, 3), states, value, order=2)
    for size in (0.0, 1e-300, 1e8):
        law = lambda d, w, u: jnp.sum(d.rates(w, u))
        slope = jax.jit(jax.grad(law, argnums=(0, 1, 2)))
        for leaf in jax.tree.leaves(slope(PadeDelay(0.01, 3), size * states, value)):
            assert jnp.all(jnp.isfinite(leaf))


def test_jit_vmap_and_loop_agree():
    delay = PadeDelay(0.01, 3)
    states = jnp.linspace(-1.0, 2.0, 24).reshape(4, 3, 2)
    value = jnp.linspace(0.0, 1.0, 8).reshape(4, 2)
    loop = jnp.stack([delay.rates(w, u) for w, u in zip(states, value, strict=True)])
    # entries are sums of terms about 1e4 / delay
    assert_close(jax.jit(jax.vmap(delay.rates))(states, value), loop, rtol=1e-12)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: PadeDelay(0.0, 3), "`delay` must be positive"),
        (lambda: PadeDelay(-0.1, 3), "`delay` must be positive"),
        (lambda: PadeDelay(0.1, 0), "`order` must be at least 1, but is 0"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
