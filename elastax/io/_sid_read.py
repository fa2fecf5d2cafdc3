"""SID_FEM files of flexible bodies: reading."""

import pathlib

import numpy as np

from ._sid_dialect import SidDialect
from ._sid_file import SidFile, SidNode
from ._sid_layout import INDEX_ORDERS, ROW_MODE_COLUMN
from ._sid_records import RawSid, parse_records, refusal
from ._sid_taylor import (
    SYMMETRIC_BLOCKS,
    IndexFinding,
    SidBlock,
    fill_block,
    find_index_order,
)


def load_sid(path: str | pathlib.Path, *, dialect: SidDialect | None = None) -> SidFile:
    """Content of a SID_FEM file, with a report of its layouts and identities.

    Generators differ in the columns of `Gr` and `Ge`, the order of indices, names and
    the storage of symmetric matrices. Which is which is told by identities among the
    blocks, reported and kept: nothing is scaled or mended.

    Args:
        path: of the file.
        dialect: whose layouts are taken where the data cannot tell.

    Returns:
        The content; `report` says what was found, `modal_body()` is the body.

    Raises:
        ValueError: the file is broken or contradicts itself; names line and block.
    """
    text = pathlib.Path(path).read_text(encoding="utf-8", errors="replace")
    raw = parse_records(text, str(path))
    indices = find_index_order(raw)
    if indices.decided:
        return _assemble(raw, indices, dialect)
    return _by_identities(raw, dialect)


def _by_identities(raw: RawSid, dialect: SidDialect | None) -> SidFile:
    """The file with the order of indices that the identities hold for."""
    make = lambda order, verdict, decided=True: _assemble(
        raw, IndexFinding(order, verdict, decided), dialect
    )
    files = {order: make(order, "by the identities") for order in INDEX_ORDERS}
    residuals = {order: file.report.largest_residual for order, file in files.items()}
    best, other = sorted(INDEX_ORDERS, key=lambda order: residuals[order])
    if residuals[best] < 1e-3 and residuals[other] > 100 * residuals[best]:
        return files[best]
    if dialect is not None:
        return make(dialect.indices, f"undecidable, as in {dialect.name}")
    return make(ROW_MODE_COLUMN, "undecidable, assumed", False)


def _assemble(
    raw: RawSid, indices: IndexFinding, dialect: SidDialect | None
) -> SidFile:
    modes = raw.modes
    if raw.counts[1] != modes:
        raise refusal(
            raw.path,
            1,
            "the header",
            f"counts {raw.counts[1]} modes, but `nelastq` is {modes}",
        )
    at_nodes: dict[str, tuple[int | None, int]] = {
        "origin": (3, 1),
        "phi": (3, modes),
        "psi": (3, modes),
        "AP": (3, 3),
        "sigma": (None, modes),
    }
    of_body = {
        "mdCM": (3, 1),
        "J": (6, 1),
        "Ct": (modes, 3),
        "Cr": (modes, 3),
        "Me": (modes, modes),
        "Gr": (3, 3 * modes),
        "Ge": (modes, 3 * modes),
        "Oe": (modes, 6),
        "ksigma": (modes, 1),
        "Ke": (modes, modes),
        "De": (modes, modes),
    }
    nodes = tuple(
        SidNode(
            node.label,
            node.reference,
            {
                name: fill_block(raw.path, block, indices.order, modes, at_nodes[name])
                for name, block in node.blocks.items()
            },
        )
        for node in raw.nodes
    )
    blocks = {
        name: fill_block(
            raw.path,
            raw.blocks[name],
            indices.order,
            modes,
            shape,
            symmetric=name in SYMMETRIC_BLOCKS,
        )
        for name, shape in of_body.items()
    }
    _check_positive(raw, blocks)
    return SidFile(
        raw.path,
        raw.comment,
        raw.name,
        raw.mass,
        raw.mode_labels,
        nodes,
        blocks,
        (raw.blocks["mdCM"].name, raw.blocks["J"].name),
        raw.counts,
        indices,
        dialect,
    )


def _check_positive(raw: RawSid, blocks: dict[str, SidBlock]) -> None:
    """`Me` positive, `Ke` not negative."""
    for name in ("Me", "Ke"):
        smallest = np.linalg.eigvalsh(blocks[name].m0)[0]
        limit = 0.0 if name == "Me" else -1e-9 * np.abs(blocks[name].m0).max()
        if smallest < limit or (name == "Me" and smallest == 0):
            word = "be positive definite" if name == "Me" else "not be negative"
            block = raw.blocks[name]
            raise refusal(
                raw.path,
                block.line,
                block.where,
                f"the matrix must {word}, but has the eigenvalue {smallest:.3g}",
            )
