"""What of a program stands in front of a loop, and what inside.

A batch is a nest of loops, one around another for every batch axis. A value that does
not change within a loop is computed in front of it and handed in, where that saves more
than it costs: LLVM does not move thousands of operations.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ._graph import Graph


_WORTH = 500  # operations that are worth a stage of their own
_PER_VALUE = 4  # operations per value that is handed in


class Stages(NamedTuple):
    """Where each operation stands.

    Attributes:
        depth: number of loops around each needed node; constants and inputs included,
            at the depth at which they change.
        handed: for every depth but the last the nodes that are handed to the loops
            inside.
    """

    depth: dict[int, int]
    handed: list[list[int]]


def depends(
    graph: Graph, nodes: Sequence[int], changes: Callable[[int], bool]
) -> set[int]:
    """Operations on which the nodes depend and that depend on a changing input."""
    found: set[int] = set()
    for node in graph.needed(nodes):
        name = graph.names[node]
        if name == "input":
            if changes(node):
                found.add(node)
        elif name != "constant" and any(i in found for i in graph.operands[node]):
            found.add(node)
    return {node for node in found if graph.names[node] != "input"}


def stages(
    graph: Graph,
    results: Sequence[int],
    input_depth: Callable[[int], int],
    deepest: int,
) -> Stages:
    """Depths of all operations in a nest of loops.

    Args:
        graph: the program.
        results: its results, wanted in the innermost loop.
        input_depth: number of loops outside of which an input does not change.
        deepest: number of loops.
    """
    needed = graph.needed(results)
    depth: dict[int, int] = {}
    for node in needed:
        match graph.names[node]:
            case "constant":
                depth[node] = 0
            case "input":
                depth[node] = input_depth(node)
            case _:
                depth[node] = max((depth[i] for i in graph.operands[node]), default=0)
    operations = [n for n in needed if graph.names[n] not in ("constant", "input")]
    users: dict[int, list[int]] = {node: [] for node in operations}
    for node in operations:
        for i in graph.operands[node]:
            if i in users:
                users[i].append(node)
    wanted = set(results)
    numbers = {graph.dtypes[node] for node in results}
    handed = []
    for d in range(deepest):
        # rows hold floating-point numbers only: the rest is computed where it is read
        for n in reversed(operations):
            if graph.dtypes[n] not in numbers and any(depth[u] > d for u in users[n]):
                depth[n] = max(depth[n], d + 1)
        here = [n for n in operations if depth[n] == d]
        cut = [n for n in here if n in wanted or any(depth[u] > d for u in users[n])]
        if len(here) < max(_WORTH, _PER_VALUE * len(cut)):
            depth |= dict.fromkeys(here, d + 1)
            cut = []
        handed.append(cut)
    return Stages(depth, handed)
