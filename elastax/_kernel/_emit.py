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
from ._program import Program


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
    """Emits the loops and the fusion of one program.

    The axis along which most data change is the outermost loop; what does not change in
    an inner loop, LLVM moves out of it.
    """

    def __init__(
        self,
        program: Program,
        levels: tuple[int, ...],
        shapes: Sequence[tuple[int, ...]],
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
        changing = [
            sum(size for size, s in zip(self.sizes, shapes) if s[level] > 1)
            for level in range(len(levels))
        ]
        axes = [level for level, size in enumerate(levels) if size > 1]
        self.axes = sorted(axes, key=lambda level: -changing[level])

    def _place_of(self, node: int) -> tuple[int, int]:
        return self.where[self.graph.operands[node][0]]

    def operand_types(self) -> list[Any]:
        """Rows for one sample; for a batch one vector with all operands in it.

        XLA cannot hand a large constant to a loop in here and would abort: a vector of
        all operands is constant only if all of them are.
        """
        if not self.axes:
            return [_tensor((1, self.sizes[k]), self.dtype) for k in self.used]
        return [_tensor((sum(self._lengths()),), self.dtype)] if self.used else []

    def _lengths(self) -> list[int]:
        return [math.prod(self.shapes[k]) * self.sizes[k] for k in self.used]

    def gather(self, operands: Sequence[Any]) -> list[Any]:
        """The kernel's operands from those of the primitive."""
        if not self.axes:
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
        # in a function of its own: XLA would draw operations around it into the fusion
        rows = [_tensor((1, self.sizes[k]), self.dtype) for k in self.used]
        row = _tensor((1, len(self.results)), self.dtype)
        sample = self.add_function("sample", ir.FunctionType.get(rows, [row]))
        with ir.InsertionPoint(sample.add_entry_block()):
            column = self._column(dict(zip(self.used, sample.arguments)))
            func.ReturnOp([hlo.reshape(row, column)])
        if not self.axes:
            return _call(sample, list(operands))
        whole = _literal(0, self.result_shape(), self.dtype)
        starts = dict(zip(self.used, np.cumsum([0, *self._lengths()]).tolist()))
        fixed = [k for k in self.used if math.prod(self.shapes[k]) == 1]
        kept = [self._row(k, operands[0], starts[k], []) for k in fixed]
        self._rows = lambda vector, kept, counters: [
            kept[fixed.index(k)]
            if k in fixed
            else self._row(k, vector, starts[k], counters)
            for k in self.used
        ]
        return self._loop(sample, [*operands, *kept], [], whole)

    def _loop(self, sample, operands, counters, whole):
        """The loops that are still to come, and the sample inside."""
        if len(counters) == len(self.axes):
            rows = self._rows(operands[0], operands[1:], counters) if operands else []
            place = self._place(self.levels, counters)
            return hlo.dynamic_update_slice(whole, _call(sample, rows), place)
        carried = [_literal(0, (), "int64"), whole, *counters, *operands]
        types = [c.type for c in carried]
        loop = hlo.WhileOp(types, carried)
        test = loop.regions[0].blocks.append(*types)
        with ir.InsertionPoint(test):
            limit = _literal(self.levels[self.axes[len(counters)]], (), "int64")
            hlo.return_([_compare("LT")(test.arguments[0], limit)])
        body = loop.regions[1].blocks.append(*types)
        with ir.InsertionPoint(body):
            counter, inner, *rest = body.arguments
            outer, inputs = rest[: len(counters)], rest[len(counters) :]
            inner = self._loop(sample, inputs, [*outer, counter], inner)
            step = hlo.add(counter, _literal(1, (), "int64"))
            hlo.return_([step, inner, *outer, *inputs])
        return loop.results[1]

    def _place(self, extent, counters):
        """Start of a sample's row among rows that run over the axes of `extent`."""
        place = zero = _literal(0, (), "int64")
        for level, size in enumerate(extent):
            if size > 1:
                scaled = hlo.multiply(place, _literal(size, (), "int64"))
                place = hlo.add(scaled, counters[self.axes.index(level)])
        return [place, zero]

    def _row(self, k, vector, start, counters):
        """Row (1, size) of an operand from the vector of all operands."""
        size = self.sizes[k]
        place, _ = self._place(self.shapes[k], counters)
        place = hlo.multiply(place, _literal(size, (), "int64"))
        place = hlo.add(place, _literal(start, (), "int64"))
        part = hlo.dynamic_slice(vector, [place], _dims(size))
        return hlo.reshape(_tensor((1, size), self.dtype), part)

    def _column(self, rows: dict[int, Any]) -> Any:
        """Results of one sample, (results, 1), from the rows of its operands."""
        values = {n: self._given(n, rows) for n in set(self.results)}
        # what is only passed on does not go through the fusion: XLA would abort
        made = [n for n, value in values.items() if value is None]
        if made:
            read = {
                self._place_of(n)[0]
                for n in self.graph.needed(made)
                if self.graph.names[n] == "input"
            }
            rows = {k: row for k, row in rows.items() if k in read}
            inputs = list(rows.values())
            fusion = mhlo.FusionOp(
                [_tensor((1, 1), self.dtype)] * len(made),
                inputs,
                fusion_kind=mhlo.FusionKindAttr.get("kLoop"),
            )
            block = fusion.operation.regions[0].blocks.append(*[x.type for x in inputs])
            with ir.InsertionPoint(block):
                mhlo.ReturnOp(self._scalars(dict(zip(rows, block.arguments)), made))
            values.update(zip(made, fusion.operation.results))
        columns: list[Any] = [values[node] for node in self.results]
        if len(columns) == 1:
            return columns[0]
        return hlo.concatenate(
            columns, ir.IntegerAttr.get(_ELEMENT_TYPES["int64"](), 0)
        )

    def _scalars(self, rows, made):
        """Values of the nodes `made`, inside the fusion."""
        graph = self.graph
        values: dict[int, Any] = {}
        for node in graph.needed(made):
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
        """Constant or input, (1, 1); `None` for a node that is computed."""
        name = self.graph.names[node]
        if name == "constant":
            return _literal(
                self.graph.operands[node][0], (1, 1), self.graph.dtypes[node]
            )
        if name == "input":
            k, j = self._place_of(node)
            return hlo.slice(rows[k], _dims(0, j), _dims(1, j + 1), _dims(1, 1))
        return None


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
    kernel, function = _function(ctx, program, levels, tuple(shapes))
    gathered = kernel.gather(operands)
    results = _call(function, gathered, {"xla_cpu_small_call": "true"})
    return _split(results, program, levels)


def _function(ctx, program, levels, shapes):
    """The kernel and its function in this module, made once."""
    cache = ctx.module_context.cached_primitive_lowerings
    key = ("elastax_kernel", program, levels, shapes)
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

    kernel = _Kernel(program, levels, shapes, add_function)
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
