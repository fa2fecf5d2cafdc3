"""Grammar of SID_FEM files: lines become records, each with its line number.

Nothing is interpreted here: matrices stay lists of indices and numbers.
"""

import dataclasses
import re


NODE_BLOCKS = ("origin", "phi", "psi", "AP", "sigma")
# names that two generators use for the same block
ALIASES = {"mCM": "mdCM", "mmi": "J"}
BODY_BLOCKS = (
    "mdCM",
    "J",
    "Ct",
    "Cr",
    "Me",
    "Gr",
    "Ge",
    "Oe",
    "ksigma",
    "Ke",
    "De",
)
SIZES = ("order", "nrow", "ncol", "nq", "nqn", "structure")

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?")
_RECORD = re.compile(r"(m0|m1|mn)\s*\(([^)]*)\)")
_LABEL = re.compile(r"ielastq\s*\(\s*(\d+)\s*\)")


@dataclasses.dataclass(frozen=True)
class Record:
    """One number of a matrix.

    Attributes:
        kind: "m0", "m1" or "mn".
        indices: as written, from one.
        value: the number.
        line: where it is written.
    """

    kind: str
    indices: tuple[int, ...]
    value: float
    line: int


@dataclasses.dataclass(frozen=True)
class RawBlock:
    """One Taylor series as written.

    Attributes:
        name: as written.
        where: for messages, such as "block `Me`".
        sizes: order, nrow, ncol, nq, nqn, structure.
        lines: where these are written.
        records: its numbers.
        line: its first line.
    """

    name: str
    where: str
    sizes: dict[str, int]
    lines: dict[str, int]
    records: tuple[Record, ...]
    line: int


@dataclasses.dataclass(frozen=True)
class RawNode:
    """One node as written.

    Attributes:
        label: its number, as text.
        reference: name of its reference frame.
        blocks: by name.
        line: its first line.
    """

    label: str
    reference: str
    blocks: dict[str, RawBlock]
    line: int


@dataclasses.dataclass(frozen=True)
class RawSid:
    """A file as written.

    Attributes:
        path: for messages.
        counts: numbers of nodes and modes of the first line.
        comment: rest of the first line, which names the generator.
        name: of the modal object.
        mass: [kg] in SI files.
        mass_line: where it is written.
        modes: `nelastq`.
        mode_labels: one per mode; empty where there is none.
        nodes: in the file's order.
        blocks: of the body, by their FEMBS names.
    """

    path: str
    counts: tuple[int, int]
    comment: str
    name: str
    mass: float
    mass_line: int
    modes: int
    mode_labels: tuple[str, ...]
    nodes: tuple[RawNode, ...]
    blocks: dict[str, RawBlock]


def parse_records(text: str, path: str) -> RawSid:
    """Records of a SID_FEM file.

    Args:
        text: the whole file.
        path: for messages.

    Raises:
        ValueError: a line is not what the grammar asks for; names line and block.
    """
    return _Parser(text, path).file()


def refusal(path: str, line: int, where: str, message: str) -> ValueError:
    """The error of a place in the file."""
    return ValueError(f"{path}, line {line}, {where}: {message}")


def parse_real(text: str) -> float | None:
    """A Fortran real such as `-1.5D-08`; `None` if it is none, or beyond 1e60."""
    match = _REAL.fullmatch(text.strip())
    if match is None:
        return None
    exponent = match[2] or match[3] or "0"
    value = float(f"{match[1]}e{exponent}")
    return value if abs(value) < 1e60 else None


