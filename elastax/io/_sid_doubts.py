"""What looks wrong in SID data, one line each."""

from collections.abc import Sequence

import numpy as np

from ._sid_findings import LayoutFinding, SquaresFinding, rotation_terms
from ._sid_layout import AXIS_MAJOR
from ._sid_taylor import IndexFinding, SidBlock
from ._sid_tensors import asymmetry, largest, residual, skew, tensor


# a body is hardly larger than this in metres
_LARGE = 50.0
# mass over the cube of the largest distance of anything built [kg/m^3]
_THIN, _DENSE = 1e-4, 2e5


def rotation_mismatch(blocks: dict[str, SidBlock], G_r: LayoutFinding) -> float:
    """Antisymmetric part of `Gr` against that of `Cr.m0`, over the largest element."""
    rotation = rotation_terms(blocks["Gr"].m0, G_r.layout or AXIS_MAJOR)
    rotation = 0.5 * (rotation - np.swapaxes(rotation, 1, 2))
    size = max(largest(blocks["Gr"].m0), largest(blocks["Cr"].m0))
    return largest(rotation + skew(blocks["Cr"].m0)) / size if size else 0.0


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


def smallest_mass(mass: float, blocks: dict[str, SidBlock]) -> float:
    """Smallest eigenvalue of the mass matrix scaled to a unit diagonal."""
    matrix = mass_matrix(mass, blocks)
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(scale > 0, scale, 1.0)
    return float(np.linalg.eigvalsh(matrix / scale[:, None] / scale[None])[0])


def doubtful_units(mass: float, size: float) -> tuple[str, list[str]]:
    """Units the numbers suggest, and what to do about others than SI."""
    density = mass / size**3 if size > 0 else None
    if size > _LARGE or (density is not None and density < _THIN):
        return "millimetres suspected", [
            f"lengths look like millimetres: distances up to {size:.4g} and a mass of "
            f"{mass:.4g}; if so, take `scaled(length=1e-3)`, and `mass=1e3` with it "
            "if the mass is in tonnes"
        ]
    if density is not None and density > _DENSE:
        return "other than SI suspected", [
            f"a mass of {mass:.4g} within distances up to {size:.4g} is denser than "
            "any metal: are these kilogrammes and metres?"
        ]
    return "metres and kilogrammes plausible", []


def doubtful_layouts(
    blocks: dict[str, SidBlock],
    indices: IndexFinding,
    G_r: LayoutFinding,
    G_e: LayoutFinding,
    O_e: SquaresFinding,
) -> list[str]:
    """Layouts that cannot be told."""
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


def doubtful_content(
    mass: float,
    nodes: Sequence,
    blocks: dict[str, SidBlock],
    counts: tuple[int, int],
    G_r: LayoutFinding,
    G_e: LayoutFinding,
    shown: tuple[str, ...],
) -> list[str]:
    """Numbers that no body has, and those that the modal body has no place for."""
    doubts = []
    if counts[0] != len(nodes):
        doubts.append(
            f"the first line counts {counts[0]} nodes, but there are {len(nodes)}"
        )
    smallest = smallest_mass(mass, blocks)
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
    damping = np.linalg.eigvalsh(blocks["De"].m0)[0]
    if damping < -1e-9 * largest(blocks["De"].m0):
        doubts.append(f"De has the negative eigenvalue {damping:.3g}")
    if largest(blocks["ksigma"].m0) or largest(blocks["ksigma"].m1):
        doubts.append("ksigma is not zero: a modal body has no prestress")
    mismatch = rotation_mismatch(blocks, G_r)
    if mismatch > 0.1:
        doubts.append(
            f"Gr and Cr.m0 differ by {mismatch:.2g} of the largest element, more than "
            "small rotary inertia does: the body takes J.m1 and Cr.m0"
        )
    uneven = residual(blocks["Cr"].m1, -np.swapaxes(blocks["Cr"].m1, 0, 1)) / 2
    if G_e.identity == "Ge = 2 Cr.m1" and uneven > 1e-6 and "Cr.m1" in shown:
        doubts.append(
            "Ge is twice Cr.m1 with its symmetric part, which the equations of motion "
            "do not have: the body takes Cr.m1 - Cr.m1^T"
        )
    for name in ("Me", "Gr", "Ge", "ksigma", "Ke", "De"):
        if largest(blocks[name].m1):
            doubts.append(f"`{name}` changes with the modes, which is not used")
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
