"""Identities, measures and doubts of SID data."""

import re
from collections.abc import Sequence

import numpy as np

from ._sid_doubts import (
    doubtful_content,
    doubtful_layouts,
    doubtful_units,
    rotation_mismatch,
    smallest_mass,
)
from ._sid_findings import (
    LayoutFinding,
    SquaresFinding,
    find_modal_layout,
    find_rotation_layout,
    find_squares,
    inertia_slopes,
)
from ._sid_report import SidIdentity, SidMeasure, SidReport
from ._sid_taylor import SYMMETRIC_BLOCKS, IndexFinding, SidBlock
from ._sid_tensors import (
    asymmetry,
    in_squares,
    largest,
    residual,
    skew,
)


# identities of consistent files hold to the printed digits, 1e-11
_HOLDS = 1e-9


def inspect_blocks(
    *,
    path: str,
    generator: str,
    counts: tuple[int, int],
    block_names: tuple[str, str],
    indices: IndexFinding,
    mass: float,
    nodes: Sequence,
    blocks: dict[str, SidBlock],
) -> SidReport:
    """Report of the blocks of a file.

    Args:
        path: of the file.
        generator: first line behind the counts.
        counts: numbers of nodes and modes of the first line.
        block_names: of the first moment and the inertia.
        indices: finding on the order of the indices.
        mass: of the body.
        nodes: records with `label` and `blocks`.
        blocks: of the body, by their FEMBS names.
    """
    G_r, G_e = find_rotation_layout(blocks), find_modal_layout(blocks)
    O_e = find_squares(blocks)
    identities = _identities(nodes, blocks, G_r, G_e, O_e)
    measures = _measures(mass, nodes, blocks, G_r)
    shown = _stiffening_blocks(nodes, blocks)
    size = _size(mass, nodes, blocks)
    units, doubts_of_units = doubtful_units(mass, size)
    warnings = [
        *doubtful_layouts(blocks, indices, G_r, G_e, O_e),
        *(
            f"`{identity.name}` does not hold: residual {identity.residual:.1e}"
            for identity in identities
            if identity.residual > _HOLDS
        ),
        *doubts_of_units,
        *doubtful_content(mass, nodes, blocks, counts, G_r, G_e, shown),
    ]
    return SidReport(
        path,
        " ".join(generator.split()),
        blocks["Ct"].m0.shape[0],
        len(nodes),
        block_names,
        indices,
        G_r,
        G_e,
        O_e,
        {name: blocks[name].storage for name in SYMMETRIC_BLOCKS},
        _stiffening(generator, shown),
        shown,
        identities,
        measures,
        size,
        units,
        tuple(warnings),
    )


def _identities(
    nodes: Sequence,
    blocks: dict[str, SidBlock],
    G_r: LayoutFinding,
    G_e: LayoutFinding,
    O_e: SquaresFinding,
) -> tuple[SidIdentity, ...]:
    slopes = inertia_slopes(blocks["J"])
    found = [
        _identity(
            "mdCM.m1 = Ct.m0^T",
            blocks["mdCM"].m1[:, :, 0].T,
            blocks["Ct"].m0,
            blocks["mdCM"],
        ),
        SidIdentity(
            G_r.identity,
            min(G_r.residuals.values()),
            bool(largest(slopes) or largest(blocks["Gr"].m0)),
        ),
        SidIdentity(
            G_e.identity,
            min(G_e.residuals.values()),
            bool(largest(blocks["Cr"].m1) or largest(blocks["Ge"].m0)),
        ),
        _identity(
            "Oe.m0 = -1/2 J.m1", blocks["Oe"].m0, -0.5 * in_squares(slopes, O_e.order)
        ),
    ]
    per_node = []
    for node in nodes:
        part = node.blocks
        origin, AP = part["origin"], part["AP"]
        turned = skew(part["psi"].m0.T) @ AP.m0
        turns = np.swapaxes(AP.m1, 0, 1)
        per_node.append(
            [
                _identity(
                    "origin.m1 = phi.m0", origin.m1[:, :, 0], part["phi"].m0, origin
                ),
                _identity("AP.m1 = skew(psi.m0) AP.m0", turns, turned, AP),
                _identity("AP.m0 = 1", AP.m0, np.eye(3)),
            ]
        )
    for same in zip(*per_node):
        worst = max(same, key=lambda identity: identity.residual)
        compared = any(identity.compared for identity in same)
        found.append(SidIdentity(worst.name, worst.residual, compared))
    return tuple(found)


