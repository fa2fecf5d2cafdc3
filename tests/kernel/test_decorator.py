"""What `kernel` takes, when it runs the function as it is, what it traces again."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import kernel, written_out

from .comparing import M, X, Y, assert_same, is_kernel


class Record(eqx.Module):
    """Arrays, a count, a function."""

    values: Any
    power: int = eqx.field(static=True)
    law: Any

    def __call__(self, x):
        return self.law(self.values * x**self.power)


def test_structures():
    @kernel
    def function(record, x, *, offset=None, law=jnp.tanh):
        result = law(record(x))
        if offset is not None:
            result = result + offset["by"]
        return {"record": Record(result, record.power, jnp.sin).values, "nothing": None}

    record = Record(X, 2, jnp.cos)
    expected = jnp.tanh(jnp.cos(X * Y**2))
    result = function(record, Y)
    assert result.keys() == {"record", "nothing"} and result["nothing"] is None
    assert_same(result["record"], expected)
    shifted = function(record, Y, offset={"by": jnp.asarray(2.0)}, law=jnp.sin)
    assert_same(shifted["record"], jnp.sin(jnp.cos(X * Y**2)) + 2.0)
    gradient = jax.jit(jax.grad(lambda r: jnp.sum(function(r, Y)["record"])))
    plain = jax.grad(lambda r: jnp.sum(jnp.tanh(jnp.cos(r.values * Y**2))))
    assert_same(
        gradient(Record(X, 2, jax.tree_util.Partial(jnp.cos))).values,
        plain(Record(X, 2, jax.tree_util.Partial(jnp.cos))).values,
    )


def test_the_name_and_text_stay():
    def some_function(x):
        """It does."""
        return x

    assert kernel(some_function).__name__ == "some_function"
    assert kernel(some_function).__doc__ == "It does."
    text = jax.jit(kernel(lambda x: 2.0 * x)).lower(X).as_text()
    assert "elastax_" in text


def test_traced_once_for_shapes_not_for_values():
    traced = []

    @kernel
    def function(x, count=1, law=jnp.sin):
        traced.append(x.shape)
        return count * law(x)

    for scale in (1.0, 2.0):
        function(scale * X)
        jax.vmap(function)(scale * M)
        jax.jit(function)(np.asarray(scale * X))
        jax.grad(lambda x: jnp.sum(function(x)))(X)
    assert len(traced) == 1
    function(X[:2])
    assert_same(function(X, 2), 2 * jnp.sin(X))
    assert_same(function(X, law=jnp.cos), jnp.cos(X))
    assert len(traced) == 4
    assert_same(function(X.astype(jnp.float32)), jnp.sin(X.astype(jnp.float32)), 1e-6)
    assert len(traced) == 5


def test_true_is_not_one():
    function = kernel(lambda x, flag: x if flag is True else 2.0 * x)
    assert_same(function(X, True), X)
    assert_same(function(X, 1), 2.0 * X)


def test_numbers_of_python():
    function = kernel(lambda x, scale: scale * x)
    assert is_kernel(function, X, 2.0)
    assert_same(function(X, 2.0), 2.0 * X)
    assert_same(function(X, np.float64(2.0)), 2.0 * X)
    single = X.astype(jnp.float32)
    assert_same(function(single, 2.0), 2 * single)  # two types: as it is
    assert_same(function(single, np.float32(2.0)), 2 * single)


def effect(x):
    jax.debug.callback(lambda value: None, x)
    return 2.0 * x


@pytest.mark.slow
@pytest.mark.parametrize(
    ("definition", "args"),
    [
        (lambda x, n: x * n.astype(x.dtype), (X, jnp.array(3))),
        (lambda x, y: x.astype(y.dtype) * y, (X.astype(jnp.float32), Y)),
        (lambda x: (x, x > 0.0), (X,)),
        (lambda x: (x, jnp.array(3)), (X,)),
        (lambda x: x.astype(jnp.float32), (X,)),
        (effect, (X,)),
        (lambda x: jnp.abs(x), (jax.lax.complex(X, Y),)),
        (lambda n: 2 * n, (jnp.arange(3),)),
        (lambda x: None, (X,)),
        (lambda x: 2 * x, (X.astype(jnp.float16),)),
        (lambda x: 2 * x, (X.astype(jnp.bfloat16),)),
        (lambda x, k: x * jax.random.uniform(k, (3,)), (X, jax.random.key(0))),
    ],
    ids=(
        "integers two-types flags count other-type effect complex only-integers "
        "nothing half brain key"
    ).split(),
)
def test_functions_run_as_they_are(definition, args):
    function = kernel(definition)
    assert not is_kernel(function, *args)
    rows = lambda *args: jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), args)
    for f in (function, jax.jit(function)):
        assert_same(f(*args), definition(*args), rtol=1e-3)
    batched = jax.vmap(function)(*rows(*args))
    assert_same(batched, jax.vmap(definition)(*rows(*args)), rtol=1e-3)


def test_single_precision():
    plain = lambda x, y: (jnp.sin(x) @ y, x * 0.1 + 1 / y)
    function = kernel(plain)
    x, y = X.astype(jnp.float32), Y.astype(jnp.float32)
    assert is_kernel(function, x, y)

    def evaluate(f):
        return jax.jit(
            lambda x, y: (
                f(x, y),
                jax.jacrev(f)(x, y),
                jax.vmap(f, (0, None))(jnp.stack([x, y]), y),
            )
        )(x, y)

    assert_same(evaluate(function), evaluate(plain), rtol=2e-6, atol=1e-6)


def test_other_precision_of_the_session():
    """A program that was traced with 64 bits is not used without, and back."""
    function = kernel(lambda x: x + jnp.sum(jnp.ones(3)).astype(x.dtype))
    single = X.astype(jnp.float32)
    for _ in range(2):
        assert function(single).dtype == jnp.float32
        with jax.enable_x64(False):
            assert jax.jit(function)(np.asarray(single)).dtype == jnp.float32


def test_written_out():
    function = kernel(lambda x: jnp.sin(x))
    with written_out():
        assert not is_kernel(function, X)
        plain = jax.jit(lambda x: function(x))(X)
    assert is_kernel(function, X)
    assert_same(function(X), plain)
    with pytest.raises(ZeroDivisionError):
        with written_out():
            raise ZeroDivisionError
    assert is_kernel(function, X)


def test_errors_come_through():
    with pytest.raises(ValueError, match="x must"):
        kernel(lambda x: _refuse())(X)
    with pytest.raises(jax.errors.TracerBoolConversionError):
        kernel(lambda x: x if x[0] > 0 else -x)(X)


def _refuse():
    raise ValueError("x must not")
