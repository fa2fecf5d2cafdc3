"""Kernels under the transformations of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import kernel
from jax import lax

from .comparing import M, X, Y, assert_same


def plain(a, b):
    return jnp.sin(a) * b, (a @ b, jnp.cumsum(b * b))


# the same with what has no scalar form: evaluated as it is written
def sorting(a, b):
    return jnp.sort(a) * b, (a @ b, jnp.sort(b))


fast = kernel(plain)
both = pytest.mark.parametrize("definition", [plain, sorting])


def total(outputs):
    return sum(jnp.sum(jnp.cos(leaf)) for leaf in jax.tree.leaves(outputs))


def test_eager():
    assert_same(fast(X, Y), jax.jit(plain)(X, Y))
    assert_same(jax.vmap(fast, (0, None))(M, Y), jax.vmap(plain, (0, None))(M, Y))
    gradient = lambda f: jax.grad(lambda a: total(f(a, Y)))(X)
    assert_same(gradient(fast), gradient(plain))


@both
def test_axes_and_nesting(definition):
    batch = jnp.stack([M, 2.0 * M, M + 1.0, M * M])  # (4, 3, 3)

    def evaluate(f):
        inner = jax.vmap(f, (1, None), (1, (0, -1)))
        return jax.jit(
            lambda batch: [
                jax.vmap(f, (1, None))(M, X),
                inner(M, X),
                jax.vmap(inner, (0, None), -1)(batch, X),
                jax.vmap(inner, (None, 0))(M, M),
                jax.vmap(jax.vmap(f, (0, None)), (None, 0))(M, batch[:, 0]),
                jax.vmap(jax.vmap(f, (None, 0)), (0, None))(M, batch[:, 0]),
                jax.vmap(jax.vmap(f), (2, None))(batch[:3], M),
            ]
        )(batch)

    assert_same(evaluate(kernel(definition)), evaluate(definition))


def test_results_that_nobody_reads_are_not_computed():
    """The kernel of one result reads and computes what that one needs, in a batch."""
    two = kernel(lambda a, b: (jnp.sin(a), jnp.exp(b)))
    first = jax.jit(lambda a, b: jax.vmap(two, (0, None))(a, b)[0])
    text = first.lower(M, Y).as_text()
    assert "mhlo.fusion" in text and "stablehlo.exponential" not in text
    assert_same(first(M, Y), jnp.sin(M))
    # derivatives of one result: the tangent of the other goes as well
    slope = jax.jit(jax.jacfwd(lambda a, b: two(a, b)[1], (0, 1)))
    assert "stablehlo.sine" not in slope.lower(X, Y).as_text()
    by_first, by_second = slope(X, Y)
    assert_same(by_first, jnp.zeros((3, 3)))
    assert_same(by_second, jnp.diag(jnp.exp(Y)))
    both_read = jax.jit(lambda a, b: two(a, b))
    assert "stablehlo.exponential" in both_read.lower(X, Y).as_text()


@pytest.mark.slow
@both
def test_derivatives(definition):
    def evaluate(f):
        along = lambda a: f(a, Y)
        scalar = lambda a, b: total(f(a, b))

        def all_of(a, b):
            value, push = jax.linearize(along, a)
            kept = jax.checkpoint(lambda a: total(f(jnp.sin(a), b)))
            return {
                "jvp": jax.jvp(f, (a, b), (b, a)),
                "vjp": jax.vjp(f, a, b)[1](f(b, a)),
                "jacfwd": jax.jacfwd(f, (0, 1))(a, b),
                "jacrev": jax.jacrev(f, (0, 1))(a, b),
                "hessian": jax.hessian(scalar, (0, 1))(a, b),
                "other hessian": jax.jacrev(jax.jacfwd(scalar, 1), 0)(a, b),
                "linearize": (value, push(b)),
                "checkpoint": jax.grad(kept)(a),
                "third": jax.jvp(
                    lambda a: jax.jvp(lambda a: jax.grad(scalar)(a, b), (a,), (b,))[1],
                    (a,),
                    (b,),
                )[1],
            }

        return jax.jit(all_of)(X, Y)

    assert_same(evaluate(kernel(definition)), evaluate(definition), rtol=1e-10)


@pytest.mark.slow
@both
def test_derivatives_of_batches(definition):
    """What a batch shares gets the sum of the cotangents; what it lacks gets zeros."""
    rows = jnp.concatenate([M, M + 0.5])

    def evaluate(f):
        shared = jax.vmap(f, (0, None))
        twice = jax.vmap(shared, (None, 0))
        scalar = lambda a, b: total(shared(a, b))
        one = lambda index: lambda a, b: jax.tree.leaves(shared(a, b))[index]
        return jax.jit(
            lambda a, b, c: {
                "grad": jax.grad(scalar, (0, 1))(a, b),
                "hessian": jax.hessian(scalar, 1)(a, b),
                "nested": jax.grad(lambda *x: total(twice(*x)), (0, 1))(a, c),
                "jvp of the shared": jax.jvp(lambda b: shared(a, b), (b,), (2.0 * b,)),
                "one result": [
                    jax.grad(lambda a: jnp.sum(one(k)(a, b)))(a) for k in (0, 2)
                ],
                "batch of gradients": jax.vmap(
                    lambda a: jax.grad(lambda b: total(f(a, b)))(b)
                )(a),
                "both": jax.vmap(
                    lambda b: jax.vmap(jax.grad(lambda a: total(f(a, b))))(a)
                )(c),
            }
        )(rows, X, M)

    assert_same(evaluate(kernel(definition)), evaluate(definition), rtol=1e-10)


@pytest.mark.slow
@both
def test_loops(definition):
    def evaluate(f):
        step = lambda s, row: (lambda y: (0.5 * y[0], y[1]))(f(s, row))
        scan = lambda s, rows: lax.scan(step, s, rows)
        batched = lambda s, rows: lax.scan(
            lambda s, row: (jax.vmap(f, (0, None))(s, row)[0], jnp.sum(s)), s, rows
        )
        going = lambda k_s: (k_s[0] < 3) & (k_s[1][0] < 9.0)
        loop = lambda s, b: lax.while_loop(
            going, lambda k_s: (k_s[0] + 1, f(k_s[1], b)[0]), (0, s)
        )[1]
        choose = lambda s, b: lax.cond(
            s[0] > 0, lambda: f(s, b)[0], lambda: f(b, s)[0] + 1.0
        )
        return jax.jit(
            lambda a, m: {
                "scan": scan(a, m),
                "gradient": jax.grad(lambda a, m: total(scan(a, m)), (0, 1))(a, m),
                "tangent": jax.jvp(scan, (a, m), (2.0 * a, m)),
                "batch of scans": jax.vmap(scan, (0, None))(m, m),
                "batch in a scan": batched(m, m),
                "its gradient": jax.grad(lambda m: total(batched(m, m)))(m),
                "while": (loop(a, m[0]), jax.vmap(loop, (0, None))(m, a)),
                "while tangent": jax.jvp(loop, (a, a), (a, a)),
                "cond": (choose(a, m[0]), jax.vmap(choose, (0, None))(m, -a)),
                "cond gradient": jax.grad(lambda a: total(choose(a, m[0])))(a),
                "map": lax.map(lambda row: f(row, a), m, batch_size=2),
            }
        )(X, M)

    assert_same(evaluate(kernel(definition)), evaluate(definition), rtol=1e-10)


def test_root_with_a_kernel_in_the_residual():
    """Derived programs must not read what they do not use.

    Otherwise JAX takes the derivative of a linear function for one of the solution, and
    the implicit derivative fails.
    """

    def residual(x, p):
        return x * x * p[1] + p[0] * x - p[2], jnp.zeros(2)

    def root(f, p):
        equation = lambda x: f(x, p)[0]
        solve = lambda g, start: lax.fori_loop(
            0, 30, lambda _, x: x - g(x) / jax.jvp(g, (x,), (1.0 + 0.0 * x,))[1], start
        )
        tangent = lambda g, y: y / g(1.0)
        return lax.custom_root(equation, 1.0, solve, tangent)

    def evaluate(f):
        one = lambda p: root(f, p)
        return jax.jit(
            lambda p: {
                "value": one(p),
                "grad": jax.grad(one)(p),
                "hessian": jax.hessian(one)(p),
                "batch": jax.vmap(jax.value_and_grad(one))(jnp.stack([p, 2.0 * p])),
            }
        )(jnp.array([0.5, 1.5, 2.0]))

    assert_same(evaluate(kernel(residual)), evaluate(residual), rtol=1e-9)


def test_linear_functions():
    matrix = np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0]])
    linear = kernel(lambda x: (matrix @ x, 2.0 * x[:1], jnp.zeros(2)))
    back = (jnp.array([1.0, -1.0]), jnp.array([0.5]), jnp.ones(2))
    expected = matrix.T @ back[0] + jnp.array([1.0, 0.0, 0.0])
    transposed = lambda ct: jax.linear_transpose(linear, X)(ct)[0]
    assert_same(transposed(back), expected)
    assert_same(jax.jit(transposed)(back), expected)
    batch = jax.tree.map(lambda leaf: jnp.stack([leaf, 2.0 * leaf]), back)
    assert_same(
        jax.jit(jax.vmap(transposed))(batch), jnp.stack([expected, 2 * expected])
    )
    system = lambda x: kernel(lambda x: M @ x)(x)
    solved = jax.jit(lambda b: jax.scipy.sparse.linalg.cg(system, b, tol=1e-14)[0])(X)
    np.testing.assert_allclose(M @ solved, X, rtol=1e-10)


@pytest.mark.parametrize(
    "definition",
    [
        lambda x: (0.0 * x, jnp.zeros(2), jnp.sign(x), jnp.floor(x)),
        lambda x: (lax.stop_gradient(x) * 2.0, x),
        lambda x: (jnp.ones(3), x[0]),
    ],
    ids=["zero", "stopped", "partly"],
)
def test_derivatives_that_are_zero(definition):
    def evaluate(f):
        rows = jax.vmap(f)
        return jax.jit(
            lambda x, m: (
                jax.jacfwd(f)(x),
                jax.jacrev(f)(x),
                jax.linearize(f, x)[1](x),
                jax.jvp(rows, (m,), (m,)),
                jax.vjp(rows, m)[1](rows(m)),
                jax.vmap(jax.grad(lambda x: total(f(x))))(m),
                jax.hessian(lambda x: total(f(x)))(x),
            )
        )(X, M)

    assert_same(evaluate(kernel(definition)), evaluate(definition))


def test_own_derivatives():
    @jax.custom_jvp
    def sine(x):
        return jnp.sin(x)

    sine.defjvp(lambda primals, tangents: (jnp.sin(*primals), 5.0 * tangents[0]))

    @jax.custom_jvp
    def flat(x):
        return jnp.sin(x)

    # this one reads the value, but not the tangent
    flat.defjvp(lambda primals, tangents: (jnp.sin(*primals), 0.0 * primals[0]))
    gradient = lambda f: jax.jit(jax.grad(lambda x: jnp.sum(kernel(f)(x))))
    assert_same(gradient(lambda x: 2.0 * sine(x))(X), jnp.full(3, 10.0))
    assert_same(gradient(lambda x: flat(x) + x)(X), jnp.ones(3))
    assert_same(jax.linearize(kernel(flat), X)[1](X), jnp.zeros(3))


def test_kernel_in_kernel():
    inner = kernel(lambda x, s: (jnp.sin(x) * s, x @ x))

    def outer(m, s):
        rows, squares = jax.vmap(inner, (0, None))(m, s)
        return inner(rows[0] + squares, s)[0] + jax.jacfwd(lambda s: inner(m[0], s)[0])(
            s
        )

    def evaluate(f):
        return jax.jit(
            lambda m, s: (
                f(m, s),
                jax.vmap(f, (None, 0))(m, jnp.stack([s, 2.0 * s])),
                jax.jacrev(f, (0, 1))(m, s),
                jax.hessian(lambda m: jnp.sum(f(m, s)))(m),
            )
        )(M, jnp.asarray(0.7))

    assert_same(evaluate(kernel(outer)), evaluate(outer), rtol=1e-10)


def test_scalars_and_single_elements():
    plain = lambda a, b: (jnp.sin(a) * b[0], b)
    args = jnp.asarray(0.3), jnp.array([2.0])

    def evaluate(f):
        return jax.jit(
            lambda a, b: (
                f(a, b),
                jax.jacfwd(f, (0, 1))(a, b),
                jax.jacrev(f, (0, 1))(a, b),
                jax.vmap(f, (0, None))(jnp.stack([a]), b),
            )
        )(*args)

    assert_same(evaluate(kernel(plain)), evaluate(plain))


def test_without_jit_and_with_checks_for_nan():
    logarithm = kernel(lambda x: jnp.log(x))
    with jax.disable_jit():
        assert_same(fast(X, Y), plain(X, Y))
        assert_same(jax.vmap(fast, (0, None))(M, X), jax.vmap(plain, (0, None))(M, X))
    with jax.debug_nans(True):
        assert_same(logarithm(X * X), jnp.log(X * X))
        for function in (logarithm, jax.jit(logarithm), jax.vmap(logarithm)):
            with pytest.raises(FloatingPointError):
                function(-X * X)


def test_export_is_plain():
    """An exported program must not depend on what this version of XLA does."""
    function = jax.jit(lambda x, m: jax.vmap(fast, (None, 0))(x, m))
    exported = jax.export.export(function, platforms=("cpu", "cuda"))(X, M)
    assert "fusion" not in exported.mlir_module()
    assert "fusion" in function.lower(X, M).as_text()
    again = jax.export.deserialize(exported.serialize())
    assert_same(again.call(X, M), function(X, M))


def test_compiled_programs_can_be_asked():
    """XLA knows no layouts inside of kernels, and must not stumble over that."""
    compiled = jax.jit(lambda m: jax.vmap(fast, (None, 0))(X, m)).lower(M).compile()
    assert compiled.as_text()
    assert compiled.cost_analysis() is not None
    assert compiled.memory_analysis() is not None
