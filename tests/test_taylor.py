"""Truncated Taylor arithmetic against nested `jvp` and closed forms."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import (
    Series,
    compose,
    concatenate,
    cross,
    from_derivatives,
    leading,
    linear,
    product,
    sin_cos,
    skew,
    solve_positive,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


ORDER = 5
TIME = jnp.array(0.3)

# smooth functions of time: a matrix, two vectors, a positive definite matrix
_A = jnp.asarray(np.random.default_rng(1).standard_normal((3, 3)))


def matrix(t):
    return jnp.sin(_A * t) + _A


def vector(t):
    return jnp.stack([jnp.sin(t), jnp.exp(-t), t**3 - t])


def other(t):
    return jnp.stack([jnp.cos(2 * t), t, 1 / (2 + t)])


def positive(t):
    return matrix(t) @ matrix(t).T + jnp.eye(3)


def derivatives(function, order=ORDER):
    """Time derivatives 0 to `order` by nested `jvp`."""

    @jax.jit
    def evaluate(t):
        values, f = [], function
        for _ in range(order + 1):
            values.append(f(t))
            f = functools.partial(
                lambda f, t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1], f
            )
        return jnp.stack(values)

    return evaluate(TIME)


def series(function, order=ORDER):
    return from_derivatives(derivatives(function, order))


# fifth derivatives accumulate some hundred roundings of entries up to 1e3
def assert_series(actual, function, rtol=1e-12):
    expected = derivatives(function, actual.order)
    scale = float(jnp.max(jnp.abs(expected)))
    assert_close(actual.derivatives(), expected, rtol=rtol, atol=rtol * scale)


def test_derivatives_are_returned_as_given():
    values = derivatives(vector)
    x = from_derivatives(values)
    assert_close(x.derivatives(), values, rtol=1e-15)
    assert (x.order, x.shape, x.ndim) == (ORDER, (3,), 1)
    assert_close(leading(x), vector(TIME), rtol=1e-15)
    assert_close(leading(vector(TIME)), vector(TIME), rtol=0.0)


def test_sums_with_series_arrays_and_numbers():
    x, y, c = series(vector), series(other), vector(jnp.array(1.0))
    assert_series(x + y, lambda t: vector(t) + other(t))
    assert_series(x - y, lambda t: vector(t) - other(t))
    assert_series(x + c, lambda t: vector(t) + c)
    assert_series(c + x, lambda t: vector(t) + c)
    assert_series(c - x, lambda t: c - vector(t))
    assert_series(2.0 - x, lambda t: 2.0 - vector(t))
    assert_series(-x, lambda t: -vector(t))


@pytest.mark.slow
def test_products_follow_leibniz():
    x, y, a, c = series(vector), series(other), series(matrix), jnp.array([1.0, 2, 3])
    assert_series(x * y, lambda t: vector(t) * other(t))
    assert_series(x * c, lambda t: vector(t) * c)
    assert_series(c * x, lambda t: vector(t) * c)
    assert_series(3.0 * x, lambda t: 3.0 * vector(t))
    assert_series(product("ij,j->i", a, x), lambda t: matrix(t) @ vector(t))
    assert_series(product("ij,jk->ik", _A, a), lambda t: _A @ matrix(t))
    assert_series(product("ij,jk->ik", a, _A), lambda t: matrix(t) @ _A)
    assert_close(product("i,i->", c, c), 14.0, rtol=0.0)
    assert_series(product("i,i->", x, y), lambda t: vector(t) @ other(t))


def test_polynomial_is_multiplied_exactly():
    # (1 + t)^2 (1 - t) = 1 + t - t^2 - t^3 about t = 0
    up, down = Series(jnp.array([1.0, 1, 0, 0])), Series(jnp.array([1.0, -1, 0, 0]))
    assert_close((up * up * down).coefficients, [1.0, 1, -1, -1], rtol=0.0)


def test_lower_order_wins():
    x, y = series(vector, 5), series(other, 2)
    assert (x + y).order == (y + x).order == (x * y).order == (x - y).order == 2
    assert_series(x * y, lambda t: vector(t) * other(t))
    assert solve_positive(series(positive, 3), x).order == 3
    assert_close(x.truncated(2).coefficients, x.coefficients[:3], rtol=0.0)


def test_rate_index_linear_concatenate():
    x = series(vector)
    assert_series(x.rate(), jax.jacfwd(vector))
    assert_series(x[1], lambda t: vector(t)[1])
    assert_series(series(matrix)[:, 2], lambda t: matrix(t)[:, 2])
    assert_series(linear(lambda v: _A @ v, x), lambda t: _A @ vector(t))
    assert_close(linear(lambda v: 2 * v, _A), 2 * _A, rtol=0.0)
    joined = concatenate([x[None], series(other)[None]])
    assert_series(joined, lambda t: jnp.stack([vector(t), other(t)]))


@pytest.mark.slow
def test_cross_product():
    vectors = load_vectors("A.2")[0]
    a, b = (jnp.array(vectors["inputs"][name]) for name in "ab")
    assert_close(skew(a), vectors["outputs"]["a_tilde"], rtol=0.0)
    assert_close(cross(a, b), vectors["outputs"]["a_cross_b"], rtol=0.0)
    expected = lambda t: jnp.cross(vector(t), other(t))
    assert_series(cross(series(vector), series(other)), expected)
    assert_series(product("ij,j->i", skew(series(vector)), series(other)), expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    "function",
    [jnp.tanh, jnp.arctan, jnp.exp, jax.nn.sigmoid],
    ids=lambda f: f.__name__,
)
def test_compose(function):
    composed = compose(function, series(vector))
    assert_series(composed, lambda t: function(vector(t)), rtol=1e-11)
    assert_close(compose(function, vector(TIME)), function(vector(TIME)), rtol=0.0)


def test_sine_and_cosine():
    sine, cosine = sin_cos(series(vector))
    assert_series(sine, lambda t: jnp.sin(vector(t)), rtol=1e-11)
    assert_series(cosine, lambda t: jnp.cos(vector(t)), rtol=1e-11)
    square = sine * sine + cosine * cosine
    one = jnp.zeros((ORDER + 1, 3)).at[0].set(1.0)
    assert_close(square.coefficients, one, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_solve_positive():
    solution = solve_positive(series(positive), series(vector))
    assert_series(
        solution, lambda t: jnp.linalg.solve(positive(t), vector(t)), rtol=1e-10
    )
    back = product("ij,j->i", series(positive), solution)
    assert_series(back, vector, rtol=1e-11)
    plain = solve_positive(positive(TIME), vector(TIME))
    assert_close(plain, leading(solution), rtol=1e-13)


@pytest.mark.slow
def test_gradient():
    def function(a, b, x):
        x = from_derivatives(x)
        sine, cosine = sin_cos(x)
        square = from_derivatives(a)
        square = product("ik,jk->ij", square, square) + jnp.eye(3)
        return solve_positive(
            square, compose(jnp.tanh, sine * b) + cosine
        ).derivatives()

    arguments = (
        derivatives(matrix, 2),
        jnp.array([1.0, -2, 0.5]),
        derivatives(vector, 2),
    )
    assert_gradient(function, *arguments)


def test_jit_vmap_and_loop_agree():
    def function(x):
        return compose(jnp.tanh, sin_cos(Series(x))[0]).coefficients

    batch = derivatives(vector)[None] * jnp.array([0.5, 1.0, 2.0])[:, None, None]
    loop = jnp.stack([function(x) for x in batch])
    assert_close(jax.jit(jax.vmap(function))(batch), loop, rtol=1e-12, atol=1e-13)


def test_order_zero():
    x = series(vector, 0)
    assert_close(sin_cos(x)[0].derivatives()[0], jnp.sin(vector(TIME)), rtol=1e-15)
    assert_close(
        compose(jnp.tanh, x).derivatives()[0], jnp.tanh(vector(TIME)), rtol=1e-15
    )