def _identity(
    name: str, one: np.ndarray, other: np.ndarray, block: SidBlock | None = None
) -> SidIdentity:
    """Comparison of two arrays, unless the block leaves its slopes out."""
    if block is not None and block.order == 0:
        return SidIdentity(name, 0.0, False)
    compared = bool(largest(one) or largest(other))
    return SidIdentity(name, residual(one, other), compared)


def _measures(
    mass: float, nodes: Sequence, blocks: dict[str, SidBlock], G_r: LayoutFinding
) -> tuple[SidMeasure, ...]:
    slopes, squares = blocks["Cr"].m1, blocks["Oe"].m1
    # both are squares of the mode shapes times masses
    size = max(largest(slopes), largest(blocks["Me"].m0))
    trace = np.sum(squares[:, :, :3], axis=-1)
    curved = max((asymmetry_of_shapes(node) for node in nodes), default=0.0)
    return (
        SidMeasure(
            "Gr against Cr.m0",
            rotation_mismatch(blocks, G_r),
            "rotary inertia of the nodes makes them differ",
        ),
        SidMeasure(
            "Cr.m1, symmetric part",
            0.5 * largest(slopes + np.swapaxes(slopes, 0, 1)) / size,
            "against Cr.m1 and Me; zero without geometric stiffening",
        ),
        SidMeasure(
            "Oe.m1, difference to its transpose",
            asymmetry(squares),
            "zero in theory; the body takes the mean",
        ),
        SidMeasure(
            "Ct.m1, difference to its transpose",
            asymmetry(blocks["Ct"].m1),
            "zero in theory; the body takes the mean",
        ),
        SidMeasure(
            "phi.m1, difference to its transpose",
            curved,
            "zero in theory; the body takes the mean",
        ),
        SidMeasure(
            "Oe.m1, first three columns, against -2 Me",
            residual(trace, -2.0 * blocks["Me"].m0),
            "zero without stiffening and rotary inertia",
        ),
        SidMeasure(
            "mass matrix, smallest eigenvalue",
            smallest_mass(mass, blocks),
            "with a unit diagonal, undeformed; must be positive",
        ),
    )


def asymmetry_of_shapes(node) -> float:
    """Of `phi.m1` of a node in mode and column."""
    return asymmetry(np.moveaxis(node.blocks["phi"].m1, 0, -1))


def _stiffening_blocks(nodes: Sequence, blocks: dict[str, SidBlock]) -> tuple[str, ...]:
    """Blocks that no first-order displacement explains."""
    shown = []
    if largest(blocks["Ct"].m1):
        shown.append("Ct.m1")
    slopes = blocks["Cr"].m1
    # an antisymmetric part of rounding errors alone tells nothing
    noise = 1e-12 * max(largest(blocks["J"].m0), largest(blocks["Me"].m0))
    part = 0.5 * largest(slopes + np.swapaxes(slopes, 0, 1))
    if part > max(1e-6 * largest(slopes), noise):
        shown.append("Cr.m1")
    if any(largest(node.blocks["phi"].m1) for node in nodes):
        shown.append("phi.m1")
    return tuple(shown)


def _stiffening(generator: str, shown: tuple[str, ...]) -> str:
    seen = f"shows in {', '.join(shown)}" if shown else "does not show in the blocks"
    text = generator.lower()
    if re.search(r"geo_stiff\s*=\s*yes", text):
        return f"claimed, {seen}"
    if re.search(r"geo_stiff\s*=\s*no|no geometrical stiffness", text):
        return f"denied, {seen}"
    return f"not mentioned, {seen}"


def _size(mass: float, nodes: Sequence, blocks: dict[str, SidBlock]) -> float:
    """Largest of the nodes' distances, the centre's, and the radius of gyration."""
    places = [node.blocks["origin"].m0[:, 0] for node in nodes]
    places.append(blocks["mdCM"].m0[:, 0] / mass)
    gyration = np.sqrt(max(np.sum(blocks["J"].m0[:3]) / (2 * mass), 0.0))
    return max(float(gyration), *(float(np.linalg.norm(place)) for place in places))
