r"""Layout of SID files: detected from what the data must obey, and reported.

Programs write the same blocks in different layouts, and no file says in which. Columns
of $G_r$ (3 x 3 modes) and $G_e$ (modes x 3 modes) run over the axes first or over the
modes first; elements of first order count row, mode, column or row, column, mode. The
identities of the data tell: $J_1 = \mathrm{sym}(G_r)$, $G_e = 2\,C_{r1}$,
$m c_1 = C_{t0}^T$.
"""

import dataclasses
from typing import NoReturn

import numpy as np

from ._sid_checks import gyroscopic_residual, identities, is_stiffened, notes_on
from ._sid_data import (
    SQUARES,
    TENSOR,
    SidData,
    SidNode,
    squares_of_tensor,
)
from ._sid_text import SidText, TaylorText


# of data printed with 12 digits; another layout misses by the size of the data
_HOLDS = 1e-9

AXIS_MAJOR = "axis-major"
MODE_MAJOR = "mode-major"
EQUIVALENT = "layouts equivalent"
UNDECIDED = "undecided"
ROW_MODE_COLUMN = "row, mode, column"
ROW_COLUMN_MODE = "row, column, mode"


@dataclasses.dataclass(frozen=True)
class SidReport:
    """What a file's layout is and how well its data agree with each other.

    Attributes:
        path: of the file.
        generator: what the first line says.
        Gr_layout, Ge_layout: of the columns.
        first_order: order of the indices of elements of first order.
        Oe_columns: products of the speeds, in order.
        block_names: of first moment and inertia in the file.
        storage: how symmetric matrices are stored, by block.
        stiffening: whether the data contain geometric stiffening.
        identities: for every identity its residual over the largest element of its
            block; `None` where both sides are zero.
        notes: what is unusual: asymmetries, suspected units, unphysical damping.
    """

    path: str
    generator: str
    Gr_layout: str
    Ge_layout: str
    first_order: str
    Oe_columns: str
    block_names: tuple[str, str]
    storage: dict[str, str]
    stiffening: bool
    identities: dict[str, float | None]
    notes: tuple[str, ...]

    def table(self) -> str:
        """All of it as lines of text."""
        rows = [
            ("file", self.path),
            ("generator", self.generator[:70]),
            ("columns of Gr", self.Gr_layout),
            ("columns of Ge", self.Ge_layout),
            ("elements of first order", self.first_order),
            ("columns of Oe", self.Oe_columns),
            ("first moment, inertia", ", ".join(self.block_names)),
            ("geometric stiffening", "yes" if self.stiffening else "no"),
        ]
        rows += [(f"storage of {name}", how) for name, how in self.storage.items()]
        rows += [
            (name, "both zero" if value is None else f"{value:.1e}")
            for name, value in self.identities.items()
        ]
        rows += [("note", note) for note in self.notes]
        width = max(len(left) for left, _ in rows)
        return "\n".join(f"{left:<{width}}  {right}" for left, right in rows)


STRUCTURES = ("zero", "diagonal", "symmetric", "general", "unit")
ALIASES = {"mdCM": ("mdCM", "mCM"), "J": ("J", "mmi")}
REQUIRED = ("mdCM", "J", "Ct", "Cr", "Me", "Gr", "Ge", "Oe", "ksigma", "Ke", "De")


