"""SID_FEM files of flexible bodies: writing."""

import dataclasses
import pathlib
import re
from collections.abc import Iterator

import numpy as np

from ..structure import ModalBody
from ._sid_dialect import FEMBS, SidDialect
from ._sid_file import SidFile, SidNode
from ._sid_taylor import (
    DIAGONAL,
    SYMMETRIC,
    SYMMETRIC_BLOCKS,
    UNIT,
    ZERO,
    IndexFinding,
    SidBlock,
    taylor_block,
)
from ._sid_tensors import elements, skew


# columns at which the files align "=", and the depths of their blocks
_EQUAL = 48
_BODY, _NODE = 11, 21


def save_sid(
    path: str | pathlib.Path,
    content: ModalBody | SidFile,
    *,
    dialect: SidDialect = FEMBS,
    comment: str | None = None,
) -> None:
    """Write a SID_FEM file of twelve digits.

    A body's nodes keep their names if all of these are whole numbers, as the format
    asks for; else they are numbered from one. `Ge` of a body is `Cr.m1 - Cr.m1^T`, of
    a file what it was.

    Args:
        path: of the file.
        content: a body, or the content of another file.
        dialect: names and layouts that are written.
        comment: text of the first line; the file's own, or the names of dialect and
            body, unless given.

    Raises:
        ValueError: a layout of the content cannot be told.
    """
    file = content if isinstance(content, SidFile) else sid_from_body(content)
    if comment is not None:
        file = dataclasses.replace(file, comment=comment)
    lines = list(_lines(file, dialect))
    text = "\n".join(lines) + "\n"
    pathlib.Path(path).write_text(text, encoding="utf-8")


def sid_from_body(body: ModalBody) -> SidFile:
    """Content of a SID_FEM file for a body, in the layouts of FEMBS."""
    modes = body.modes
    array = lambda x: np.asarray(x, dtype=float)
    constant = lambda x: taylor_block(0, array(x), None, modes)

    def series(m0, m1, order=1):
        return taylor_block(order, array(m0), array(m1), modes)

    names = body.nodes.names
    if not all(re.fullmatch(r"\d+", name) for name in names):
        names = tuple(str(k) for k in range(1, len(names) + 1))
    nodes = []
    for k, name in enumerate(names):
        phi, psi = array(body.nodes.phi[k]), array(body.nodes.psi[k])
        curved = np.swapaxes(array(body.nodes.phi_1[k]), 1, 2)
        nodes.append(
            SidNode(
                name,
                "body ref",
                {
                    "origin": series(body.nodes.position[k][:, None], phi[:, :, None]),
                    "phi": series(phi, curved, int(curved.any())),
                    "psi": constant(psi),
                    "AP": series(np.eye(3), np.swapaxes(skew(psi.T), 0, 1)),
                },
            )
        )
    C_t0, C_t1 = array(body.C_t0), array(body.C_t1)
    J_1 = elements(array(body.J_1)).T
    rotation = np.swapaxes(array(body.G_r), 0, 1)  # (3, modes, 3)
    blocks = {
        "mdCM": series(body.first_moment[:, None], C_t0.T[:, :, None]),
        "J": series(elements(array(body.J_0))[:, None], J_1[:, :, None]),
        "Ct": series(C_t0, C_t1, int(C_t1.any())),
        "Cr": series(body.C_r0, body.C_r1),
        "Me": constant(body.M_e),
        "Gr": constant(FEMBS.G_r.pack(rotation)),
        "Ge": constant(FEMBS.G_e.pack(array(body.G_e))),
        "Oe": series(body.O_e0, body.O_e1),
        "ksigma": constant(np.zeros((modes, 1))),
        "Ke": constant(body.K_e),
        "De": constant(body.D_e),
    }
    return SidFile(
        body.name,
        f"SID written by elastax in the layout of {FEMBS.name}",
        body.name,
        float(body.mass),
        body.mode_names,
        tuple(nodes),
        blocks,
        (FEMBS.first_moment, FEMBS.inertia),
        (len(nodes), modes),
        IndexFinding(FEMBS.indices, "from a body", True),
        FEMBS,
    )


