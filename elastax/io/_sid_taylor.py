"""Taylor series of SID_FEM files as arrays."""

import dataclasses

import numpy as np

from ._sid_layout import INDEX_ORDERS, AbstractIndexOrder
from ._sid_records import RawBlock, RawSid, Record, refusal


ZERO, DIAGONAL, SYMMETRIC, GENERAL, UNIT = range(5)
# matrices that are symmetric whatever their structure
SYMMETRIC_BLOCKS = ("Me", "Ke", "De")
# asymmetry that the printed digits and the generator's rounding explain
_ASYMMETRY = 1e-9


@dataclasses.dataclass(frozen=True, eq=False)
class SidBlock:
    r"""$M(\eta) = M_0 + \sum_q M_{1,q}\,\eta_q + \dots$ of one block.

    Attributes:
        order: as declared: 0, 1 or 2.
        m0: $M_0$, shape (rows, columns).
        m1: $M_1$, shape (rows, modes, columns); zero in blocks of order 0.
        mn: numbers of the second order, shape (rows, nqn, columns). No generator is
            known to write them: they are kept, and nothing is made of them.
        structure: as declared, from 0 to 4.
        storage: which elements of a symmetric matrix were written; empty for others.
    """

    order: int
    m0: np.ndarray
    m1: np.ndarray
    mn: np.ndarray
    structure: int = GENERAL
    storage: str = ""

    def times(self, factor: float) -> "SidBlock":
        """The block in other units."""
        return dataclasses.replace(
            self, m0=self.m0 * factor, m1=self.m1 * factor, mn=self.mn * factor
        )


def taylor_block(order: int, m0: np.ndarray, m1: np.ndarray | None, modes: int):
    """Block of a constant and, if its order is 1, a slope."""
    rows, columns = m0.shape
    slope = np.zeros((rows, modes, columns)) if m1 is None else m1
    return SidBlock(order, m0, slope, np.zeros((rows, 0, columns)))


@dataclasses.dataclass(frozen=True)
class IndexFinding:
    """Order of the indices of `m1` that fits a file.

    Attributes:
        order: that the arrays were filled with.
        verdict: how it was found.
        decided: whether the file left no choice that matters.
    """

    order: AbstractIndexOrder
    verdict: str
    decided: bool


def find_index_order(raw: RawSid) -> IndexFinding:
    """Order of the indices of `m1` with the fewest indices out of range.

    `origin.m1` has one column, so that any mode but the first tells the orders apart.
    """
    blocks = [*raw.blocks.values()]
    for node in raw.nodes:
        blocks += node.blocks.values()
    slopes = [(b, r) for b in blocks for r in b.records if r.kind == "m1"]
    misses = {
        order: sum(not _inside(order.arrange(r.indices), b) for b, r in slopes)
        for order in INDEX_ORDERS
    }
    first, second = INDEX_ORDERS
    if misses[first] != misses[second]:
        order = min(INDEX_ORDERS, key=lambda o: misses[o])
        return IndexFinding(order, "by the ranges of the indices", True)
    if all(first.arrange(r.indices) == second.arrange(r.indices) for _, r in slopes):
        return IndexFinding(first, "orders equivalent", True)
    return IndexFinding(first, "undecidable by the ranges of the indices", False)


def _inside(place: tuple[int, ...], block: RawBlock) -> bool:
    sizes = block.sizes
    return all(
        1 <= k <= size
        for k, size in zip(place, (sizes["nrow"], sizes["nq"], sizes["ncol"]))
    )