def normalised(text: SidText) -> tuple[SidData, SidReport]:
    """Data of a file in one layout, and the report on the one that it has.

    Raises:
        ValueError: a block is missing, has a wrong size, contradicts its structure or
            is not what a body can have; the message names block and line.
    """
    n = text.modes
    names = {}
    blocks: dict[str, TaylorText] = {}
    for key in REQUIRED:
        found = [name for name in ALIASES.get(key, (key,)) if name in text.blocks]
        if not found:
            raise ValueError(f"{text.path}: the block `{key}` is missing")
        names[key], blocks[key] = found[0], text.blocks[found[0]]
    shapes = {
        "mdCM": (3, 1),
        "J": (6, 1),
        "Ct": (n, 3),
        "Cr": (n, 3),
        "Me": (n, n),
        "Gr": (3, 3 * n),
        "Ge": (n, 3 * n),
        "Oe": (n, 6),
        "ksigma": (n, 1),
        "Ke": (n, n),
        "De": (n, n),
    }
    for key, shape in shapes.items():
        _check_shape(text, blocks[key], shape)
    for node in text.frame:
        for name, shape in (("origin", (3, 1)), ("phi", (3, n)), ("psi", (3, n))):
            _check_shape(text, node.blocks[name], shape)
    order = _index_order(text, blocks)
    first = lambda block: _first(text, block, order)
    zeroth = {key: _zeroth(text, block) for key, block in blocks.items()}
    J_0 = _tensor(zeroth["J"][:, 0])
    J_1 = _tensor(np.moveaxis(first(blocks["J"])[:, :, 0], 0, -1))
    mdCM_1 = first(blocks["mdCM"])[:, :, 0].T
    couplings = {key: np.moveaxis(first(blocks[key]), 2, -1) for key in ("Ct", "Cr")}
    Gr, Gr_layout = _choose(
        {
            AXIS_MAJOR: zeroth["Gr"].reshape(3, 3, n).transpose(2, 0, 1),
            MODE_MAJOR: zeroth["Gr"].reshape(3, n, 3).transpose(1, 0, 2),
        },
        lambda Gr: 0.5 * (Gr + np.swapaxes(Gr, 1, 2)) - J_1,
        n,
        J_1,
    )
    Ge, Ge_layout = _choose(
        {
            AXIS_MAJOR: zeroth["Ge"].reshape(n, 3, n).transpose(0, 2, 1),
            MODE_MAJOR: zeroth["Ge"].reshape(n, n, 3),
        },
        lambda Ge: gyroscopic_residual(Ge, couplings["Cr"]),
        n,
        couplings["Cr"],
    )
    Oe_0, Oe_1, columns = _centrifugal(
        zeroth["Oe"], np.moveaxis(first(blocks["Oe"]), 2, -1), J_1
    )
    nodes = tuple(_node(text, node, order) for node in text.frame)
    data = SidData(
        text.name,
        text.header,
        _labels(text.labels),
        text.mass,
        zeroth["mdCM"][:, 0],
        mdCM_1,
        np.moveaxis(_second(text, blocks["mdCM"])[..., 0], 0, -1),
        J_0,
        J_1,
        _tensor(np.moveaxis(_second(text, blocks["J"])[..., 0], 0, -1)),
        zeroth["Ct"],
        couplings["Ct"],
        zeroth["Cr"],
        couplings["Cr"],
        zeroth["Me"],
        Gr,
        Ge,
        Oe_0,
        Oe_1,
        zeroth["ksigma"][:, 0],
        zeroth["Ke"],
        zeroth["De"],
        nodes,
    )
    _check_physics(text, blocks, data)
    report = SidReport(
        text.path,
        text.header,
        Gr_layout,
        Ge_layout,
        order,
        columns,
        (names["mdCM"], names["J"]),
        {
            key: STRUCTURES[blocks[key].fields["structure"]]
            for key in ("Me", "Ke", "De")
        },
        is_stiffened(data),
        identities(data),
        tuple(notes_on(data)),
    )
    return data, report


def _fail(text: SidText, block: TaylorText, message: str) -> NoReturn:
    raise ValueError(f"{text.path}, line {block.line}, block `{block.name}`: {message}")


def _check_shape(text: SidText, block: TaylorText, shape: tuple[int, int]) -> None:
    if block.shape != shape:
        _fail(text, block, f"must be {shape[0]} x {shape[1]}, but is {block.shape}")


def _zeroth(text: SidText, block: TaylorText) -> np.ndarray:
    rows, columns = block.shape
    kind = STRUCTURES[block.fields["structure"]]
    matrix = np.zeros((rows, columns))
    if kind in ("zero", "unit"):
        known = np.eye(rows, columns) if kind == "unit" else matrix
        for (i, j), value, line in block.records["m0"]:
            inside = 1 <= i <= rows and 1 <= j <= columns
            if not inside or known[i - 1, j - 1] != value:
                raise ValueError(
                    f"{text.path}, line {line}, block `{block.name}`: a {kind} matrix "
                    f"has no element ({i}, {j}) of {value:g}"
                )
        return known
    given = set()
    for (i, j), value, line in block.records["m0"]:
        if not (1 <= i <= rows and 1 <= j <= columns):
            raise ValueError(
                f"{text.path}, line {line}, block `{block.name}`: the element "
                f"({i}, {j}) lies outside of {rows} x {columns}"
            )
        if kind == "diagonal" and i != j:
            raise ValueError(
                f"{text.path}, line {line}, block `{block.name}`: a diagonal matrix "
                f"has no element ({i}, {j})"
            )
        matrix[i - 1, j - 1] = value
        given.add((i, j))
    if kind == "symmetric":
        for i, j in given:
            if (j, i) not in given:
                matrix[j - 1, i - 1] = matrix[i - 1, j - 1]
    return matrix


def _first(text: SidText, block: TaylorText, order: str) -> np.ndarray:
    """Elements of first order, shape (rows, modes, columns)."""
    rows, columns = block.shape
    modes = block.fields["nq"]
    array = np.zeros((rows, modes, columns))
    for (i, second, third), value, line in block.records["m1"]:
        k, j = (second, third) if order != ROW_COLUMN_MODE else (third, second)
        if not (1 <= i <= rows and 1 <= k <= modes and 1 <= j <= columns):
            raise ValueError(
                f"{text.path}, line {line}, block `{block.name}`: the element of first "
                f"order ({i}, {second}, {third}) lies outside, as {order}"
            )
        array[i - 1, k - 1, j - 1] = value
    return array


