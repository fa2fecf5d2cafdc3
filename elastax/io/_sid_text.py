r"""Text of SID_FEM files: blocks of Taylor coefficients, line by line.

Blanks in front, the columns and the comment of the first line mean nothing. A block is

    name
        order, nrow, ncol, nq, nqn, structure     (six integers)
        m0( i, j) = v                             (order 0)
        m1( i, k, j) = v                          (order 1, two orders of the indices)
        mn( i, k, l, j) = v                       (order 2)
    end name

with elements that are zero left out. `structure` is 0 for zero, 1 diagonal, 2
symmetric, 3 general, 4 unit.
"""

import dataclasses
import re
from typing import NoReturn

import numpy as np


FIELDS = ("order", "nrow", "ncol", "nq", "nqn", "structure")
_RECORD = re.compile(r"^(m[0-9n])\s*\(([^)]*)\)$")


@dataclasses.dataclass
class TaylorText:
    """One block as it stands in the file.

    Attributes:
        name: of the block.
        line: of its name.
        fields: the six integers.
        records: by order, lists of (indices from one, value, line).
    """

    name: str
    line: int
    fields: dict[str, int]
    records: dict[str, list[tuple[tuple[int, ...], float, int]]]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.fields["nrow"], self.fields["ncol"]


@dataclasses.dataclass
class NodeText:
    """A node of the frame block: its label and its blocks."""

    label: str
    line: int
    blocks: dict[str, TaylorText]


@dataclasses.dataclass
class SidText:
    """A whole file as it stands.

    Attributes:
        path: for messages.
        header: comment of the first line.
        name: of the part.
        nodes, modes: as the first line counts them.
        mass: [kg], or the file's unit.
        labels: of the modes.
        frame: nodes.
        blocks: of the body, by their names in the file.
    """

    path: str
    header: str
    name: str
    nodes: int
    modes: int
    mass: float
    labels: list[str]
    frame: list[NodeText]
    blocks: dict[str, TaylorText]


def parse_sid(text: str, path: str = "SID data") -> SidText:
    """Structure of a SID_FEM file.

    Args:
        text: of the file.
        path: for messages.

    Raises:
        ValueError: the text breaks the grammar; the message names line and block.
    """
    return _Parser(text, path).parse()


