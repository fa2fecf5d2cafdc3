"""Graph of scalar operations with folding of constants and sharing of values."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np


class NotScalarError(Exception):
    """The function uses something that has no scalar form here."""


TYPES = frozenset(("float64", "float32", "bool", "int32", "int64", "uint32"))

_MOST_NODES = 200_000  # compiling takes 20 s for half of it


def _fold_numpy(function: Callable) -> Callable:
    def fold(*values):
        with np.errstate(all="ignore"):
            return function(*values)

    return fold


_FOLDS: dict[str, Callable] = {
    name: _fold_numpy(function)
    for name, function in {
        "add": np.add,
        "sub": np.subtract,
        "mul": np.multiply,
        "neg": np.negative,
        "div": lambda a, b: np.divide(a, b).astype(a.dtype),
        "rem": np.fmod,
        "max": np.maximum,
        "min": np.minimum,
        "pow": np.power,
        "atan2": np.arctan2,
        "sin": np.sin,
        "cos": np.cos,
        "tan": np.tan,
        "exp": np.exp,
        "expm1": np.expm1,
        "log": np.log,
        "log1p": np.log1p,
        "sqrt": np.sqrt,
        "rsqrt": lambda a: 1 / np.sqrt(a),
        "tanh": np.tanh,
        "abs": np.abs,
        "sign": np.sign,
        "floor": np.floor,
        "ceil": np.ceil,
        "is_finite": np.isfinite,
        "lt": np.less,
        "le": np.less_equal,
        "gt": np.greater,
        "ge": np.greater_equal,
        "eq": np.equal,
        "ne": np.not_equal,
        "and": np.bitwise_and,
        "or": np.bitwise_or,
        "xor": np.bitwise_xor,
        "not": np.invert,
    }.items()
}


class Graph:
    """Scalar operations in an order in which operands come first.

    A node is an index. `names[i]` is the operation, `operands[i]` its nodes (for
    `constant` its value, for `input` its position), `dtypes[i]` the name of its type.
    Folding drops products with a structural zero, as sparse matrices do: NaN or
    infinity times a zero that is known while tracing gives zero.
    """

    def __init__(self):
        self.names: list[str] = []
        self.operands: list[tuple] = []
        self.dtypes: list[str] = []
        self.values: dict[int, Any] = {}
        self._known: dict[tuple, int] = {}
        self._special: dict[str, Callable] = {
            "add": self._add,
            "sub": self._sub,
            "neg": self._neg,
            "mul": self._mul,
            "div": self._div,
            "select": self._select,
            "convert": self._convert,
        }

    def _node(self, name: str, operands: tuple, dtype: str) -> int:
        key = (name, operands, dtype)
        index = self._known.get(key)
        if index is None:
            index = self._append(key, name, operands, dtype)
        return index

    def _append(self, key: tuple, name: str, operands: tuple, dtype: str) -> int:
        if dtype not in TYPES:
            raise NotScalarError(f"numbers of type {dtype}")
        if len(self.names) >= _MOST_NODES:
            raise NotScalarError("too many operations")
        index = self._known[key] = len(self.names)
        self.names.append(name)
        self.operands.append(operands)
        self.dtypes.append(dtype)
        return index

    def constant(self, value: Any, dtype: str) -> int:
        number = np.asarray(value, dtype)[()]
        key = ("constant", number.tobytes(), dtype)
        index = self._known.get(key)
        if index is None:
            index = self._append(key, "constant", (number,), dtype)
            self.values[index] = number
        return index

    def constants(self, array: Any, dtype: str) -> np.ndarray:
        """Nodes of all elements of a constant array."""
        if dtype not in TYPES:
            raise NotScalarError(f"numbers of type {dtype}")
        array = np.asarray(array)
        nodes = [self.constant(v, dtype) for v in array.ravel()]
        return np.array(nodes, np.int64).reshape(array.shape)

    def inputs(self, first: int, shape: Sequence[int], dtype: str) -> np.ndarray:
        """Nodes of an input array whose elements start at position `first`."""
        size = math.prod(shape)
        nodes = [self._node("input", (first + k,), dtype) for k in range(size)]
        return np.array(nodes, np.int64).reshape(tuple(shape))

    def apply(self, name: str, *operands: int, dtype: str) -> int:
        """Node of an operation, after folding."""
        values = self.values
        if all(i in values for i in operands):
            fold = _FOLDS.get(name)
            if fold is not None:
                return self.constant(fold(*(values[i] for i in operands)), dtype)
        special = self._special.get(name)
        if special is not None:
            return special(*operands, dtype)
        return self._node(name, operands, dtype)

    def add(self, a: int, b: int) -> int:
        return self.apply("add", a, b, dtype=self.dtypes[a])

    def multiply(self, a: int, b: int) -> int:
        return self.apply("mul", a, b, dtype=self.dtypes[a])

    def total(self, nodes: Iterable[int], dtype: str) -> int:
        """Sum, from left to right."""
        result = None
        for node in nodes:
            result = node if result is None else self.add(result, node)
        return self.constant(0, dtype) if result is None else result

    def is_constant(self, node: int, value: float) -> bool:
        """Whether a node is this number."""
        return node in self.values and bool(self.values[node] == value)

    def _add(self, a: int, b: int, dtype: str) -> int:
        if self.is_constant(a, 0):
            return b
        if self.is_constant(b, 0):
            return a
        if self.names[b] == "neg":
            return self.apply("sub", a, self.operands[b][0], dtype=dtype)
        if self.names[a] == "neg":
            return self.apply("sub", b, self.operands[a][0], dtype=dtype)
        return self._node("add", (min(a, b), max(a, b)), dtype)

    def _sub(self, a: int, b: int, dtype: str) -> int:
        if self.is_constant(b, 0):
            return a
        if self.is_constant(a, 0):
            return self.apply("neg", b, dtype=dtype)
        if self.names[b] == "neg":
            return self.apply("add", a, self.operands[b][0], dtype=dtype)
        return self._node("sub", (a, b), dtype)

    def _neg(self, a: int, dtype: str) -> int:
        if self.names[a] == "neg":
            return self.operands[a][0]
        if self.names[a] == "sub":
            return self._node("sub", self.operands[a][::-1], dtype)
        return self._node("neg", (a,), dtype)

    def _mul(self, a: int, b: int, dtype: str) -> int:
        if b in self.values:
            a, b = b, a
        if self.is_constant(a, 0):
            return a
        if self.is_constant(a, 1):
            return b
        if self.is_constant(a, -1):
            return self.apply("neg", b, dtype=dtype)
        names = self.names
        if names[a] == "neg" or names[b] == "neg":
            x, y = (a, b) if names[a] == "neg" else (b, a)
            inner = self.apply("mul", self.operands[x][0], y, dtype=dtype)
            return self.apply("neg", inner, dtype=dtype)
        return self._node("mul", (a, b) if a < b else (b, a), dtype)

    def _div(self, a: int, b: int, dtype: str) -> int:
        if self.is_constant(b, 1):
            return a
        return self._node("div", (a, b), dtype)

    def _select(self, which: int, on_true: int, on_false: int, dtype: str) -> int:
        if on_true == on_false:
            return on_true
        if which in self.values:
            return on_true if self.values[which] else on_false
        return self._node("select", (which, on_true, on_false), dtype)

    def _convert(self, a: int, dtype: str) -> int:
        if self.dtypes[a] == dtype:
            return a
        # what does not fit into an integer, NumPy and XLA convert differently
        if a in self.values and (
            dtype not in ("int32", "int64") or abs(self.values[a]) < 2**31
        ):
            return self.constant(self.values[a], dtype)
        return self._node("convert", (a,), dtype)

    def needed(self, nodes: Iterable[int]) -> list[int]:
        """Nodes on which the given ones depend, themselves included, in order."""
        seen: set[int] = set()
        stack = list(nodes)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                if self.names[node] not in ("constant", "input"):
                    stack.extend(self.operands[node])
        return sorted(seen)

    def depth(self, nodes: Iterable[int]) -> int:
        """Operations in the longest chain that leads to one of the nodes."""
        depths: dict[int, int] = {}
        for node in self.needed(nodes):
            known = self.names[node] in ("constant", "input")
            before = () if known else self.operands[node]
            depths[node] = 1 + max((depths[i] for i in before), default=-1)
        return max(depths.values(), default=0)
