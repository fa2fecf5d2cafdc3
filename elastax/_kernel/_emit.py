"""From a graph of scalars to one XLA kernel on the CPU.

Three things make the kernel fast. The scalars are the body of one fusion with many
results (an operation of the MHLO dialect), which XLA emits as straight-line code in
which every value is computed once; left to itself XLA fuses by duplicating. The fusion
stands in a function that XLA keeps as a function and compiles as a single kernel
(`inlineable`, `xla_cpu_small_call`), loops over the batch included.

Inside a fusion XLA knows no layouts here, so that all values have the shape (1, 1) and
are read by slices: operations that reason about layouts would abort the process. This
is why only versions of jaxlib that were tested are trusted.
"""

import math
import os
from collections.abc import Callable, Sequence
from typing import Any

import jaxlib.version
import numpy as np
from jaxlib.mlir import ir
from jaxlib.mlir.dialects import func, mhlo, stablehlo as hlo

from ._graph import NotScalarError
from ._late_constants import folds_late
from ._program import Program
from ._stages import depends, stages


_TESTED = ((0, 10, 2), (0, 11, 0))  # first jaxlib, and the first that is not tested


_MOST_RESULTS = 2000  # compiling takes 10 s, and four times as long for twice as many
_DEEPEST = 2500  # XLA follows chains recursively: with 7000 the stack is used up


def kernels_supported() -> bool:
    """Whether this jaxlib is one for which kernels were tested.

    The environment variable `ELASTAX_KERNELS` goes first: 0 switches kernels off, 1
    trusts any version.
    """
    choice = os.environ.get("ELASTAX_KERNELS", "")
    if choice:
        return choice != "0"
    numbers = jaxlib.version.__version__.split(".")[:3]
    version = tuple(int("".join(filter(str.isdigit, n)) or 0) for n in numbers)
    return _TESTED[0] <= version < _TESTED[1]


_ELEMENT_TYPES: dict[str, Callable] = {
    "float64": lambda: ir.F64Type.get(),
    "float32": lambda: ir.F32Type.get(),
    "bool": lambda: ir.IntegerType.get_signless(1),
    "int32": lambda: ir.IntegerType.get_signless(32),
    "int64": lambda: ir.IntegerType.get_signless(64),
    "uint32": lambda: ir.IntegerType.get_unsigned(32),
}


def _tensor(shape: Sequence[int], dtype: str) -> Any:
    return ir.RankedTensorType.get(list(shape), _ELEMENT_TYPES[dtype]())


def _literal(value: Any, shape: Sequence[int], dtype: str) -> Any:
    array = np.full(shape, value, dtype)
    if dtype == "bool":
        array = np.packbits(array, bitorder="little")
    buffer: Any = np.ascontiguousarray(array)
    attribute = ir.DenseElementsAttr.get(
        buffer, type=_ELEMENT_TYPES[dtype](), shape=list(shape)
    )
    return hlo.constant(attribute)


def _dims(*numbers: int) -> Any:
    return ir.DenseI64ArrayAttr.get(list(numbers))


def _compare(direction: str) -> Callable:
    return lambda a, b: hlo.compare(a, b, hlo.ComparisonDirectionAttr.get(direction))


_OPERATIONS: dict[str, Callable] = {
    "add": hlo.add,
    "sub": hlo.subtract,
    "mul": hlo.multiply,
    "div": hlo.divide,
    "rem": hlo.remainder,
    "neg": hlo.negate,
    "max": hlo.maximum,
    "min": hlo.minimum,
    "pow": hlo.power,
    "atan2": hlo.atan2,
    "sin": lambda a: hlo.sine(a),
    "cos": lambda a: hlo.cosine(a),
    "tan": lambda a: hlo.tan(a),
    "exp": lambda a: hlo.exponential(a),
    "expm1": lambda a: hlo.exponential_minus_one(a),
    "log": lambda a: hlo.log(a),
    "log1p": lambda a: hlo.log_plus_one(a),
    "sqrt": lambda a: hlo.sqrt(a),
    "rsqrt": lambda a: hlo.rsqrt(a),
    "cbrt": lambda a: hlo.cbrt(a),
    "tanh": lambda a: hlo.tanh(a),
    "abs": hlo.abs,
    "sign": hlo.sign,
    "floor": hlo.floor,
    "ceil": hlo.ceil,
    "is_finite": hlo.is_finite,
    "and": hlo.and_,
    "or": hlo.or_,
    "xor": hlo.xor,
    "not": hlo.not_,
    "select": hlo.select,
    "lt": _compare("LT"),
    "le": _compare("LE"),
    "gt": _compare("GT"),
    "ge": _compare("GE"),
    "eq": _compare("EQ"),
    "ne": _compare("NE"),
}