def fill_block(
    path: str,
    raw: RawBlock,
    order: AbstractIndexOrder,
    modes: int,
    shape: tuple[int | None, int],
    symmetric: bool = False,
) -> SidBlock:
    """Arrays of a block.

    Args:
        path: for messages.
        raw: its records.
        order: of the indices of `m1`.
        modes: of the body.
        shape: rows and columns it must have; `None` for any number.
        symmetric: whether its matrix must be symmetric.

    Raises:
        ValueError: sizes, indices or structure do not agree.
    """
    fail = lambda line, message: refusal(path, line, raw.where, message)
    sizes, lines = raw.sizes, raw.lines
    for key, wanted in (("nrow", shape[0]), ("ncol", shape[1]), ("nq", modes)):
        if wanted is not None and sizes[key] != wanted:
            because = " as `nelastq`" if key == "nq" else ""
            raise fail(
                lines[key], f"`{key}` must be {wanted}{because}, but is {sizes[key]}"
            )
    if not 1 <= sizes["nrow"] <= 100:
        if shape[0] is None:
            raise fail(
                lines["nrow"], f"`nrow` must be from 1 to 100, not {sizes['nrow']}"
            )
    for key, largest in (("order", 2), ("structure", 4)):
        if sizes[key] > largest:
            raise fail(
                lines[key], f"`{key}` must be from 0 to {largest}, but is {sizes[key]}"
            )
    structure = sizes["structure"]
    rows, columns = sizes["nrow"], sizes["ncol"]
    if structure in (DIAGONAL, SYMMETRIC, UNIT) and rows != columns:
        raise fail(
            lines["structure"],
            f"structure {structure} needs a square matrix, not {rows} x {columns}",
        )
    if sizes["nqn"] > max(100, modes * modes):
        raise fail(
            lines["nqn"],
            f"`nqn` must be at most {max(100, modes * modes)}, not {sizes['nqn']}",
        )
    m0 = np.eye(rows) if structure == UNIT else np.zeros((rows, columns))
    m1 = np.zeros((rows, modes, columns))
    mn = np.zeros((rows, sizes["nqn"] if sizes["order"] == 2 else 0, columns))
    seen: dict[tuple, int] = {}
    for record in raw.records:
        place, target = _place(fail, record, raw, order, (m0, m1, mn))
        key = (record.kind, *place)
        if key in seen:
            raise fail(
                record.line, f"`{_show(record)}` is there already, in line {seen[key]}"
            )
        seen[key] = record.line
        target[place] = record.value
    storage = ""
    if symmetric or structure == SYMMETRIC:
        m0, storage = _symmetric(fail, raw, m0, seen)
    return SidBlock(sizes["order"], m0, m1, mn, structure, storage)


def _show(record: Record) -> str:
    return f"{record.kind}({', '.join(map(str, record.indices))})"


def _place(fail, record: Record, raw: RawBlock, order, arrays):
    """Index of a record, from zero, and its array."""
    needed = {"m0": 0, "m1": 1, "mn": 2}[record.kind]
    if raw.sizes["order"] < needed:
        raise fail(
            record.line,
            f"`{_show(record)}` needs `order = {needed}`, but it is "
            f"{raw.sizes['order']}",
        )
    structure = raw.sizes["structure"]
    # FEMBS writes the ones of a unit matrix out
    one = record.kind == "m0" and len(set(record.indices)) == 1 and record.value == 1
    if structure == ZERO or (structure == UNIT and not one):
        kind = "zero" if structure == ZERO else "unit"
        raise fail(
            record.line,
            f"structure {structure} is a {kind} matrix, but there is "
            f"`{_show(record)} = {record.value:g}`: take structure 3",
        )
    target = arrays[needed]
    indices = record.indices if needed == 0 else order.arrange(record.indices)
    place = tuple(k - 1 for k in indices)
    if not all(0 <= k < size for k, size in zip(place, target.shape)):
        names = ("row", "column") if needed == 0 else ("row", "mode", "column")
        raise fail(
            record.line,
            f"an index of `{_show(record)}` is out of range: "
            + ", ".join(f"{n} 1 to {size}" for n, size in zip(names, target.shape)),
        )
    if structure == DIAGONAL and place[0] != place[-1]:
        raise fail(
            record.line,
            f"structure 1 is a diagonal matrix, but `{_show(record)}` is beside the "
            "diagonal: take structure 3",
        )
    return place, target


def _symmetric(fail, raw: RawBlock, m0: np.ndarray, seen: dict[tuple, int]):
    """The matrix with both triangles, and which were written."""
    constant = [key[1:] for key in seen if key[0] == "m0"]
    lower = any(i > j for i, j in constant)
    upper = any(i < j for i, j in constant)
    if raw.sizes["structure"] == SYMMETRIC and lower != upper:
        other = np.tril(m0, -1) if lower else np.triu(m0, 1)
        name = "lower triangle" if lower else "upper triangle"
        return m0 + other.T, name
    size = np.abs(m0).max(initial=0.0)
    difference = np.abs(m0 - m0.T)
    if difference.max(initial=0.0) > _ASYMMETRY * size:
        i, j = np.unravel_index(np.argmax(difference), m0.shape)
        line = seen.get(("m0", i, j), seen.get(("m0", j, i), raw.line))
        raise fail(
            line,
            f"the matrix must be symmetric, but m0({i + 1}, {j + 1}) = {m0[i, j]:.12g} "
            f"and m0({j + 1}, {i + 1}) = {m0[j, i]:.12g}",
        )
    if not (lower or upper):
        return m0, "diagonal"
    return m0, "both triangles"
