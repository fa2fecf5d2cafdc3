"""What was found out about a SID_FEM file: layouts, identities, units, doubts."""

import dataclasses
import textwrap

from ._report import Column, format_table
from ._sid_findings import LayoutFinding, SquaresFinding
from ._sid_taylor import IndexFinding


@dataclasses.dataclass(frozen=True)
class SidIdentity:
    """One identity among the blocks.

    Attributes:
        name: the identity.
        residual: its largest error over the largest element of the blocks [1].
        compared: whether there was anything but zero to compare.
    """

    name: str
    residual: float
    compared: bool


@dataclasses.dataclass(frozen=True)
class SidMeasure:
    """One number that need not be zero.

    Attributes:
        name: what it is.
        value: relative to the largest element [1], unless the meaning says otherwise.
        meaning: what it tells.
    """

    name: str
    value: float
    meaning: str


@dataclasses.dataclass(frozen=True)
class SidReport:
    """Detected and reported, never mended.

    Attributes:
        path: of the file.
        generator: first line of the file behind the counts.
        modes: number of modes.
        nodes: number of nodes.
        block_names: of the first moment and the inertia.
        indices: order of the indices of `m1`.
        G_r: column layout of `Gr`.
        G_e: column layout of `Ge`.
        O_e: columns of `Oe`.
        storage: elements that were written of each symmetric matrix.
        stiffening: whether geometric stiffening is included, and where it shows.
        stiffening_blocks: blocks that only stiffening makes what they are.
        identities: those that hold in a consistent file.
        measures: what else may be told from the numbers.
        size: largest distance that is found in the file.
        units: that size and mass suggest.
        warnings: one line each.
    """

    path: str
    generator: str
    modes: int
    nodes: int
    block_names: tuple[str, str]
    indices: IndexFinding
    G_r: LayoutFinding
    G_e: LayoutFinding
    O_e: SquaresFinding
    storage: dict[str, str]
    stiffening: str
    stiffening_blocks: tuple[str, ...]
    identities: tuple[SidIdentity, ...]
    measures: tuple[SidMeasure, ...]
    size: float
    units: str
    warnings: tuple[str, ...]

    @property
    def largest_residual(self) -> float:
        """Of all identities."""
        return max(identity.residual for identity in self.identities)

    def __str__(self) -> str:
        return self.table()

    def table(self) -> str:
        """The report as text for the terminal."""
        storage = ", ".join(f"{name} {how}" for name, how in self.storage.items())
        found = [
            ("generator", textwrap.shorten(self.generator, 100) or "-"),
            ("modes, nodes", f"{self.modes}, {self.nodes}"),
            ("block names", ", ".join(self.block_names)),
            ("m1 indices", f"{self.indices.order.name} ({self.indices.verdict})"),
            ("Gr columns", self.G_r.verdict),
            ("Ge columns", f"{self.G_e.verdict}, {self.G_e.identity}"),
            ("Oe columns", self.O_e.verdict),
            ("storage", storage or "-"),
            ("geometric stiffening", self.stiffening),
            ("largest distance", f"{self.size:.4g}, {self.units}"),
        ]
        rows = [{"what": what, "is": text} for what, text in found]
        identities = [
            {
                "name": identity.name,
                "residual": f"{identity.residual:.1e}",
                "note": "" if identity.compared else "nothing to compare",
            }
            for identity in self.identities
        ]
        measures = [
            {
                "name": measure.name,
                "value": f"{measure.value:.1e}",
                "meaning": measure.meaning,
            }
            for measure in self.measures
        ]
        parts = [
            self.path,
            format_table(rows, (Column("what", "found"), Column("is", ""))),
            format_table(
                identities,
                (
                    Column("name", "identity"),
                    Column("residual", "residual"),
                    Column("note", ""),
                ),
            ),
            format_table(
                measures,
                (
                    Column("name", "measure"),
                    Column("value", "value"),
                    Column("meaning", "meaning"),
                ),
            ),
        ]
        if self.warnings:
            parts.append("\n  - ".join(["doubtful:", *self.warnings]))
        return "\n\n".join(parts)
