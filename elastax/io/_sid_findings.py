"""What SID data show about their own layout, by the identities among their blocks.

Each layout is tried, and the one is taken that an identity holds for. Where the blocks
that could tell are zero, or fit any layout, the finding says so.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from ._sid_layout import COLUMN_LAYOUTS, AbstractColumnLayout
from ._sid_taylor import SidBlock
from ._sid_tensors import (
    INERTIA,
    SQUARES,
    in_squares,
    largest,
    residual,
    tensor,
)


# a layout is taken if it fits this well, and another a hundred times worse
_FITS, _WORSE = 1e-3, 1e2
# layouts that differ by less are one, at the printed digits
_SAME = 1e-11


@dataclasses.dataclass(frozen=True)
class LayoutFinding:
    """Column layout of `Gr` or `Ge`.

    Attributes:
        layout: the one that fits; the first if all do; `None` if none can be told.
        verdict: its name, "layouts equivalent", or why it is undecidable.
        residuals: of the identity, by the layouts' names.
        identity: the one that was used.
    """

    layout: AbstractColumnLayout | None
    verdict: str
    residuals: dict[str, float]
    identity: str


@dataclasses.dataclass(frozen=True)
class SquaresFinding:
    """Order of the columns of `Oe`.

    Attributes:
        order: index pairs of the six products of the speeds.
        verdict: the last three in words.
        decided: whether the file left no choice.
    """

    order: tuple[tuple[int, int], ...]
    verdict: str
    decided: bool


def rotation_terms(matrix: np.ndarray, layout: AbstractColumnLayout) -> np.ndarray:
    """$G_r$ of shape (modes, 3, 3) from the block."""
    return np.swapaxes(layout.unpack(matrix), 0, 1)


def find_rotation_layout(blocks: dict[str, SidBlock]) -> LayoutFinding:
    """Layout of `Gr`, for which its symmetric part is `J.m1`."""
    slopes = inertia_slopes(blocks["J"])
    candidates: dict[AbstractColumnLayout, np.ndarray] = {
        layout: rotation_terms(blocks["Gr"].m0, layout) for layout in COLUMN_LAYOUTS
    }
    halves = {k: 0.5 * (g + np.swapaxes(g, 1, 2)) for k, g in candidates.items()}
    return _choose(
        candidates,
        {k: residual(half, slopes) for k, half in halves.items()},
        "J.m1" if not largest(slopes) else "",
        "J.m1 = sym(Gr)",
    )


def find_modal_layout(blocks: dict[str, SidBlock]) -> LayoutFinding:
    """Layout of `Ge`, which is twice `Cr.m1`.

    The equations of motion ask for the difference of `Cr.m1` and its transpose, which
    is the same unless `Cr.m1` holds geometric stiffening. Both are tried.
    """
    slopes = blocks["Cr"].m1
    candidates: dict[AbstractColumnLayout, np.ndarray] = {
        layout: layout.unpack(blocks["Ge"].m0) for layout in COLUMN_LAYOUTS
    }
    zero = "" if largest(slopes) else "Cr.m1"
    found = []
    for identity, wanted in (
        ("Ge = 2 Cr.m1", 2.0 * slopes),
        ("Ge = Cr.m1 - Cr.m1^T", slopes - np.swapaxes(slopes, 0, 1)),
    ):
        residuals = {k: residual(g, wanted) for k, g in candidates.items()}
        found.append(_choose(candidates, residuals, zero, identity))
    return min(found, key=lambda finding: min(finding.residuals.values()))


def _choose(
    candidates: dict[AbstractColumnLayout, np.ndarray],
    residuals: dict[AbstractColumnLayout, float],
    zero: str,
    identity: str,
) -> LayoutFinding:
    first, second = candidates
    named = {layout.name: value for layout, value in residuals.items()}
    make: Callable[..., LayoutFinding] = lambda layout, verdict: LayoutFinding(
        layout, verdict, named, identity
    )
    if residual(candidates[first], candidates[second]) <= _SAME:
        single = candidates[first].shape[0] == 1
        because = " (one mode)" if single else " (all of it fits both)"
        return make(first, f"layouts equivalent{because}")
    if zero:
        return make(None, f"undecidable: {zero} is zero")
    best, other = sorted(candidates, key=lambda layout: residuals[layout])
    if residuals[best] > _FITS:
        return make(None, "undecidable: no layout fits")
    if residuals[other] < _WORSE * residuals[best]:
        return make(None, "undecidable: all layouts fit about as well")
    return make(best, best.name)


def find_squares(blocks: dict[str, SidBlock]) -> SquaresFinding:
    """Order of the columns of `Oe`, which in the undeformed body follow from `J.m1`."""
    slopes = -0.5 * inertia_slopes(blocks["J"])
    constant = blocks["Oe"].m0
    orders = {"xy, yz, xz": SQUARES, "xy, xz, yz": INERTIA}
    misfits = {
        name: residual(constant, in_squares(slopes, order))
        for name, order in orders.items()
    }
    best, other = sorted(misfits, key=lambda name: misfits[name])
    if not largest(slopes):
        return SquaresFinding(SQUARES, "undecidable: J.m1 is zero", False)
    if residual(slopes[:, 0, 2], slopes[:, 1, 2]) <= _SAME:
        return SquaresFinding(
            SQUARES, "undecidable: xz and yz of J.m1 are the same", False
        )
    if misfits[best] > _FITS or misfits[other] < _WORSE * misfits[best]:
        return SquaresFinding(SQUARES, "undecidable: no order fits", False)
    return SquaresFinding(orders[best], best, True)


def inertia_slopes(block: SidBlock) -> np.ndarray:
    """$J_1$ of shape (modes, 3, 3)."""
    return tensor(block.m1[:, :, 0].T)