def _lines(file: SidFile, dialect: SidDialect) -> Iterator[str]:
    modes = file.modes
    comment = " ".join(file.comment.splitlines())
    yield f"{len(file.nodes):5d}{modes:4d}    :No. nodes, No. modes:{comment}"
    yield " part"
    yield _assign(6, "new modal", file.name)
    yield " " * 11 + "refmod"
    yield _assign(16, "mass", _real(file.mass, dialect))
    yield _assign(16, "nelastq", f"{modes:5d}")
    for k, label in enumerate(file.mode_labels, 1):
        yield _assign(16, f"ielastq ({k:4d})", label)
    yield " " * 11 + "end refmod"
    yield " " * 11 + "frame"
    for node in file.nodes:
        yield _assign(16, "new node", f"{node.label:>8}")
        yield _assign(21, "rframe", node.reference)
        for name, block in node.blocks.items():
            yield from _block(_NODE, name, name, block, dialect)
        yield " " * 16 + "end node"
    yield " " * 11 + "end frame"
    names = {"mdCM": dialect.first_moment, "J": dialect.inertia}
    for name, block in _laid_out(file, dialect).items():
        yield from _block(_BODY, names.get(name, name), name, block, dialect)
    yield "      end modal"
    yield " end part"


def _laid_out(file: SidFile, dialect: SidDialect) -> dict[str, SidBlock]:
    """Blocks with the columns of the dialect."""
    blocks = dict(file.blocks)
    rotation = dialect.G_r.pack(np.swapaxes(file.G_r, 0, 1))
    blocks["Gr"] = dataclasses.replace(blocks["Gr"], m0=rotation)
    modal = dialect.G_e.pack(file.G_e)
    blocks["Ge"] = dataclasses.replace(blocks["Ge"], m0=modal)
    blocks["Oe"] = dataclasses.replace(blocks["Oe"], m0=file.O_e0, m1=file.O_e1)
    return blocks


def _block(
    depth: int, shown: str, name: str, block: SidBlock, dialect: SidDialect
) -> Iterator[str]:
    rows, columns = block.m0.shape
    constant = not (block.m1.any() or block.mn.any())
    structure = dialect.storage.structure(block.m0, name in SYMMETRIC_BLOCKS, constant)
    yield " " * depth + shown
    sizes = (block.order, rows, columns, block.m1.shape[1], block.mn.shape[1])
    for key, size in zip(("order", "nrow", "ncol", "nq", "nqn"), sizes):
        yield _assign(26, key, f"{size:5d}")
    yield _assign(26, "structure", f"{structure:5d}")
    for i, j in np.argwhere(block.m0.T)[:, ::-1]:
        if structure in (ZERO, UNIT) or (structure == SYMMETRIC and i < j):
            continue
        if structure == DIAGONAL and i != j:
            continue
        value = _real(block.m0[i, j], dialect)
        yield _assign(26, f"m0({i + 1:2d},{j + 1:2d})", value)
    for kind, array in (("m1", block.m1), ("mn", block.mn)):
        for j, i, q in np.argwhere(np.moveaxis(array, 2, 0)):
            place = dialect.indices.arrange((int(i) + 1, int(q) + 1, int(j) + 1))
            indices = ",".join(f"{k:2d}" for k in place)
            value = _real(array[i, q, j], dialect)
            yield _assign(26, f"{kind}({indices})", value)
    yield " " * depth + f"end {shown}"


def _assign(depth: int, key: str, value: str) -> str:
    return f"{' ' * depth + key:<{_EQUAL}}={value}"


def _real(value: float | np.ndarray, dialect: SidDialect) -> str:
    return f"{float(value): .11E}".replace("E", dialect.exponent)
