"""Operands of kernels of which XLA finds out late that they are constant."""

from typing import Any

from jaxlib.mlir import ir


_PLAIN = {"stablehlo.constant", "stablehlo.broadcast_in_dim", "stablehlo.reshape"}


def folds_late(operand: Any) -> bool:
    """Whether XLA may find out that an operand is constant after it was handed over.

    It is computed, and from constants only, or from arguments of a function that XLA
    inlines. XLA then draws it into the kernel and leaves a parameter behind that
    nothing reads, for which it aborts the process.
    """
    waiting, seen = [operand], set()
    while waiting:
        value = waiting.pop()
        owner = value.owner
        if 0 in getattr(value.type, "shape", ()):
            continue  # nothing but a constant comes of an empty array
        if isinstance(owner, ir.Block):
            around = owner.owner
            # arguments of the program, and what loops carry, are no constants
            if around.operation.name != "func.func" or _is_main(around):
                return False
            seen.add(around)
        elif owner.name == "stablehlo.optimization_barrier":
            waiting.append(owner.operands[ir.OpResult(value).result_number])
        elif owner not in seen:
            seen.add(owner)
            waiting.extend(owner.operands)
    return any(operation.name not in _PLAIN for operation in seen)


def _is_main(function: Any) -> bool:
    return "public" in str(function.attributes.get("sym_visibility", ""))