class _Parser:
    """Lines of the file that are not blank, one after the other."""

    def __init__(self, text: str, path: str):
        lines = text.rstrip().split("\n")
        self.path = path
        self.lines = [(k, x.strip()) for k, x in enumerate(lines, 1) if x.strip()]
        self.last = len(lines)
        self.next = 0

    def fail(self, line: int, where: str, message: str) -> ValueError:
        return refusal(self.path, line, where, message)

    def take(self, where: str) -> tuple[int, str]:
        """The next line."""
        if self.next >= len(self.lines):
            raise self.fail(
                self.last, where, "the file ends here: its end is missing (truncated?)"
            )
        self.next += 1
        return self.lines[self.next - 1]

    def look(self) -> str:
        """The next line without taking it; empty at the end of the file."""
        return self.lines[self.next][1] if self.next < len(self.lines) else ""

    def keyword(self, words: str, where: str) -> int:
        """Take a line of these words."""
        line, text = self.take(where)
        if text.split() != words.split():
            raise self.fail(line, where, f"must be `{words}`, but is `{text}`")
        return line

    def assignment(self, key: str, where: str) -> tuple[int, str]:
        """Take a line `key = value`."""
        line, text = self.take(where)
        left, _, right = text.partition("=")
        if left.strip() != key or "=" not in text:
            raise self.fail(line, where, f"must be `{key} = ...`, but is `{text}`")
        return line, right.strip()

    def integer(self, key: str, where: str) -> tuple[int, int]:
        line, text = self.assignment(key, where)
        if not re.fullmatch(r"\d{1,9}", text):
            raise self.fail(
                line, where, f"`{key}` must be a whole number, but is `{text}`"
            )
        return line, int(text)

    def file(self) -> RawSid:
        counts, comment = self.header()
        self.keyword("part", "the part")
        line, text = self.take("the part")
        left, _, name = text.partition("=")
        if left.split() != ["new", "modal"]:
            raise self.fail(line, "the part", f"must be `new modal`, but is `{text}`")
        mass_line, mass, modes, labels = self.reference_modes()
        nodes = self.frame()
        blocks = self.body_blocks()
        self.keyword("end part", "the part")
        if self.next < len(self.lines):
            line, text = self.lines[self.next]
            raise self.fail(
                line,
                "after `end part`",
                f"nothing may follow, but there is `{text}`: keep one part a file",
            )
        return RawSid(
            self.path,
            counts,
            comment,
            name.strip(),
            mass,
            mass_line,
            modes,
            labels,
            nodes,
            blocks,
        )

    def header(self) -> tuple[tuple[int, int], str]:
        line, text = self.take("the header")
        match = re.match(r"(\d{1,9})\s+(\d{1,9})\s*(?::|$)(.*)", text)
        if match is None or line != 1:
            raise self.fail(
                line,
                "the header",
                "must begin with the numbers of nodes and modes and a colon, but is "
                f"`{text[:60]}`: is this a SID_FEM file?",
            )
        comment = match[3].strip().removeprefix("No. nodes, No. modes:")
        return (int(match[1]), int(match[2])), comment.strip()

    def reference_modes(self) -> tuple[int, float, int, tuple[str, ...]]:
        where = "`refmod`"
        self.keyword("refmod", where)
        mass_line, text = self.assignment("mass", where)
        mass = parse_real(text)
        if mass is None:
            raise self.fail(
                mass_line, where, f"`mass` must be a number, but is `{text}`"
            )
        if not mass > 1e-30:
            raise self.fail(
                mass_line, where, f"`mass` must be positive, but is {mass:g}"
            )
        line, modes = self.integer("nelastq", where)
        if not 1 <= modes <= 10_000:
            raise self.fail(
                line, where, f"`nelastq` must be from 1 to 10000, but is {modes}"
            )
        labels = [""] * modes
        while (match := _LABEL.match(self.look())) is not None:
            line, text = self.take(where)
            k = int(match[1])
            if not 1 <= k <= modes:
                raise self.fail(
                    line, where, f"`ielastq` must be of modes 1 to {modes}, not {k}"
                )
            labels[k - 1] = text.partition("=")[2].strip()
        self.keyword("end refmod", where)
        return mass_line, mass, modes, tuple(labels)

    def frame(self) -> tuple[RawNode, ...]:
        self.keyword("frame", "`frame`")
        nodes = []
        while self.look().split() != ["end", "frame"]:
            nodes.append(self.node(tuple(node.label for node in nodes)))
        self.keyword("end frame", "`frame`")
        return tuple(nodes)

    def node(self, known: tuple[str, ...]) -> RawNode:
        start, text = self.take("`frame`")
        left, _, label = text.partition("=")
        label = label.strip()
        if left.split() != ["new", "node"] or not re.fullmatch(r"-?\d+", label):
            raise self.fail(
                start,
                "`frame`",
                f"must be `new node = <number>` or `end frame`, but is `{text}`",
            )
        where = f"node {label}"
        if label in known:
            raise self.fail(start, where, "a node of this number is there already")
        _, reference = self.assignment("rframe", where)
        blocks: dict[str, RawBlock] = {}
        while self.look().split() != ["end", "node"]:
            block = self.block(NODE_BLOCKS, f"`{{}}` of {where}", where)
            if block.name in blocks:
                raise self.fail(block.line, block.where, "this block is there twice")
            blocks[block.name] = block
        line = self.keyword("end node", where)
        for name in NODE_BLOCKS[:-1]:
            if name not in blocks:
                raise self.fail(line, where, f"the block `{name}` is missing")
        return RawNode(label, reference, blocks, start)

    def body_blocks(self) -> dict[str, RawBlock]:
        blocks: dict[str, RawBlock] = {}
        while self.look().split() != ["end", "modal"]:
            block = self.block((*BODY_BLOCKS, *ALIASES), "block `{}`", "the body")
            name = ALIASES.get(block.name, block.name)
            if name in blocks:
                raise self.fail(block.line, block.where, "this block is there twice")
            blocks[name] = block
        line = self.keyword("end modal", "the body")
        for name in BODY_BLOCKS:
            if name not in blocks:
                raise self.fail(
                    line,
                    "the body",
                    f"the block `{name}` is missing: write it with `structure = 0` if "
                    "it is zero",
                )
        return blocks

    def block(self, names: tuple[str, ...], where: str, outside: str) -> RawBlock:
        start, name = self.take(outside)
        if name not in names:
            raise self.fail(
                start, outside, f"must be one of {', '.join(names)}, but is `{name}`"
            )
        where = where.format(name)
        sizes, lines = {}, {}
        for key in SIZES:
            lines[key], sizes[key] = self.integer(key, where)
        records = []
        while not self.look().startswith("end"):
            records.append(self.record(where))
        self.keyword(f"end {name}", where)
        return RawBlock(name, where, sizes, lines, tuple(records), start)

    def record(self, where: str) -> Record:
        line, text = self.take(where)
        left, equal, right = text.partition("=")
        match = _RECORD.fullmatch(left.strip())
        if match is None or not equal:
            raise self.fail(
                line,
                where,
                f"must be a number `m0(i, j) = ...` or the like, or `end`, but is "
                f"`{text}`: is its `end` missing?",
            )
        wanted = 2 if match[1] == "m0" else 3
        parts = [part.strip() for part in match[2].split(",")]
        if len(parts) != wanted or not all(
            re.fullmatch(r"\d{1,9}", part) for part in parts
        ):
            raise self.fail(
                line, where, f"`{match[1]}` needs {wanted} indices, but has `{text}`"
            )
        value = parse_real(right)
        if value is None:
            raise self.fail(
                line, where, f"`{right.strip()}` is not a number below 1e60: `{text}`"
            )
        return Record(match[1], tuple(int(part) for part in parts), value, line)
