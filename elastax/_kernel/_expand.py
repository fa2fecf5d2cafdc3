"""From a jaxpr on small arrays to a graph of scalars."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

from ._graph import Graph, NotScalarError
from ._moves import (
    broadcast_in_dim,
    dynamic_slice,
    dynamic_update_slice,
    gather,
    matrices,
    pad,
    scatter,
)


Nodes = np.ndarray  # of node indices, int64

_UNROLLED_STEPS = 16  # longest loop that is written out


def expand(closed: ClosedJaxpr, graph: Graph, arguments: Sequence[Nodes]) -> list:
    """Nodes of the results of a jaxpr.

    Args:
        closed: the program.
        graph: receives the operations.
        arguments: nodes of the inputs, arrays of the inputs' shapes.

    Raises:
        NotScalarError: an operation is not known here.
    """
    jaxpr = closed.jaxpr
    values: dict[Any, Nodes] = {}

    def read(atom):
        if isinstance(atom, Literal):
            return graph.constants(atom.val, _dtype(atom))
        return values[atom]

    for var, constant in zip(jaxpr.constvars, closed.consts):
        values[var] = graph.constants(constant, _dtype(var))
    values.update(zip(jaxpr.invars, arguments))
    for eqn in jaxpr.eqns:
        if not eqn.outvars:
            continue
        name = eqn.primitive.name
        rule = _RULES.get(name)
        if rule is None:
            raise NotScalarError(name)
        operands = [read(v) for v in eqn.invars]
        outputs = rule(graph, operands, _dtype(eqn.outvars[0]), eqn.params)
        outputs = outputs if isinstance(outputs, list) else [outputs]
        for var, output in zip(eqn.outvars, outputs):
            values[var] = np.asarray(output, np.int64).reshape(var.aval.shape)
    return [read(v) for v in jaxpr.outvars]


def _dtype(atom: Any) -> str:
    return str(getattr(atom.aval, "dtype", ""))


def _each(function: Callable, *operands: Nodes) -> Nodes:
    """Apply a function of scalars to all elements."""
    operands = tuple(np.broadcast_arrays(*operands))
    columns = [x.ravel().tolist() for x in operands]
    results = [function(*row) for row in zip(*columns)]
    return np.array(results, np.int64).reshape(operands[0].shape)


def _convert(graph, operands, dtype, _=None):
    return _each(lambda a: graph.apply("convert", a, dtype=dtype), *operands)


def _elementwise(name: str) -> Callable:
    def rule(graph, operands, dtype, _):
        return _each(lambda *a: graph.apply(name, *a, dtype=dtype), *operands)

    return rule


def _pow(graph, operands, dtype, _):
    def one(base, exponent):
        exponent = graph.apply("convert", exponent, dtype=dtype)
        return graph.apply("pow", base, exponent, dtype=dtype)

    return _each(one, *operands)


def _power(graph: Graph, node: int, exponent: int) -> int:
    if exponent < 0:
        one = graph.constant(1, graph.dtypes[node])
        inverse = _power(graph, node, -exponent)
        return graph.apply("div", one, inverse, dtype=graph.dtypes[node])
    result, square = graph.constant(1, graph.dtypes[node]), node
    while exponent:
        if exponent & 1:
            result = graph.multiply(result, square)
        exponent >>= 1
        if exponent:
            square = graph.multiply(square, square)
    return result


def _integer_pow(graph, operands, dtype, params):
    return _each(lambda a: _power(graph, a, params["y"]), *operands)


def _logistic(graph, operands, dtype, _):
    # 1/(1 + exp(-x)): where exp overflows, the quotient is the right zero
    one = graph.constant(1, dtype)

    def logistic(a):
        minus = graph.apply("neg", a, dtype=dtype)
        growing = graph.apply("exp", minus, dtype=dtype)
        return graph.apply("div", one, graph.add(one, growing), dtype=dtype)

    return _each(logistic, *operands)


def _select_n(graph, operands, dtype, _):
    which, *cases = operands

    def choose(w, *cases):
        result = cases[0]
        for k, case in enumerate(cases[1:], 1):
            chosen = w
            if graph.dtypes[w] != "bool":
                least = graph.constant(k, graph.dtypes[w])
                chosen = graph.apply("ge", w, least, dtype="bool")
            result = graph.apply("select", chosen, case, result, dtype=dtype)
        return result

    return _each(choose, np.broadcast_to(which, cases[0].shape), *cases)


def _clamp(graph, operands, dtype, _):
    low, x, high = operands
    bounded = _each(lambda a, b: graph.apply("max", a, b, dtype=dtype), x, low)
    return _each(lambda a, b: graph.apply("min", a, b, dtype=dtype), bounded, high)


# of no elements; JAX refuses the largest of no integers, or gives their limit
_EMPTY = {"mul": 1, "max": -np.inf, "min": np.inf, "and": True, "or": False}


def _reduction(name: str) -> Callable:
    def rule(graph, operands, dtype, params):
        (x,) = operands
        axes = params["axes"]
        rest = [d for d in range(x.ndim) if d not in axes]
        shape = [x.shape[d] for d in rest]
        count = math.prod(x.shape[d] for d in axes)
        rows = np.transpose(x, [*rest, *axes]).reshape(math.prod(shape), count).tolist()

        def reduce(row):
            if name == "add":
                return graph.total(row, dtype)
            if not row:
                return graph.constant(_EMPTY[name], dtype)
            result = row[0]
            for node in row[1:]:
                result = graph.apply(name, result, node, dtype=dtype)
            return result

        return np.array([reduce(r) for r in rows], np.int64).reshape(shape)

    return rule


def _cumsum(graph, operands, dtype, params):
    rows = np.moveaxis(operands[0], params["axis"], -1)
    if params["reverse"]:
        rows = rows[..., ::-1]
    out = np.array(rows)
    for k in range(1, rows.shape[-1]):
        out[..., k] = _each(graph.add, out[..., k - 1], rows[..., k])
    if params["reverse"]:
        out = out[..., ::-1]
    return np.moveaxis(out, -1, params["axis"])


def _dot_general(graph, operands, dtype, params):
    (lc, rc), (lb, rb) = params["dimension_numbers"]
    a, b = (_convert(graph, [x], dtype) for x in operands)
    left = matrices(a, lb, lc, True)
    right = matrices(b, rb, rc, True)
    # most factors are zeros that are known: those products are not even looked up
    zeros = {n for n in {*left.flat, *right.flat} if graph.is_constant(n, 0)}

    def entry(row, column):
        pairs = zip(row, column)
        kept = [(x, y) for x, y in pairs if x not in zeros and y not in zeros]
        return graph.total((graph.multiply(x, y) for x, y in kept), dtype)

    out = np.array(
        [
            [[entry(row, column) for column in right[k].tolist()] for row in rows]
            for k, rows in enumerate(left.tolist())
        ],
        np.int64,
    )
    free_a = [a.shape[d] for d in range(a.ndim) if d not in lb and d not in lc]
    free_b = [b.shape[d] for d in range(b.ndim) if d not in rb and d not in rc]
    return out.reshape([*(a.shape[d] for d in lb), *free_a, *free_b])


def _cholesky(graph, operands, dtype, _):
    (matrix,) = operands
    if matrix.ndim != 2:
        raise NotScalarError("cholesky of a batch")
    n = matrix.shape[0]
    one = graph.constant(1, dtype)
    lower = np.full((n, n), graph.constant(0, dtype), np.int64)

    def less(node, products):
        for a, b in products:
            node = graph.apply("sub", node, graph.multiply(a, b), dtype=dtype)
        return node

    for j in range(n):
        row = lower[j, :j].tolist()
        pivot = less(int(matrix[j, j]), zip(row, row))
        lower[j, j] = graph.apply("sqrt", pivot, dtype=dtype)
        inverse = graph.apply("div", one, int(lower[j, j]), dtype=dtype)
        for i in range(j + 1, n):
            rest = less(int(matrix[i, j]), zip(lower[i, :j].tolist(), row))
            lower[i, j] = graph.multiply(rest, inverse)
    return lower


def _triangular_solve(graph, operands, dtype, params):
    a, b = operands
    if a.ndim != 2 or params["conjugate_a"]:
        raise NotScalarError("triangular_solve of a batch")
    upside = params["transpose_a"]
    if not params["left_side"]:  # X op(A) = B is op(A)^T X^T = B^T
        b, upside = b.T, not upside
    a, lower = (a.T, not params["lower"]) if upside else (a, params["lower"])
    n = a.shape[0]
    one = graph.constant(1, dtype)
    x = np.array(b)
    for i in range(n) if lower else reversed(range(n)):
        known = range(i) if lower else range(i + 1, n)
        for c in range(x.shape[1]):
            rest = int(x[i, c])
            for k in known:
                term = graph.multiply(int(a[i, k]), int(x[k, c]))
                rest = graph.apply("sub", rest, term, dtype=dtype)
            if not params["unit_diagonal"]:
                inverse = graph.apply("div", one, int(a[i, i]), dtype=dtype)
                rest = graph.multiply(rest, inverse)
            x[i, c] = rest
    return x if params["left_side"] else x.T


def _numbers(graph: Graph, nodes: Nodes) -> np.ndarray:
    """Values of nodes that must be known while tracing."""
    try:
        values = [graph.values[i] for i in nodes.ravel().tolist()]
    except KeyError:
        raise NotScalarError("an index that depends on an argument") from None
    return np.array(values).reshape(nodes.shape)


def _gather(graph, operands, dtype, params):
    x, indices = operands
    mode, fill = str(params["mode"]), params["fill_value"]
    if fill is None:
        fill = np.nan
        if dtype == "bool":
            fill = True
        elif dtype.startswith(("int", "uint")):
            numbers = np.iinfo(dtype)
            fill = numbers.min or numbers.max
    return gather(
        x,
        _numbers(graph, indices),
        params["dimension_numbers"],
        params["slice_sizes"],
        "FILL" not in mode,
        graph.constant(fill, dtype),
    )


def _scatter(combine: Callable | None) -> Callable:
    def rule(graph, operands, dtype, params):
        x, indices, updates = operands
        if combine is None and params["update_jaxpr"] is not None:
            raise NotScalarError("a function applied by scatter")
        return scatter(
            x,
            _numbers(graph, indices),
            updates,
            params["dimension_numbers"],
            lambda old, new: combine(graph, old, new) if combine else new,
            "CLIP" in str(params["mode"]),
        )

    return rule


def _starts(graph, nodes):
    return [int(_numbers(graph, i)) for i in nodes]


def _slice(graph, operands, dtype, params):
    strides = params["strides"] or (1,) * operands[0].ndim
    bounds = zip(params["start_indices"], params["limit_indices"], strides)
    return operands[0][tuple(slice(*b) for b in bounds)]


def _reshape(graph, operands, dtype, params):
    # `expand` gives the new shape
    order = params["dimensions"]
    return operands[0] if order is None else np.transpose(operands[0], order)


def _iota(graph, operands, dtype, params):
    shape, dimension = params["shape"], params["dimension"]
    count = np.arange(shape[dimension])
    line = [-1 if d == dimension else 1 for d in range(len(shape))]
    return graph.constants(np.broadcast_to(count.reshape(line), shape), dtype)


def _split(graph, operands, dtype, params):
    cuts = np.cumsum(params["sizes"])[:-1]
    return np.split(operands[0], cuts, axis=params["axis"])


def _call(key: str) -> Callable:
    def rule(graph, operands, dtype, params):
        closed = params[key]
        if not isinstance(closed, ClosedJaxpr):
            closed = ClosedJaxpr(closed, ())
        return expand(closed, graph, operands)

    return rule


def _scan(graph, operands, dtype, params):
    length, consts, carried = (
        params["length"],
        params["num_consts"],
        params["num_carry"],
    )
    if length > _UNROLLED_STEPS:
        raise NotScalarError("a long loop")
    fixed, state = operands[:consts], operands[consts : consts + carried]
    series = operands[consts + carried :]
    rows: list[Any] = [None] * length
    order = reversed(range(length)) if params["reverse"] else range(length)
    for k in order:
        outputs = expand(
            params["jaxpr"], graph, [*fixed, *state, *(x[k] for x in series)]
        )
        state, rows[k] = outputs[:carried], outputs[carried:]
    shapes = [aval.shape for aval in params["jaxpr"].out_avals[carried:]]
    return [*state, *_stacked(rows, (length,), shapes)]


def _stacked(rows: list, before: tuple, shapes: Sequence[tuple]) -> list[Nodes]:
    """Results of all samples in one array each, of shape `before` + its own."""
    return [
        np.array([row[k] for row in rows], np.int64).reshape(before + shape)
        for k, shape in enumerate(shapes)
    ]


def _platform_index(graph, operands, dtype, params):
    fits = [p is None or "cpu" in p for p in params["platforms"]]
    return np.array(graph.constant(fits.index(True), dtype))


def _cond(graph, operands, dtype, params):
    index, *rest = operands
    branches = params["branches"]
    which = min(max(int(_numbers(graph, index)), 0), len(branches) - 1)
    return expand(branches[which], graph, rest)


def _program(graph, operands, dtype, params):
    closed, levels = params["program"].closed, params["levels"]
    samples = [
        expand(
            closed,
            graph,
            [
                np.asarray(x[tuple(min(i, n - 1) for i, n in zip(place, x.shape))])
                for x in operands
            ],
        )
        for place in itertools.product(*map(range, levels))
    ]
    return _stacked(samples, levels, [aval.shape for aval in closed.out_avals])


_RULES: dict[str, Callable] = {
    name: _elementwise(name)
    for name in (
        "add sub mul div rem neg max min atan2 sin cos tan exp expm1 log log1p "
        "sqrt rsqrt cbrt tanh abs sign floor ceil is_finite "
        "lt le gt ge eq ne and or xor not"
    ).split()
}
_RULES |= {
    "add_any": _elementwise("add"),
    "square": lambda g, ops, dtype, p: _each(lambda a: g.multiply(a, a), *ops),
    "integer_pow": _integer_pow,
    "logistic": _logistic,
    "select_n": _select_n,
    "clamp": _clamp,
    "convert_element_type": _convert,
    "pow": _pow,
    "reduce_sum": _reduction("add"),
    "reduce_max": _reduction("max"),
    "reduce_min": _reduction("min"),
    "reduce_prod": _reduction("mul"),
    "reduce_and": _reduction("and"),
    "reduce_or": _reduction("or"),
    "cumsum": _cumsum,
    "dot_general": _dot_general,
    "cholesky": _cholesky,
    "triangular_solve": _triangular_solve,
    "gather": _gather,
    "scatter": _scatter(None),
    "scatter-add": _scatter(lambda g, old, new: g.add(old, new)),
    "scatter-mul": _scatter(lambda g, old, new: g.multiply(old, new)),
    "dynamic_slice": lambda g, ops, dtype, p: dynamic_slice(
        ops[0], _starts(g, ops[1:]), p["slice_sizes"]
    ),
    "dynamic_update_slice": lambda g, ops, dtype, p: dynamic_update_slice(
        ops[0], ops[1], _starts(g, ops[2:])
    ),
    "slice": _slice,
    "iota": _iota,
    "split": _split,
    "pad": lambda g, ops, dtype, p: pad(ops[0], int(ops[1]), p["padding_config"]),
    "broadcast_in_dim": lambda g, ops, dtype, p: broadcast_in_dim(
        ops[0], p["shape"], p["broadcast_dimensions"]
    ),
    "reshape": _reshape,
    "squeeze": lambda g, ops, dtype, p: ops[0],
    "expand_dims": lambda g, ops, dtype, p: ops[0],
    "copy": lambda g, ops, dtype, p: ops[0],
    "copy_p": lambda g, ops, dtype, p: ops[0],
    "optimization_barrier": lambda g, ops, dtype, p: list(ops),
    "transpose": lambda g, ops, dtype, p: np.transpose(ops[0], p["permutation"]),
    "rev": lambda g, ops, dtype, p: np.flip(ops[0], p["dimensions"]),
    "concatenate": lambda g, ops, dtype, p: np.concatenate(ops, p["dimension"]),
    "stack": lambda g, ops, dtype, p: np.stack(ops, p["axis"]),
    "unstack": lambda g, ops, dtype, p: list(np.moveaxis(ops[0], p["axis"], 0)),
    "tile": lambda g, ops, dtype, p: np.tile(ops[0], p["reps"]),
    "jit": _call("jaxpr"),
    "pjit": _call("jaxpr"),
    "closed_call": _call("call_jaxpr"),
    "core_call": _call("call_jaxpr"),
    "remat": _call("jaxpr"),
    "remat2": _call("jaxpr"),
    "checkpoint": _call("jaxpr"),
    "custom_jvp_call": _call("call_jaxpr"),
    "custom_vjp_call": _call("call_jaxpr"),
    "scan": _scan,
    "cond": _cond,
    "platform_index": _platform_index,
    "elastax_kernel": _program,
}