class _Parser:
    """Position in the lines of a file."""

    def __init__(self, text: str, path: str):
        self.path = path
        lines = enumerate(text.splitlines(), start=1)
        self.lines = [(k, line.strip()) for k, line in lines if line.strip()]
        self.at = 0

    def fail(self, message: str, line: int | None = None) -> NoReturn:
        if line is None:
            line = self.lines[min(self.at, len(self.lines) - 1)][0]
        raise ValueError(f"{self.path}, line {line}: {message}")

    def peek(self) -> str:
        if self.at >= len(self.lines):
            self.fail("the file ends too early: an `end` is missing")
        return self.lines[self.at][1]

    def take(self) -> tuple[int, str]:
        text = self.peek()
        self.at += 1
        return self.lines[self.at - 1][0], text

    def expect(self, *words: str) -> str:
        """The line that begins with these words; what stands behind `=`."""
        line, text = self.take()
        left, _, right = text.partition("=")
        if left.split() != list(words):
            self.fail(
                f"`{' '.join(words)}` is expected, but `{text}` stands here", line
            )
        return right.strip()

    def end(self, name: str) -> None:
        line, text = self.take()
        if text.split() != ["end", name]:
            self.fail(f"`end {name}` is expected, but `{text}` stands here", line)

    def number(self, text: str, line: int, what: str) -> float:
        try:
            return float(text.replace("D", "E").replace("d", "e"))
        except ValueError:
            self.fail(f"`{text}` is not a number ({what})", line)

    def integer(self, text: str, line: int, what: str) -> int:
        try:
            return int(text)
        except ValueError:
            self.fail(f"`{text}` is not an integer ({what})", line)

    def parse(self) -> SidText:
        if not self.lines:
            raise ValueError(f"{self.path}: the file is empty")
        line, first = self.take()
        counts, _, rest = first.partition(":")
        parts = counts.split()
        if len(parts) != 2:
            self.fail(
                "the first line must begin with the numbers of nodes and modes and a "
                f"colon, but is `{first[:60]}`",
                line,
            )
        nodes = self.integer(parts[0], line, "number of nodes")
        modes = self.integer(parts[1], line, "number of modes")
        header = re.sub(r"^No\. nodes, No\. modes:", "", rest).strip()
        self.expect("part")
        name = self.expect("new", "modal")
        mass, labels = self._refmod(modes)
        frame = self._frame(modes)
        if len(frame) != nodes:
            self.fail(
                f"the first line counts {nodes} nodes, but there are {len(frame)}", 1
            )
        blocks: dict[str, TaylorText] = {}
        while self.peek().split() != ["end", "modal"]:
            block = self._taylor(modes)
            if block.name in blocks:
                self.fail(f"the block `{block.name}` is there twice", block.line)
            blocks[block.name] = block
        self.end("modal")
        self.end("part")
        return SidText(
            self.path, header, name, nodes, modes, mass, labels, frame, blocks
        )

    def _refmod(self, modes: int) -> tuple[float, list[str]]:
        self.expect("refmod")
        mass_text = self.expect("mass")
        mass = self.number(mass_text, self.lines[self.at - 1][0], "mass")
        count = self.integer(
            self.expect("nelastq"), self.lines[self.at - 1][0], "nelastq"
        )
        if count != modes:
            self.fail(
                f"`nelastq` is {count}, but the first line counts {modes} modes",
                self.lines[self.at - 1][0],
            )
        labels = []
        while self.peek().startswith("ielastq"):
            labels.append(self.take()[1].partition("=")[2].strip())
        if len(labels) != modes:
            self.fail(f"`ielastq` must name {modes} modes, but names {len(labels)}")
        self.end("refmod")
        return mass, labels

    def _frame(self, modes: int) -> list[NodeText]:
        self.expect("frame")
        nodes = []
        while self.peek().split() != ["end", "frame"]:
            line = self.lines[self.at][0]
            label = self.expect("new", "node")
            self.expect("rframe")
            blocks = {}
            while self.peek().split() != ["end", "node"]:
                block = self._taylor(modes)
                blocks[block.name] = block
            self.end("node")
            for name in ("origin", "phi", "psi"):
                if name not in blocks:
                    self.fail(f"the node `{label}` has no block `{name}`", line)
            nodes.append(NodeText(label, line, blocks))
        self.end("frame")
        return nodes

    def _taylor(self, modes: int) -> TaylorText:
        line, name = self.take()
        if len(name.split()) != 1 or "=" in name:
            self.fail(
                f"the name of a block is expected, but `{name}` stands here", line
            )
        fields = {}
        for field in FIELDS:
            value = self.expect(field)
            at = self.lines[self.at - 1][0]
            fields[field] = self.integer(value, at, f"`{field}` of `{name}`")
        if fields["nq"] != modes:
            self.fail(
                f"`nq` of `{name}` is {fields['nq']}, but there are {modes} modes", line
            )
        if fields["structure"] not in range(5):
            self.fail(f"`structure` of `{name}` must be 0 to 4", line)
        if fields["order"] not in range(3):
            self.fail(f"`order` of `{name}` must be 0, 1 or 2", line)
        block = TaylorText(name, line, fields, {"m0": [], "m1": [], "mn": []})
        while not self.peek().startswith("end"):
            self._record(block)
        self.end(name)
        return block

    def _record(self, block: TaylorText) -> None:
        line, text = self.take()
        left, sign, right = text.partition("=")
        match = _RECORD.match(left.strip())
        if not match or not sign:
            self.fail(f"`{text}` is no element of `{block.name}`", line)
        order, inside = match.groups()
        order = {"m0": "m0", "m1": "m1"}.get(order, "mn")
        needed = {"m0": 2, "m1": 3, "mn": 4}[order]
        indices = tuple(
            self.integer(part.strip(), line, f"index in `{block.name}`")
            for part in inside.split(",")
        )
        if len(indices) != needed:
            self.fail(
                f"`{left.strip()}` of `{block.name}` needs {needed} indices", line
            )
        allowed = block.fields["order"]
        if {"m0": 0, "m1": 1, "mn": 2}[order] > allowed:
            self.fail(
                f"`{block.name}` has the order {allowed}, but an element "
                f"{left.strip()}",
                line,
            )
        value = self.number(right.strip(), line, f"element of `{block.name}`")
        if not np.isfinite(value):
            self.fail(f"an element of `{block.name}` is not finite", line)
        block.records[order].append((indices, value, line))