class _Kernel:
    """Emits the loops and the fusions of one program.

    The axis on which most operations depend is the outermost loop; what does not change
    in a loop is computed in front of it (`_stages`). Rows (1, n) hold the elements of
    an operand for one sample, or the values that one stage hands to the loops inside.
    """

    def __init__(
        self,
        program: Program,
        levels: tuple[int, ...],
        shapes: Sequence[tuple[int, ...]],
        joined: bool,
        add_function: Callable,
    ):
        self.graph, self.results = program.scalars
        self.add_function = add_function
        self.dtype = str(program.outputs[0].dtype)
        self.levels = levels
        self.shapes = shapes
        self.sizes = [math.prod(a.shape) for a in program.inputs]
        self.where = [(k, j) for k, size in enumerate(self.sizes) for j in range(size)]
        needed = self.graph.needed(self.results)
        inputs = [n for n in needed if self.graph.names[n] == "input"]
        # operands that matter; XLA refuses empty ones here
        self.used = sorted({self._place_of(n)[0] for n in inputs})
        axes = [level for level, size in enumerate(levels) if size > 1]
        self.axes = sorted(axes, key=lambda level: -self._dependent(level))
        self.joined = joined or bool(axes)
        self.stages = stages(
            self.graph,
            self.results,
            lambda n: self._depth_of(self._place_of(n)[0]),
            len(self.axes),
        )
        # what is handed in, found by its place in the row of its stage
        self.handed = {
            node: (("stage", d), j)
            for d, nodes in enumerate(self.stages.handed)
            for j, node in enumerate(nodes)
        }

    def _dependent(self, level: int) -> int:
        """Operations that change along a batch axis."""
        changes = lambda n: self.shapes[self._place_of(n)[0]][level] > 1
        return len(depends(self.graph, self.results, changes))

    def _depth_of(self, k: int) -> int:
        """Number of loops within which an operand changes."""
        changing = [self.shapes[k][level] > 1 for level in self.axes]
        return max((d + 1 for d, yes in enumerate(changing) if yes), default=0)

    def _place_of(self, node: int) -> tuple[int, int]:
        return self.where[self.graph.operands[node][0]]

    def operand_types(self) -> list[Any]:
        """Rows for one sample; for a batch one vector with all operands in it.

        XLA cannot hand a large constant to a loop in here, nor a constant that it finds
        late to anything in here, and would abort: a vector of all operands is constant
        only if all of them are.
        """
        if not self.joined:
            return [_tensor((1, self.sizes[k]), self.dtype) for k in self.used]
        return [_tensor((sum(self._lengths()),), self.dtype)] if self.used else []

    def _lengths(self) -> list[int]:
        return [math.prod(self.shapes[k]) * self.sizes[k] for k in self.used]

    def gather(self, operands: Sequence[Any]) -> list[Any]:
        """The kernel's operands from those of the primitive."""
        if not self.joined:
            kinds = self.operand_types()
            return [hlo.reshape(t, operands[k]) for t, k in zip(kinds, self.used)]
        flat = [
            hlo.reshape(_tensor((length,), self.dtype), operands[k])
            for length, k in zip(self._lengths(), self.used)
        ]
        return [_joined(flat)] if flat else []

    def result_shape(self) -> tuple[int, int]:
        return math.prod(self.levels), len(self.results)

    def emit(self, operands: Sequence[Any]) -> Any:
        """All results of the whole batch, (batch, results)."""
        functions = [
            self._stage(d, nodes)
            for d, nodes in enumerate([*self.stages.handed, self.results])
        ]
        if not self.joined:
            rows: dict[Any, Any] = dict(zip(self.used, operands))
            return self._run(functions[0], rows)
        self.functions = functions
        self.starts = dict(zip(self.used, np.cumsum([0, *self._lengths()]).tolist()))
        whole = _literal(0, self.result_shape(), self.dtype)
        return self._within(dict(zip(["vector"], operands)), [], whole)

    def _within(self, rows: dict[Any, Any], counters: list[Any], whole: Any) -> Any:
        """What stands inside the loops that are open: rows, a stage, the next loop."""
        depth = len(counters)
        rows = dict(rows)
        for k in self.used:
            if self._depth_of(k) == depth:
                rows[k] = self._row(k, rows["vector"], counters)
        if depth == len(self.axes):
            place = self._place(self.levels, counters)
            sample = self._run(self.functions[depth], rows)
            return hlo.dynamic_update_slice(whole, sample, place)
        if self.stages.handed[depth]:
            rows[("stage", depth)] = self._run(self.functions[depth], rows)
        carried = [_literal(0, (), "int64"), whole, *counters, *rows.values()]
        types = [c.type for c in carried]
        loop = hlo.WhileOp(types, carried)
        test = loop.regions[0].blocks.append(*types)
        with ir.InsertionPoint(test):
            limit = _literal(self.levels[self.axes[depth]], (), "int64")
            hlo.return_([_compare("LT")(test.arguments[0], limit)])
        body = loop.regions[1].blocks.append(*types)
        with ir.InsertionPoint(body):
            counter, inner, *rest = body.arguments
            outer, values = rest[:depth], rest[depth:]
            inner = self._within(dict(zip(rows, values)), [*outer, counter], inner)
            step = hlo.add(counter, _literal(1, (), "int64"))
            hlo.return_([step, inner, *outer, *values])
        return loop.results[1]

    def _place(self, extent, counters):
        """Start of a sample's row among rows that run over the axes of `extent`."""
        place = zero = _literal(0, (), "int64")
        for level, size in enumerate(extent):
            if size > 1:
                scaled = hlo.multiply(place, _literal(size, (), "int64"))
                place = hlo.add(scaled, counters[self.axes.index(level)])
        return [place, zero]

    def _row(self, k, vector, counters):
        """Row (1, size) of an operand from the vector of all operands."""
        size = self.sizes[k]
        place, _ = self._place(self.shapes[k], counters)
        place = hlo.multiply(place, _literal(size, (), "int64"))
        place = hlo.add(place, _literal(self.starts[k], (), "int64"))
        part = hlo.dynamic_slice(vector, [place], _dims(size))
        return hlo.reshape(_tensor((1, size), self.dtype), part)

    def _stage(self, depth: int, nodes: list[int]) -> Any:
        """Function from the rows that a stage reads to the row of its nodes."""
        if not nodes:
            return None
        read = self._read(depth, self._order(depth, nodes))
        # in a function of its own: XLA would draw operations around it into the fusion
        row = _tensor((1, len(nodes)), self.dtype)
        types = [_tensor((1, self._width(key)), self.dtype) for key in read]
        signature = ir.FunctionType.get(types, [row])
        function = self.add_function(f"stage_{depth}", signature)
        with ir.InsertionPoint(function.add_entry_block()):
            rows = dict(zip(read, function.arguments))
            func.ReturnOp([hlo.reshape(row, self._column(depth, rows, nodes))])
        return function, read

    def _run(self, stage: Any, rows: dict[Any, Any]) -> Any:
        function, read = stage
        return _call(function, [rows[key] for key in read])

    def _width(self, key: Any) -> int:
        if isinstance(key, tuple):
            return len(self.stages.handed[key[1]])
        return self.sizes[key]

    def _order(self, depth: int, nodes: list[int]) -> list[int]:
        """Nodes that a stage computes or reads, operands first."""
        seen: set[int] = set()
        stack = list(nodes)
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            given = self.graph.names[node] in ("constant", "input")
            # no row holds a condition: it is computed wherever it is read
            here = self.stages.depth[node] == depth or node not in self.handed
            if not given and here:
                stack.extend(self.graph.operands[node])
        return sorted(seen)

    def _read(self, depth: int, order: list[int]) -> list[Any]:
        """Rows that a stage reads."""
        sources = [self._source(n) for n in order]
        keys = {s[0] for s in sources if s is not None}
        return sorted(keys - {("stage", depth)}, key=str)

    def _source(self, node: int) -> tuple[Any, int] | None:
        """Row and place of an input or of a value that is handed in."""
        if self.graph.names[node] == "input":
            return self._place_of(node)
        return self.handed.get(node)

    def _column(self, depth: int, rows: dict[Any, Any], nodes: list[int]) -> Any:
        """Values of the nodes of one stage, (nodes, 1), from the rows that it reads."""
        values = {n: self._given(n, rows) for n in set(nodes)}
        # what is only passed on does not go through the fusion: XLA would abort
        made = [n for n, value in values.items() if value is None]
        if made:
            order = self._order(depth, made)
            read = self._read(depth, order)
            inputs = [rows[key] for key in read]
            fusion = mhlo.FusionOp(
                [_tensor((1, 1), self.dtype)] * len(made),
                inputs,
                fusion_kind=mhlo.FusionKindAttr.get("kLoop"),
            )
            block = fusion.operation.regions[0].blocks.append(*[x.type for x in inputs])
            with ir.InsertionPoint(block):
                inside = dict(zip(read, block.arguments))
                mhlo.ReturnOp(self._scalars(inside, order, made))
            values.update(zip(made, fusion.operation.results))
        return _joined([values[node] for node in nodes])

    def _scalars(self, rows, order, made):
        """Values of the nodes `made`, inside the fusion."""
        graph = self.graph
        values: dict[int, Any] = {}
        for node in order:
            value = self._given(node, rows)
            if value is None:
                operands = [values[i] for i in graph.operands[node]]
                if graph.names[node] == "convert":
                    kind = _tensor((1, 1), graph.dtypes[node])
                    value = hlo.convert(kind, *operands)
                else:
                    value = _OPERATIONS[graph.names[node]](*operands)
            values[node] = value
        return [values[node] for node in made]

    def _given(self, node, rows):
        """Constant, input or value handed in, (1, 1); `None` for one to compute."""
        if self.graph.names[node] == "constant":
            return _literal(
                self.graph.operands[node][0], (1, 1), self.graph.dtypes[node]
            )
        source = self._source(node)
        if source is None or source[0] not in rows:
            return None
        key, j = source
        return hlo.slice(rows[key], _dims(0, j), _dims(1, j + 1), _dims(1, 1))


