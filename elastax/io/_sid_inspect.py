"""Identities, measures and doubts of SID data."""

import re
from collections.abc import Sequence

import numpy as np

from ._sid_findings import (
    LayoutFinding,
    SquaresFinding,
    find_modal_layout,
    find_rotation_layout,
    find_squares,
    inertia_slopes,
    rotation_terms,
)
from ._sid_layout import AXIS_MAJOR
from ._sid_report import SidIdentity, SidMeasure, SidReport
from ._sid_taylor import SYMMETRIC_BLOCKS, IndexFinding, SidBlock
from ._sid_tensors import (
    asymmetry,
    in_squares,
    largest,
    residual,
    skew,
    tensor,
)


# identities of consistent files hold to the printed digits, 1e-11
_HOLDS = 1e-9
# a body is hardly larger than this in metres
_LARGE = 50.0
# mass over the cube of the largest distance of anything built [kg/m^3]
_THIN, _DENSE = 1e-4, 2e5


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
    warnings = [
        *_layout_doubts(blocks, indices, G_r, G_e, O_e),
        *(
            f"`{identity.name}` does not hold: residual {identity.residual:.1e}"
            for identity in identities
            if identity.residual > _HOLDS
        ),
        *_unit_doubts(mass, size),
        *_content_doubts(mass, nodes, blocks, counts, G_e, shown),
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
    rotary = rotation_terms(blocks["Gr"].m0, G_r.layout or AXIS_MAJOR)
    rotary = 0.5 * (rotary - np.swapaxes(rotary, 1, 2))
    slopes, squares = blocks["Cr"].m1, blocks["Oe"].m1
    # both are squares of the mode shapes times masses
    size = max(largest(slopes), largest(blocks["Me"].m0))
    trace = np.sum(squares[:, :, :3], axis=-1)
    curved = max((asymmetry_of_shapes(node) for node in nodes), default=0.0)
    matrix = mass_matrix(mass, blocks)
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(scale > 0, scale, 1.0)
    smallest = np.linalg.eigvalsh(matrix / scale[:, None] / scale[None])[0]
    return (
        SidMeasure(
            "Gr against Cr.m0",
            residual(rotary, -skew(blocks["Cr"].m0)),
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
            float(smallest),
            "with a unit diagonal, undeformed; must be positive",
        ),
    )


def asymmetry_of_shapes(node) -> float:
    """Of `phi.m1` of a node in mode and column."""
    return asymmetry(np.moveaxis(node.blocks["phi"].m1, 0, -1))


def mass_matrix(mass: float, blocks: dict[str, SidBlock]) -> np.ndarray:
    """Mass matrix of the undeformed body, shape (6 + modes, 6 + modes)."""
    moment = skew(blocks["mdCM"].m0[:, 0])
    C_t, C_r = blocks["Ct"].m0, blocks["Cr"].m0
    return np.block(
        [
            [mass * np.eye(3), -moment, C_t.T],
            [moment, tensor(blocks["J"].m0[:, 0]), C_r.T],
            [C_t, C_r, blocks["Me"].m0],
        ]
    )


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


def _unit_doubts(mass: float, size: float) -> list[str]:
    doubts = []
    density = mass / size**3 if size > 0 else None
    if size > _LARGE or (density is not None and density < _THIN):
        doubts.append(
            f"lengths look like millimetres: distances up to {size:.4g} and a mass of "
            f"{mass:.4g}; if so, take `scaled(length=1e-3)`, and `mass=1e3` with it "
            "if the mass is in tonnes"
        )
    elif density is not None and density > _DENSE:
        doubts.append(
            f"a mass of {mass:.4g} within distances up to {size:.4g} is denser than "
            "any metal: are these kilogrammes and metres?"
        )
    return doubts


def _layout_doubts(
    blocks: dict[str, SidBlock],
    indices: IndexFinding,
    G_r: LayoutFinding,
    G_e: LayoutFinding,
    O_e: SquaresFinding,
) -> list[str]:
    doubts = []
    if not indices.decided:
        doubts.append(
            "the order of the indices of `m1` cannot be told: they were read as "
            f"{indices.order.name}; name the dialect to `load_sid` if they are not"
        )
    for name, finding in (("Gr", G_r), ("Ge", G_e)):
        if finding.layout is None:
            doubts.append(f"columns of `{name}` {finding.verdict}")
    if not O_e.decided and largest(blocks["Oe"].m1[:, :, 4:]):
        doubts.append(f"columns of `Oe` {O_e.verdict}: read as xy, yz, xz")
    return doubts


def _content_doubts(
    mass: float,
    nodes: Sequence,
    blocks: dict[str, SidBlock],
    counts: tuple[int, int],
    G_e: LayoutFinding,
    shown: tuple[str, ...],
) -> list[str]:
    doubts = []
    if counts[0] != len(nodes):
        doubts.append(
            f"the first line counts {counts[0]} nodes, but there are {len(nodes)}"
        )
    matrix = mass_matrix(mass, blocks)
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(scale > 0, scale, 1.0)
    smallest = np.linalg.eigvalsh(matrix / scale[:, None] / scale[None])[0]
    if not smallest > 0:
        doubts.append(
            "the mass matrix of the undeformed body is not positive definite "
            f"(smallest eigenvalue {smallest:.2g} with a unit diagonal): the body "
            "cannot be let loose in a simulation"
        )
    moment = skew(blocks["mdCM"].m0[:, 0])
    about_centre = tensor(blocks["J"].m0[:, 0]) + moment @ moment / mass
    least = np.linalg.eigvalsh(about_centre)[0]
    if least < -1e-9 * largest(about_centre):
        doubts.append(
            f"the inertia about the centre of mass has a negative principal moment, "
            f"{least:.4g}"
        )
    uneven = asymmetry(blocks["Oe"].m1)
    if uneven > 1e-6:
        doubts.append(
            f"Oe.m1 is not symmetric in its modes ({uneven:.3g} of its largest "
            "element): the body takes the mean"
        )
    if largest(blocks["ksigma"].m0) or largest(blocks["ksigma"].m1):
        doubts.append("ksigma is not zero: a modal body has no prestress")
    uneven = residual(blocks["Cr"].m1, -np.swapaxes(blocks["Cr"].m1, 0, 1)) / 2
    if G_e.identity == "Ge = 2 Cr.m1" and uneven > 1e-6 and "Cr.m1" in shown:
        doubts.append(
            "Ge is twice Cr.m1 with its symmetric part, which the equations of motion "
            "do not have: the body takes Cr.m1 - Cr.m1^T"
        )
    for name, block in blocks.items():
        if largest(block.mn):
            doubts.append(f"`{name}` has second-order numbers `mn`, which are not used")
    for node in nodes:
        for name in ("psi", "sigma"):
            if name in node.blocks and largest(node.blocks[name].m1):
                doubts.append(
                    f"`{name}` of node {node.label} changes with the modes, which is "
                    "not used"
                )
        for name, block in node.blocks.items():
            if largest(block.mn):
                doubts.append(f"`{name}` of node {node.label} has `mn`, not used")
    return doubts