def _second(text: SidText, block: TaylorText) -> np.ndarray:
    """Elements of second order, shape (rows, modes, modes, columns)."""
    rows, columns = block.shape
    modes = block.fields["nq"]
    array = np.zeros((rows, modes, modes, columns))
    for (i, k, m, j), value, line in block.records["mn"]:
        inside = 1 <= i <= rows and 1 <= j <= columns
        if not (inside and 1 <= k <= modes and 1 <= m <= modes):
            raise ValueError(
                f"{text.path}, line {line}, block `{block.name}`: the element of "
                f"second order ({i}, {k}, {m}, {j}) lies outside"
            )
        array[i - 1, k - 1, m - 1, j - 1] = value
    return array


def _index_order(text: SidText, blocks: dict[str, TaylorText]) -> str:
    """Order of the indices of elements of first order."""
    if text.modes == 1:
        return EQUIVALENT
    seen = set()
    all_blocks = [*blocks.values(), *(b for n in text.frame for b in n.blocks.values())]
    for block in all_blocks:
        columns, modes = block.fields["ncol"], block.fields["nq"]
        for (_, second, third), _, _ in block.records["m1"]:
            if second > columns or third > modes:
                seen.add(ROW_MODE_COLUMN)
            if third > columns or second > modes:
                seen.add(ROW_COLUMN_MODE)
    if len(seen) == 2:
        raise ValueError(
            f"{text.path}: elements of first order count row, mode, column in some "
            "blocks and row, column, mode in others"
        )
    return seen.pop() if seen else UNDECIDED


def _choose(candidates: dict[str, np.ndarray], residual, modes: int, reference):
    """The layout that satisfies its identity, and its name."""
    if modes == 1:
        return candidates[AXIS_MAJOR], EQUIVALENT
    size = max(np.abs(candidates[AXIS_MAJOR]).max(), np.abs(reference).max())
    if size == 0 or not np.any(reference):
        return candidates[AXIS_MAJOR], UNDECIDED
    errors = {
        name: np.abs(residual(array)).max() / size for name, array in candidates.items()
    }
    holding = [name for name, error in errors.items() if error < _HOLDS]
    if len(holding) == 2:
        return candidates[AXIS_MAJOR], EQUIVALENT
    best = min(errors, key=lambda name: errors[name])
    if not holding:
        return candidates[
            best
        ], f"{best}, but its identity misses by {errors[best]:.1e}"
    return candidates[best], best


def _centrifugal(Oe_0, Oe_1, J_1):
    """Elements of Oe for the products in the order of (3.72b)."""
    standard = "x^2 y^2 z^2, x y, y z, x z"
    expected = -0.5 * squares_of_tensor(J_1)
    other = -0.5 * squares_of_tensor(J_1, TENSOR)
    size = max(np.abs(expected).max(initial=0.0), 1e-300)
    fits = lambda x: np.abs(Oe_0 - x).max(initial=0.0) < _HOLDS * size
    if fits(other) and not fits(expected):
        swap = [TENSOR.index(pair) for pair in SQUARES]
        return Oe_0[:, swap], Oe_1[:, :, swap], "x^2 y^2 z^2, x y, x z, y z"
    return Oe_0, Oe_1, standard


def _node(text: SidText, node, order: str) -> SidNode:
    blocks = node.blocks
    modes = text.modes
    rotation = np.zeros((3, modes, 3))
    if "AP" in blocks:
        _check_shape(text, blocks["AP"], (3, 3))
        if np.abs(_zeroth(text, blocks["AP"]) - np.eye(3)).max() > 1e-9:
            _fail(text, blocks["AP"], "nodes whose frames are turned are not supported")
        rotation = _first(text, blocks["AP"], order)
    return SidNode(
        node.label,
        _zeroth(text, blocks["origin"])[:, 0],
        _zeroth(text, blocks["phi"]),
        _zeroth(text, blocks["psi"]),
        np.swapaxes(_first(text, blocks["phi"], order), 1, 2),
        _first(text, blocks["origin"], order)[:, :, 0],
        rotation,
    )


def _tensor(elements: np.ndarray) -> np.ndarray:
    """Symmetric tensors from xx, yy, zz, xy, xz, yz, shape (..., 6)."""
    tensor = np.zeros((*elements.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(TENSOR):
        tensor[..., i, j] = tensor[..., j, i] = elements[..., k]
    return tensor


def _labels(labels: list[str]) -> tuple[str, ...]:
    return tuple(label or f"mode {k + 1}" for k, label in enumerate(labels))


def _check_physics(text: SidText, blocks, data: SidData) -> None:
    if not data.mass > 0:
        raise ValueError(f"{text.path}: the mass must be positive, but is {data.mass}")
    for key, definite in (("Me", True), ("Ke", False), ("De", False)):
        matrix = getattr(data, key)
        size = np.abs(matrix).max(initial=0.0)
        if np.abs(matrix - matrix.T).max(initial=0.0) > 1e-6 * size:
            _fail(text, blocks[key], "must be symmetric, but is not")
        if not matrix.size:
            continue
        smallest = np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0]
        if (definite and not smallest > 0) or smallest < -1e-9 * size:
            kind = "positive" if definite else "no negative"
            _fail(
                text,
                blocks[key],
                f"must have {kind} eigenvalues, but the smallest is {smallest:.3g}",
            )