def _joined(parts: list[Any]) -> Any:
    """Concatenation along the first axis."""
    if len(parts) == 1:
        return parts[0]
    return hlo.concatenate(parts, ir.IntegerAttr.get(_ELEMENT_TYPES["int64"](), 0))


def _call(function: Any, operands: list[Any], extra: dict[str, str] = {}) -> Any:
    """Call that XLA keeps; the function has one result."""
    call = func.CallOp(
        function.type.results,
        ir.FlatSymbolRefAttr.get(function.name.value),
        operands,
    )
    attributes = {"inlineable": "false"} | extra
    call.operation.attributes["mhlo.frontend_attributes"] = ir.DictAttr.get(
        {key: ir.StringAttr.get(value) for key, value in attributes.items()}
    )
    return call.results[0]


def emit_kernel(
    ctx: Any, operands: Sequence[Any], program: Program, levels: tuple[int, ...]
) -> list[Any]:
    """Call of the kernel's function; results as the primitive gives them.

    Raises:
        NotScalarError: the program has no scalar form.
    """
    graph, results = program.scalars  # raises before anything is emitted
    if len(set(results)) > _MOST_RESULTS:
        raise NotScalarError("too many results")
    if graph.depth(results) > _DEEPEST:
        raise NotScalarError("too long a chain of operations")
    shapes = [a.shape[: len(levels)] for a in ctx.avals_in]
    folded = not any(size > 1 for size in levels) and any(map(folds_late, operands))
    kernel, function = _function(ctx, program, levels, tuple(shapes), folded)
    gathered = kernel.gather(operands)
    results = _call(function, gathered, {"xla_cpu_small_call": "true"})
    return _split(results, program, levels)


