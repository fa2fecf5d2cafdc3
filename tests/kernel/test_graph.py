"""Folding of constants and sharing of values in the graph of scalars."""

import jax
import numpy as np
import pytest
from elastax._kernel import _graph
from elastax._kernel._graph import _FOLDS, Graph, NotScalarError


KIND = "float64"


@pytest.fixture
def graph():
    return Graph()


@pytest.fixture
def ab(graph):
    return graph.inputs(0, (2,), KIND).tolist()


def value(graph, node):
    return graph.values[node]


def test_neutral_elements_disappear(graph, ab):
    a, _ = ab
    zero, one = graph.constant(0, KIND), graph.constant(1, KIND)
    apply = lambda name, *nodes: graph.apply(name, *nodes, dtype=KIND)
    assert apply("add", a, zero) == apply("add", zero, a) == a
    assert apply("sub", a, zero) == a
    assert apply("mul", a, one) == apply("mul", one, a) == a
    assert apply("div", a, one) == a
    assert apply("mul", a, zero) == apply("mul", zero, a) == zero
    assert apply("sub", zero, a) == apply("neg", a)
    assert apply("mul", graph.constant(-1, KIND), a) == apply("neg", a)


def test_signs_move_outwards(graph, ab):
    a, b = ab
    apply = lambda name, *nodes: graph.apply(name, *nodes, dtype=KIND)
    minus_a, minus_b = apply("neg", a), apply("neg", b)
    assert apply("neg", minus_a) == a
    assert apply("sub", a, minus_b) == graph.add(a, b)
    assert graph.add(a, minus_b) == apply("sub", a, b)
    assert graph.add(minus_a, b) == apply("sub", b, a)
    assert apply("neg", apply("sub", a, b)) == apply("sub", b, a)
    assert graph.multiply(minus_a, b) == apply("neg", graph.multiply(a, b))
    assert graph.multiply(minus_a, minus_b) == graph.multiply(a, b)


def test_equal_values_are_made_once(graph, ab):
    a, b = ab
    products = {graph.multiply(a, b), graph.multiply(b, a)}
    sums = {graph.add(a, b), graph.add(b, a)}
    sines = {graph.apply("sin", a, dtype=KIND) for _ in range(3)}
    constants = {graph.constant(2, KIND), graph.constant(2.0, KIND)}
    assert list(map(len, (products, sums, sines, constants))) == [1, 1, 1, 1]
    assert graph.constant(0.0, KIND) != graph.constant(-0.0, KIND)
    assert graph.constant(np.nan, KIND) == graph.constant(np.nan, KIND)
    assert graph.constant(1, "int32") != graph.constant(1, KIND)
    assert len(graph.names) == 2 + 3 + 1 + 2 + 1 + 2  # the last 1.0 is new


def test_select_and_convert(graph, ab):
    a, b = ab
    which = graph.apply("lt", a, b, dtype="bool")
    choose = lambda w, yes, no: graph.apply("select", w, yes, no, dtype=KIND)
    assert choose(which, a, a) == a
    assert choose(graph.constant(True, "bool"), a, b) == a
    assert choose(graph.constant(False, "bool"), a, b) == b
    assert graph.names[choose(which, a, b)] == "select"
    convert = lambda node, dtype: graph.apply("convert", node, dtype=dtype)
    assert convert(a, KIND) == a
    assert value(graph, convert(graph.constant(2.7, KIND), "int32")) == 2
    assert value(graph, convert(graph.constant(3, "int32"), KIND)) == 3.0
    for unclear in (np.nan, np.inf, 1e300):
        made = convert(graph.constant(unclear, KIND), "int32")
        assert graph.names[made] == "convert"


def lax_operation(name):
    return getattr(jax.lax, RENAMED.get(name, name))


RENAMED = {name: f"bitwise_{name}" for name in ("and", "or", "xor", "not")}


def test_folds_are_the_operations(graph):
    numbers, flags = (0.5, -1.5), (True, False)
    unary = "neg sin cos tan exp expm1 log log1p sqrt rsqrt tanh abs sign floor ceil"
    unary = [*unary.split(), "is_finite", "not"]

    def operands(name):
        values = flags if name in RENAMED else numbers
        return values[:1] if name in unary else values

    def all_of(x, flag):
        given = lambda values: [
            flag == v if isinstance(v, bool) else x * v for v in values
        ]
        return {name: lax_operation(name)(*given(operands(name))) for name in _FOLDS}

    expected = jax.device_get(jax.jit(all_of)(1.0, True))
    for name, result in expected.items():
        nodes = [
            graph.constant(v, "bool" if isinstance(v, bool) else KIND)
            for v in operands(name)
        ]
        made = value(graph, graph.apply(name, *nodes, dtype=str(result.dtype)))
        np.testing.assert_allclose(made, result, rtol=1e-15, err_msg=name)
    for name in ("div", "rem", "pow", "atan2", "log", "rsqrt"):  # no warning, no error
        nodes = [graph.constant(0.0, KIND)] * (1 if name in unary else 2)
        assert graph.apply(name, *nodes, dtype=KIND) in graph.values


def test_total_and_needed(graph, ab):
    a, b = ab
    assert value(graph, graph.total([], KIND)) == 0
    assert graph.total([a], KIND) == a
    product = graph.multiply(a, b)
    graph.apply("sin", product, dtype=KIND)
    total = graph.total([product, a], KIND)
    assert graph.needed([total]) == sorted([a, b, product, total])
    assert graph.depth([a]) == 0
    assert graph.depth([total]) == 2
    assert graph.depth([]) == 0


def test_limits(graph, ab, monkeypatch):
    with pytest.raises(NotScalarError, match="complex128"):
        graph.apply("add", *ab, dtype="complex128")
    with pytest.raises(NotScalarError, match="float16"):
        graph.constants(np.zeros(2), "float16")
    monkeypatch.setattr(_graph, "_MOST_NODES", len(graph.names))
    with pytest.raises(NotScalarError, match="too many"):
        graph.add(*ab)
