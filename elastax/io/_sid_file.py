"""SID data of one flexible body: the blocks of a file, and the body they make up."""

import dataclasses
import functools

import numpy as np

from ..structure import BodyNodes, ModalBody
from ._sid_dialect import SidDialect
from ._sid_findings import inertia_slopes, rotation_terms
from ._sid_inspect import inspect_blocks
from ._sid_layout import AbstractColumnLayout
from ._sid_report import SidReport
from ._sid_taylor import IndexFinding, SidBlock
from ._sid_tensors import SQUARES, from_squares, largest, symmetric, tensor


@dataclasses.dataclass(frozen=True, eq=False)
class SidNode:
    """One node of the file.

    Attributes:
        label: its number in the finite-element model, as text.
        reference: name of its reference frame.
        blocks: `origin`, `phi`, `psi`, `AP` and, where it is there, `sigma`.
    """

    label: str
    reference: str
    blocks: dict[str, SidBlock]


@dataclasses.dataclass(frozen=True, eq=False)
class SidFile:
    r"""Content of a SID_FEM file, in the file's own layout and units.

    Attributes:
        path: of the file.
        comment: first line behind the counts; names the generator.
        name: of the modal object.
        mass: [kg] in SI files.
        mode_labels: one per mode.
        nodes: in the file's order.
        blocks: `mdCM`, `J`, `Ct`, `Cr`, `Me`, `Gr`, `Ge`, `Oe`, `ksigma`, `Ke`, `De`.
        block_names: of the first moment and the inertia.
        counts: numbers of nodes and modes of the first line.
        indices: finding on the order of the indices of `m1`.
        dialect: what the layouts are where the data cannot tell; `None` if unknown.

    References:
        [Wallrapp1994] for the series.
    """

    path: str
    comment: str
    name: str
    mass: float
    mode_labels: tuple[str, ...]
    nodes: tuple[SidNode, ...]
    blocks: dict[str, SidBlock]
    block_names: tuple[str, str]
    counts: tuple[int, int]
    indices: IndexFinding
    dialect: SidDialect | None = None

    @functools.cached_property
    def report(self) -> SidReport:
        """Layouts, identities, units and doubts; `print` shows it as tables."""
        return inspect_blocks(
            path=self.path,
            generator=self.comment,
            counts=self.counts,
            block_names=self.block_names,
            indices=self.indices,
            mass=self.mass,
            nodes=self.nodes,
            blocks=self.blocks,
        )

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.mode_labels)

    @property
    def G_r(self) -> np.ndarray:
        """`Gr` of shape (modes, 3, 3), whatever its layout.

        Raises:
            ValueError: the layout cannot be told, and no dialect was named.
        """
        given = None if self.dialect is None else self.dialect.G_r
        layout = self._layout("Gr", self.report.G_r.layout or given)
        return rotation_terms(self.blocks["Gr"].m0, layout)

    @property
    def G_e(self) -> np.ndarray:
        """`Ge` of shape (row, coordinate, axis), whatever its layout.

        Raises:
            ValueError: the layout cannot be told, and no dialect was named.
        """
        given = None if self.dialect is None else self.dialect.G_e
        layout = self._layout("Ge", self.report.G_e.layout or given)
        return layout.unpack(self.blocks["Ge"].m0)

    def _layout(
        self, name: str, layout: AbstractColumnLayout | None
    ) -> AbstractColumnLayout:
        if layout is None:
            finding = self.report.G_r if name == "Gr" else self.report.G_e
            raise ValueError(
                f"{self.path}: the columns of `{name}` are {finding.verdict}; name the "
                "generator's layout, such as `load_sid(path, dialect=FEMBS)`"
            )
        return layout

    @property
    def O_e0(self) -> np.ndarray:
        """`Oe.m0` of shape (modes, 6), columns xx, yy, zz, xy, yz, xz."""
        return self.blocks["Oe"].m0[:, self._squares()]

    @property
    def O_e1(self) -> np.ndarray:
        """`Oe.m1` of shape (row, coordinate, 6), columns xx, yy, zz, xy, yz, xz."""
        return self.blocks["Oe"].m1[:, :, self._squares()]

    def _squares(self) -> list[int]:
        return [self.report.O_e.order.index(pair) for pair in SQUARES]

    def frequencies(self) -> np.ndarray:
        """Eigenfrequencies by `Me` and `Ke` [Hz], ascending."""
        half = np.linalg.inv(np.linalg.cholesky(self.blocks["Me"].m0))
        squares = np.linalg.eigvalsh(half @ self.blocks["Ke"].m0 @ half.T)
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)

    def scaled(self, *, length: float = 1.0, mass: float = 1.0) -> "SidFile":
        r"""The data in other units of length and mass; modal coordinates stay.

        Energies, and with them all modal matrices, are multiplied by mass length^2:
        modes of unit modal mass no longer are, but keep their frequencies.

        Args:
            length: metres in the file's unit, such as `1e-3` for millimetres.
            mass: kilogrammes in the file's unit, such as `1e3` for tonnes.
        """
        for name, factor in (("length", length), ("mass", mass)):
            if not 0 < factor < float("inf"):
                raise ValueError(f"`{name}` must be positive, but is {factor}")
        energy = mass * length**2
        factors = {name: energy for name in self.blocks} | {
            "mdCM": mass * length,
            "Ct": mass * length,
        }
        at_nodes = {"origin": length, "phi": length, "psi": 1.0, "AP": 1.0}
        at_nodes["sigma"] = mass / length  # stress, seconds stay
        nodes = tuple(
            dataclasses.replace(
                node,
                blocks={k: b.times(at_nodes[k]) for k, b in node.blocks.items()},
            )
            for node in self.nodes
        )
        return dataclasses.replace(
            self,
            comment=f"{self.comment.rstrip()}; scaled: length {length:g}, mass "
            f"{mass:g}",
            mass=self.mass * mass,
            nodes=nodes,
            blocks={k: b.times(factors[k]) for k, b in self.blocks.items()},
        )

    def modal_body(self, name: str | None = None) -> ModalBody:
        r"""The body, for a reference frame that does not move with the modes.

        $J_2$ is taken from `Oe.m1`, $C_{t1}$ from `Ct.m1`, $\Phi_1$ from `phi.m1`; each
        is the mean over the two orders of the modes, `report` tells the difference.
        `Gr`, `Ge` and `Oe.m0` are not used: they follow from the others.

        Args:
            name: for messages; the name in the file unless given.

        Raises:
            ValueError: there is prestress in `ksigma`, or what `ModalBody` refuses.
        """
        blocks = self.blocks
        if largest(blocks["ksigma"].m0) or largest(blocks["ksigma"].m1):
            raise ValueError(
                f"{self.path}: `ksigma` holds a prestress, which a modal body has no "
                "place for: make it zero with `dataclasses.replace(file, blocks=...)` "
                "if it may be left out"
            )
        return ModalBody(
            mass=self.mass,
            first_moment=blocks["mdCM"].m0[:, 0],
            J_0=tensor(blocks["J"].m0[:, 0]),
            J_1=inertia_slopes(blocks["J"]),
            J_2=symmetric(from_squares(-2.0 * self.O_e1)),
            C_t0=blocks["Ct"].m0,
            C_t1=symmetric(blocks["Ct"].m1),
            C_r0=blocks["Cr"].m0,
            C_r1=blocks["Cr"].m1,
            M_e=symmetric(blocks["Me"].m0),
            K_e=symmetric(blocks["Ke"].m0),
            D_e=symmetric(blocks["De"].m0),
            nodes=self._body_nodes(),
            mode_names=tuple(
                label or f"mode {k}" for k, label in enumerate(self.mode_labels, 1)
            ),
            name=name or self.name or "body",
        )

    def _body_nodes(self) -> BodyNodes:
        modes, number = self.modes, len(self.nodes)
        take = lambda key: np.array([node.blocks[key].m0 for node in self.nodes])
        curved = np.array([node.blocks["phi"].m1 for node in self.nodes])
        curved = curved.reshape(number, 3, modes, modes)
        return BodyNodes(
            take("origin").reshape(number, 3),
            take("phi").reshape(number, 3, modes),
            take("psi").reshape(number, 3, modes),
            0.5 * (curved + np.swapaxes(curved, 2, 3)),
            tuple(node.label for node in self.nodes),
        )
