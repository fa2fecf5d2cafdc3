"""Programs of XLA: every operation, every layout of a batch, what XLA would refuse."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import _emit, kernel, kernels_supported
from elastax._kernel._emit import _OPERATIONS
from hypothesis import given, settings, strategies as st
from jax import lax

from .comparing import M, X, Y, assert_agrees, assert_same, is_kernel, program_of


NAN, INF = np.nan, np.inf
ODD = [NAN, INF, -INF, 0.0, -0.0, 1.0, -1.0, 0.7, -2.5, 1e308, 1e-300]


def operations(x, y):
    """All of them, of any numbers."""
    number = lambda values: lax.convert_element_type(values, x.dtype)
    unary = (
        "neg sin cos tan exp expm1 tanh abs sign floor ceil cbrt log log1p sqrt rsqrt"
    ).split()
    binary = "add sub mul div rem max min pow atan2".split()
    out = {name: getattr(lax, name)(x) for name in unary}
    out |= {name: getattr(lax, name)(x, y) for name in binary}
    flags = [getattr(lax, name)(x, y) for name in "lt le gt ge eq ne".split()]
    flags += [lax.is_finite(x), ~flags[0], x.astype(bool)]
    flags += [flags[0] & flags[1], flags[0] | flags[3], flags[1] ^ flags[3]]
    flags += [jnp.where(flags[0], flags[4], flags[1])]
    finite = jnp.clip(jnp.where(jnp.isnan(x), 0.5, x), -9.0, 9.0)
    integer = finite.astype(jnp.int32)
    return out | {
        "flags": [number(flag) for flag in flags],
        "where": jnp.where(flags[0], x, y),
        "sum": x + x[::-1] * y,
        "largest": [jnp.max(x), jnp.min(x[3:]), jnp.sum(x)],
        "integers": number(abs(integer) * 3 - jnp.sign(integer) ** 2),
        "long": number(jnp.maximum(finite.astype(jnp.int64), 2)),
        "other": number(finite.astype(jnp.float32).astype(jnp.float64)),
    }


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_every_operation(dtype):
    with np.errstate(over="ignore"):
        x, y = (jnp.asarray(a.astype(dtype)) for a in np.meshgrid(ODD, ODD))
    compiled = jax.vmap(kernel(operations))
    assert is_kernel(compiled, x, y)
    result = jax.jit(compiled)(x, y)
    expected = jax.jit(jax.vmap(operations))(x, y)
    for name, value in result.items():
        try:
            rtol = 1e-13 if dtype == "float64" else 2e-5
            assert_same(value, expected[name], rtol=rtol, atol=0.0)
        except AssertionError as error:
            raise AssertionError(f"{name}: {error}") from None
    graph, results = program_of(operations, x[0], y[0]).scalars
    seen = {graph.names[n] for n in graph.needed(results)}
    assert seen == set(_OPERATIONS) | {"constant", "input", "convert"}


def passed_on(x, y):
    """Results that are inputs, constants, repeated, empty, of one element."""
    return {
        "twice": (x, x, 2.0 * x, 2.0 * x),
        "element": y[0],
        "constant": (jnp.zeros(2), jnp.array(3.5), jnp.full((1, 1), NAN)),
        "made of constants": lax.cbrt(jnp.array([8.0, 27.0])),
        "empty": (x[:0], jnp.zeros((2, 0))),
    }


ALONE = {
    "input": lambda x, y: x,
    "unused": lambda x, y: y[1],
    "constant": lambda x, y: jnp.ones(2),
    "made of constants": lambda x, y: lax.cbrt(jnp.array(8.0)),
    "empty": lambda x, y: x[:0],
    "one": lambda x, y: x[0] * y[0],
    "all": passed_on,
}


@pytest.mark.slow
@pytest.mark.parametrize("function", ALONE.values(), ids=ALONE)
def test_results_that_are_not_made(function):
    """XLA aborts the process if such results go through the fusion."""
    both = jnp.stack([X, Y])

    def evaluate(function):
        of_both = jax.vmap(function, (0, None))
        return jax.jit(
            lambda both: (
                function(X, Y),
                of_both(both, X),
                jax.vmap(function, (None, 0))(X, both),
                jax.vmap(of_both, (None, 0))(both, both),
                jax.jacfwd(function, 1)(X, Y),
                jax.jacrev(lambda a: of_both(a, X))(both),
            )
        )(both)

    assert_same(evaluate(kernel(function)), evaluate(function))


def test_empty_operands_and_batches():
    empty = jnp.zeros((0, 3))
    function = lambda x, e: (jnp.sin(x) + jnp.sum(e), e, jnp.sum(e, 0))
    assert_agrees(function, X, empty)
    assert_agrees(lambda e: (e, jnp.sum(e)), empty)
    plain = lambda x, y: jnp.sin(x) * y

    def evaluate(function):
        rows = jax.vmap(function, (0, None))
        return jax.jit(
            lambda x, y: (
                rows(x, y),
                jax.vmap(rows, (None, 0))(x, M),
                jax.vmap(lambda x: jax.vmap(function, (None, 0))(x, M))(x),
                jax.grad(lambda y: jnp.sum(rows(x, y)))(y),
                jax.jvp(lambda y: rows(x, y), (y,), (y,)),
            )
        )(empty, X)

    assert_same(evaluate(kernel(plain)), evaluate(plain))


def test_every_layout_of_a_batch():
    """Three axes; operands carry any of them."""
    plain = lambda x, y, z: (jnp.sin(x) * y, x[0] * z + 1.0, y)
    sizes = (2, 3, 1)
    rng = np.random.default_rng(1)

    def operand(bits, shape):
        leading = [size for size, bit in zip(sizes, bits) if bit]
        return jnp.asarray(rng.standard_normal((*leading, *shape)))

    def mapped(function, layout):
        for level in reversed(range(3)):
            axes = [0 if bits[level] else None for bits in layout]
            if any(axis is not None for axis in axes):
                function = jax.vmap(function, axes)
        return function

    choices = [(1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0), (0, 1, 1)]
    layouts = list(itertools.product(choices, choices, choices[1:5]))[::11]
    layouts = [bits for bits in layouts if np.any(bits)]
    args = [
        [operand(bits, shape) for bits, shape in zip(layout, [(3,), (3,), ()])]
        for layout in layouts
    ]

    def evaluate(function):
        return jax.jit(
            lambda all_args: [
                mapped(function, layout)(*one) for layout, one in zip(layouts, all_args)
            ]
        )(args)

    assert_same(evaluate(kernel(plain)), evaluate(plain))


def test_limits_lead_to_the_plain_program(monkeypatch):
    """Of what XLA does not stand: its stack, and time that grows as the square."""

    def chain(x):
        for _ in range(60):
            x = jnp.sin(x) + 0.5
        return x

    assert_agrees(chain, X, fused=True)
    monkeypatch.setattr(_emit, "_DEEPEST", 50)
    assert_agrees(chain, X, fused=False)
    many = lambda x: jnp.outer(x, jnp.arange(1.0, 8.0))
    assert_agrees(many, X, fused=True)
    monkeypatch.setattr(_emit, "_MOST_RESULTS", 20)
    assert_agrees(many, X, fused=False)


def test_longest_chain_is_compiled():
    def chain(x):
        a, b = x[0], x[1]
        for k in range(_emit._DEEPEST // 2 - 1):
            a, b = a * b + 0.1 * (k % 7), a - 0.5 * b
        return a

    compiled = kernel(chain)
    assert is_kernel(compiled, X)
    assert np.isfinite(jax.jit(compiled)(X))


def test_supported_versions(monkeypatch):
    monkeypatch.delenv("ELASTAX_KERNELS", raising=False)
    for version, supported in {
        "0.10.1": False,
        "0.10.2": True,
        "0.10.9.dev20260101": True,
        "0.11.0": False,
        "1.0": False,
    }.items():
        monkeypatch.setattr("jaxlib.version.__version__", version)
        assert kernels_supported() == supported, version
    monkeypatch.setenv("ELASTAX_KERNELS", "1")
    assert kernels_supported()
    monkeypatch.setenv("ELASTAX_KERNELS", "0")
    assert not kernels_supported()
    assert_agrees(jnp.sin, X, fused=False)


# ---------------------------------------------------------------------- small programs

STEPS = {
    "sin": lambda a, b: jnp.sin(a),
    "tanh": lambda a, b: jnp.tanh(a),
    "exp": lambda a, b: jnp.exp(-a * a),
    "neg": lambda a, b: -a,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / (1.5 + jnp.cos(b)),
    "where": lambda a, b: jnp.where(a > b, a, 0.5 * b),
    "turn": lambda a, b: jnp.roll(a, 1) + b[::-1],
    "total": lambda a, b: a * jnp.sum(b),
    "product": lambda a, b: jnp.outer(a, b) @ a,
    "zero": lambda a, b: 0.0 * a + b,
    "constant": lambda a, b: jnp.full_like(a, 0.25),
    "set": lambda a, b: a.at[1].set(b[0]),
    "flags": lambda a, b: ((a > 0.0) & (b < 1.0)).astype(a.dtype),
}
programs = st.lists(
    st.tuples(st.sampled_from(sorted(STEPS)), st.integers(0, 9), st.integers(0, 9)),
    min_size=1,
    max_size=12,
)


@pytest.mark.slow
@settings(max_examples=12, deadline=None, derandomize=True, database=None)
@given(steps=programs, kept=st.lists(st.integers(0, 30), min_size=1, max_size=4))
def test_small_programs(steps, kept):
    def function(x, y):
        values = [x, y]
        for name, i, j in steps:
            values.append(STEPS[name](values[i % len(values)], values[j % len(values)]))
        return [values[k % len(values)] for k in kept]

    def evaluate(function):
        return jax.jit(
            lambda x, m: (
                jax.vmap(function, (None, 0))(x, m),
                jax.vmap(lambda y: jax.jacfwd(function)(x, y))(m),
                jax.vjp(function, x, m[0])[1](function(m[1], x)),
            )
        )(X, M)

    assert_same(evaluate(kernel(function)), evaluate(function), rtol=1e-9, atol=1e-9)