def _function(ctx, program, levels, shapes, joined):
    """The kernel and its function in this module, made once."""
    cache = ctx.module_context.cached_primitive_lowerings
    key = ("elastax_kernel", program, levels, shapes, joined)
    if key in cache:
        return cache[key]
    context = ctx.module_context

    def add_function(suffix, signature):
        with ir.InsertionPoint(context.module.body):
            function = func.FuncOp(
                f"elastax_{program.name}_{suffix}", signature, visibility="private"
            )
        context.symbol_table.insert(function)
        return function

    kernel = _Kernel(program, levels, shapes, joined, add_function)
    inputs = kernel.operand_types()
    output = _tensor(kernel.result_shape(), kernel.dtype)
    function = add_function("kernel", ir.FunctionType.get(inputs, [output]))
    with ir.InsertionPoint(function.add_entry_block()):
        func.ReturnOp([kernel.emit(function.arguments)])
    cache[key] = kernel, function
    return cache[key]


def _split(results: Any, program: Program, levels: tuple[int, ...]) -> list[Any]:
    """Arrays of the program's outputs from the rows of all results."""
    arrays, first = [], 0
    count = math.prod(levels)
    for aval in program.outputs:
        size = math.prod(aval.shape)
        bounds = _dims(0, first), _dims(count, first + size)
        part = hlo.slice(results, *bounds, _dims(1, 1))
        kind = _tensor((*levels, *aval.shape), str(aval.dtype))
        arrays.append(hlo.reshape(kind, part))
        first += size
    return arrays
