"""Every operation that kernels know, its values and derivatives, against the plain."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import NotScalarError, _expand, kernel
from elastax._kernel._expand import _RULES
from jax import lax

from .comparing import M, X, Y, assert_agrees, assert_same, program_of


B = jnp.array([[0.2, -1.0], [1.5, 0.7], [-0.3, 0.9]])
NUMBER = lambda values: lax.convert_element_type(values, float)
T = jnp.asarray(np.random.default_rng(0).standard_normal((2, 3, 4)))


def elementwise(x, y):
    """Operations of one and of two numbers, inside the domain of each."""
    unary = (
        "neg sin cos tan exp expm1 tanh abs sign floor ceil cbrt square logistic"
    ).split()
    positive = "log log1p sqrt rsqrt".split()
    binary = "add sub mul div rem max min atan2".split()
    compare = "lt le gt ge eq ne".split()
    out = {name: getattr(lax, name)(x) for name in unary}
    out |= {name: getattr(lax, name)(x * x + 0.1) for name in positive}
    out |= {name: getattr(lax, name)(x, y) for name in binary}
    out |= {name: NUMBER(getattr(lax, name)(x, y)) for name in compare}
    return out


def powers(x, y):
    return {"pow": lax.pow(x * x, y)} | {
        f"integer_pow {k}": lax.integer_pow(x, k) for k in (-3, -1, 0, 1, 2, 7)
    }


def logic(x, y):
    a, b = x > 0, y > 0
    which = lax.convert_element_type(a, jnp.int32)
    third = which + lax.convert_element_type(x > 1, jnp.int32)
    return {
        "and": NUMBER(a & b),
        "or": NUMBER(a | b),
        "xor": NUMBER(a ^ b),
        "not": NUMBER(~a),
        "all": NUMBER(jnp.all(a)) + NUMBER(jnp.any(b)),
        "where": jnp.where(a, x, y),
        "scalar which": jnp.where(x[0] > 0, x, y),
        "of two": lax.select_n(which, x, y),
        "of three": lax.select_n(third, x, y, x * y),
        "of flags": NUMBER(jnp.where(a, b, a)),
        "is_finite": NUMBER(jnp.isfinite(x)),
        "clamp": lax.clamp(-0.5, x, 0.4),
        "float32": NUMBER(lax.convert_element_type(x, jnp.float32)),
        "integers": NUMBER(lax.convert_element_type(3.0 * x, jnp.int32) // 2),
        "long": NUMBER(lax.rem(lax.convert_element_type(9.0 * x, jnp.int64), 4)),
    }


def reductions(m, t):
    empty = m[:, :0]
    return {
        "sum": jnp.sum(t, (0, 2)),
        "sum of all": jnp.sum(t),
        "max": jnp.max(t, 1),
        "min": jnp.min(t, 0),
        "prod": jnp.prod(t, 2),
        "empty sum": jnp.sum(empty, 1),
        "empty prod": jnp.prod(empty, 1),
        "empty max": jnp.max(empty, 1, initial=-1.0),
        "empty min": jnp.min(empty, 1, initial=1.0),
        "empty any": NUMBER(jnp.any(empty > 0, 1)) + NUMBER(jnp.all(empty > 0, 1)),
        "cumsum": jnp.cumsum(t, 1),
        "cumsum reverse": lax.cumsum(t, axis=2, reverse=True),
        "cumsum of one axis": lax.cumsum(m[0], reverse=True),
    }


def moves(x, m, t):
    return {
        "pad": jnp.pad(m, ((1, 0), (0, 2)), constant_values=0.5),
        "pad inside": lax.pad(m, 2.0, ((0, 1, 2), (1, 0, 1))),
        "pad less": lax.pad(t, 0.0, ((0, 0, 0), (-1, -1, 1), (2, -3, 0))),
        "pad nothing": lax.pad(m[:0], 1.5, ((1, 1, 2), (0, 0, 0))),
        "slice": t[1, ::2, 1:3],
        "rev": t[:, ::-1] + lax.rev(t, (0, 2)),
        "transpose": t.transpose(2, 0, 1),
        "reshape": t.reshape(4, 6),
        "reshape from columns": t.reshape((4, 6), order="F"),
        "squeeze": t[:1, :, 3].squeeze(),
        "expand": x[:, None] * m,
        "broadcast": jnp.broadcast_to(x[:, None], (2, 3, 4)),
        "broadcast in dim": lax.broadcast_in_dim(t, (5, 2, 3, 4), (1, 2, 3)),
        "concatenate": jnp.concatenate([m, 2.0 * m[:1]], 0),
        "stack": jnp.stack([x, 2.0 * x], 1),
        "unstack": jnp.unstack(m)[1],
        "split": jnp.split(t, [1, 3], 2)[1],
        "tile": jnp.tile(x, (2, 2)) + jnp.tile(m, (1, 2))[:2],
        "repeat": jnp.repeat(x, jnp.array([1, 0, 2]), total_repeat_length=3),
        "iota": x * jnp.arange(3.0) + lax.broadcasted_iota(float, (2, 3), 0)[1],
        "copy": jnp.array(x, copy=True),
        "barrier": lax.optimization_barrier((x, m))[1],
    }


def reads(x, m, t):
    fill = dict(mode="fill")
    return {
        "row": m[jnp.array(1)],
        "rows": m[jnp.array([2, 0, -1])],
        "pairs": m[jnp.array([0, 2]), jnp.array([1, -2])],
        "window": t[:, jnp.array([0, 2]), 1:3],
        "axes": jnp.take(t, jnp.array([[1, 0], [3, 3]]), axis=2),
        "along": jnp.take_along_axis(m, jnp.array([[0], [2], [1]]), 1),
        "fill": x.at[jnp.array([1, 5, -7])].get(**fill, fill_value=9.0),
        "clip": x.at[jnp.array([1, 5, -7])].get(mode="clip"),
        "promise": x.at[jnp.array([1, 2])].get(mode="promise_in_bounds"),
        "integers": NUMBER(jnp.arange(3).at[jnp.array([1, 5])].get(**fill)),
        "flags": NUMBER((jnp.arange(3) > 1).at[jnp.array([1, 5])].get(**fill)),
        "dynamic": lax.dynamic_slice(m, (1, jnp.array(0)), (2, 2)),
        "dynamic outside": lax.dynamic_slice(m, (7, -9), (2, 2)),
        "index": lax.dynamic_index_in_dim(t, jnp.array(2), 1),
        "diagonal": jnp.diagonal(m) + jnp.trace(m),
        "triangle": jnp.tril(m) + jnp.triu(m, 1),
    }


def writes(x, m):
    two = jnp.array([0, 2])
    twice = jnp.array([1, 1])
    return {
        "set": x.at[1].set(5.0),
        "rows": m.at[two].set(2.0 * m[:2]),
        "column": m.at[:, 1].add(x),
        "pairs": m.at[two, twice].multiply(3.0, unique_indices=True),
        "twice": x.at[twice].add(x[:2]),
        "window": m.at[1:, :2].set(m[:2, 1:]),
        "dropped": x.at[jnp.array([0, 7])].add(x[:2], mode="drop"),
        "clipped": x.at[jnp.array([0, 7])].set(x[:2], mode="clip"),
        "clipped sum": x.at[jnp.array([-9, 7])].add(x[:2], mode="clip"),
        "dynamic": lax.dynamic_update_slice(m, m[:2, :2], (5, jnp.array(1))),
        "fill diagonal": jnp.fill_diagonal(m, 1.0, inplace=False),
    }


def products(x, m, b, t):
    general = lambda a, c, contract, batch: lax.dot_general(
        a, c, (contract, batch), preferred_element_type=float
    )
    return {
        "dot": x @ x,
        "matrix": m @ b,
        "left": x @ m,
        "batch": t @ t.swapaxes(1, 2),
        "einsum": jnp.einsum("aij,ik,ali->jlk", t, b, t.swapaxes(1, 2)),
        "general": general(t, t, ((1,), (1,)), ((2,), (2,))),
        "all": general(t, t, ((0, 1, 2), (0, 1, 2)), ((), ())),
        "outer": jnp.outer(x, x),
        "cross": jnp.cross(x, m),
        "empty": m[:, :0] @ m[:0],
        "mixed": lax.dot(
            lax.convert_element_type(x, jnp.float32),
            lax.convert_element_type(x, jnp.float32) * 2,
            preferred_element_type=float,
        ),
    }


def solves(x, m, b):
    lower = jnp.linalg.cholesky(m)
    out = {
        "cholesky": lower,
        "upper": jnp.linalg.cholesky(m, upper=True),
        "solve": jax.scipy.linalg.cho_solve((lower, True), x),
    }
    flags = dict(left_side=0, lower=0, transpose_a=0, conjugate_a=0, unit_diagonal=0)
    for values in itertools.product((False, True), repeat=len(flags)):
        options = dict(zip(flags, values))
        right = b if options["left_side"] else b.T
        name = " ".join(key for key, value in options.items() if value)
        out[f"triangular {name}"] = lax.linalg.triangular_solve(m, right, **options)
    return out


@jax.custom_jvp
def custom(x):
    return jnp.sin(x)


custom.defjvp(lambda primals, tangents: (jnp.sin(primals[0]), 2.0 * tangents[0]))


@jax.custom_vjp
def custom_reverse(x):
    return jnp.cos(x)


custom_reverse.defvjp(lambda x: (jnp.cos(x), x), lambda x, ct: (3.0 * x * ct,))


def calls(x, m):
    step = lambda s, row: (jnp.sin(s) + row, s * row)
    last, all_steps = lax.scan(step, x, m)
    back, _ = lax.scan(lambda s, row: (2.0 * s + row @ row, None), 0.0, m, reverse=True)
    inner = kernel(lambda x: (jnp.tanh(x), x @ x))
    return {
        "scan": (last, all_steps),
        "scan back": back,
        "scan of none": lax.scan(lambda s, _: (s, s), x, None, length=0),
        "fori": lax.fori_loop(0, 5, lambda k, s: s * x, x),
        "jit": jax.jit(jnp.sin)(x),
        "checkpoint": jax.checkpoint(lambda x: jnp.sin(x) * x)(x),
        "custom": custom(x),
        "kernel": inner(x),
        "batch of kernels": jax.vmap(inner)(m),
        "batches of kernels": jax.vmap(
            jax.vmap(kernel(lambda a, b: a * b), (0, None)), (None, 0)
        )(x, x[:2]),
        "cond": lax.cond(jnp.array(x.size > 2), jnp.sin, jnp.cos, x),
        "platform": lax.platform_dependent(x, cpu=jnp.sin, default=jnp.cos),
        "derivative": jax.jacfwd(inner)(x),
        "gradient": jax.grad(lambda x: inner(x)[1])(x),
    }


FAMILIES = {
    elementwise: (X, Y),
    powers: (X, Y),
    logic: (X, Y),
    reductions: (M, T),
    moves: (X, M, T),
    reads: (X, M, T),
    writes: (X, M),
    products: (X, M, B, T),
    solves: (X, M, B),
    calls: (X, M),
}
each_family = pytest.mark.parametrize(
    ("family", "args"), FAMILIES.items(), ids=[f.__name__ for f in FAMILIES]
)


@pytest.mark.slow
@each_family
def test_values_and_derivatives(family, args):
    """Value, forward and reverse derivative in two programs, each compiled once."""
    weights = jax.tree.map(
        lambda shape: jnp.cos(jnp.arange(float(shape.size)).reshape(shape.shape)),
        jax.eval_shape(family, *args),
    )

    def derivatives(function):
        def evaluate(*args):
            directions = tuple(jnp.sin(1.0 + a) for a in args)
            value, tangent = jax.jvp(function, args, directions)
            _, pull = jax.vjp(function, *args)
            return value, tangent, pull(weights)

        return jax.jit(evaluate)(*args)

    program_of(family, *args).scalars  # there is a kernel
    value, tangent, cotangents = derivatives(kernel(family))
    expected = derivatives(family)
    for name in value:
        try:
            assert_same(value[name], expected[0][name], rtol=1e-11, atol=1e-13)
            assert_same(tangent[name], expected[1][name], rtol=1e-10, atol=1e-12)
        except AssertionError as error:
            raise AssertionError(f"{name}: {error}") from None
    assert_same(cotangents, expected[2], rtol=1e-10, atol=1e-11)


def test_custom_reverse_rule():
    gradient = jax.jit(jax.grad(lambda x: jnp.sum(kernel(custom_reverse)(x))))
    assert_same(gradient(X), 3.0 * X)


def names_in(jaxpr):
    for eqn in jaxpr.eqns:
        yield eqn.primitive.name
        for value in eqn.params.values():
            inner = getattr(value, "closed", value)
            inner = getattr(inner, "jaxpr", inner)
            if hasattr(inner, "eqns"):
                yield from names_in(inner)


# other versions of JAX give them these names, or the transposition makes them
ELSEWHERE = {
    "add_any",
    "closed_call",
    "checkpoint",
    "copy",
    "copy_p",
    "core_call",
    "custom_vjp_call",
    "expand_dims",
    "pjit",
    "remat",
}


def test_every_rule_is_tested():
    programs = [program_of(f, *args) for f, args in FAMILIES.items()]
    seen = {name for p in programs for name in names_in(p.closed.jaxpr)}
    assert set(_RULES) - seen - ELSEWHERE == set()
    assert seen - set(_RULES) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    "function",
    [
        jnp.sort,
        lambda x: jnp.linalg.svd(jnp.outer(x, x) + M, compute_uv=False),
        lambda x: lax.scan(lambda s, _: (jnp.sin(s), s), x, None, length=40)[1],
        lambda x: lax.while_loop(lambda s: s[0] < 2.0, lambda s: s + x * x, x),
        lambda x: lax.cond(x[0] > 0, jnp.sin, jnp.cos, x),
        lambda x: x[jnp.argmax(x)],
        lambda x: x[lax.convert_element_type(x > 0, int)],
        lambda x: lax.convert_element_type(x.astype("float16"), float),
        lambda x: jnp.abs(lax.complex(x, x) * 2j),
        lambda x: x + jax.random.uniform(jax.random.key(0), (3,)),
        lambda x: lax.linalg.cholesky(jnp.broadcast_to(M, (2, 3, 3))) @ x,
    ],
    ids="sort svd scan while cond argmax index half complex random batch".split(),
)
def test_what_has_no_scalar_form(function):
    with pytest.raises(NotScalarError):
        program_of(function, X).scalars
    assert_agrees(function, X, fused=False)
    batch = jnp.stack([X, Y])

    def derivative(function):
        return jax.jit(lambda xs: jax.vmap(jax.jacfwd(function))(xs))(batch)

    assert_same(derivative(kernel(function)), derivative(function))


def test_what_jax_does_not_differentiate():
    def function(x, y):
        return {
            "pow of integers": lax.pow(x, jnp.array([1, 2, -3])),
            "pow of made integers": lax.pow(x, x.astype(int) + 1),
            "clamp": lax.clamp(x, y, x + 1.0),
            "product twice": x.at[jnp.array([1, 1])].multiply(x[1:]),
        }

    assert_agrees(function, X, Y, fused=True)


def test_a_function_applied_by_scatter():
    """It has no derivative in JAX, and is not the `scatter` that sets values."""
    assert_agrees(lambda x: x.at[jnp.array([0, 1])].apply(jnp.sin), X, fused=False)


def test_extremes_of_the_logistic_function():
    x = jnp.array([-800.0, -40.0, 0.0, 40.0, 800.0])
    value = jax.jit(kernel(jax.nn.sigmoid))(x)
    small = np.exp(-40.0)
    expected = [0.0, small / (1.0 + small), 0.5, 1.0, 1.0]
    np.testing.assert_allclose(value, expected, rtol=1e-15, atol=0.0)
    slope = jax.jit(jax.vmap(jax.grad(kernel(jax.nn.sigmoid))))(x)
    assert np.all(np.isfinite(slope))
    np.testing.assert_allclose(slope[1], small, rtol=1e-12)


def test_structural_zeros_disappear():
    """A product with a sparse matrix costs its entries."""
    sparse = np.zeros((6, 6))
    sparse[[0, 3, 5], [1, 2, 0]] = 1.0, 2.0, -1.0
    graph, results = program_of(lambda x: sparse @ x, jnp.ones(6)).scalars
    made = [graph.names[n] for n in graph.needed(results)]
    assert sorted(made) == sorted(3 * ["input"] + 2 * ["constant"] + ["mul", "neg"])


def test_longest_loop_is_as_said():
    loop = lambda x, n: lax.scan(lambda s, _: (jnp.sin(s), None), x, None, length=n)[0]
    program_of(lambda x: loop(x, _expand._UNROLLED_STEPS), X).scalars
    with pytest.raises(NotScalarError, match="long loop"):
        program_of(lambda x: loop(x, _expand._UNROLLED_STEPS + 1), X).scalars
