"""The table as Markdown."""

import pathlib

from ._rows import failures, label
from ._suite import SUITE, description


LINES = {
    1: "batched rigid inverse dynamics: 0.5 of Pinocchio, 0.02 of MJX",
    2: "elastic forward dynamics: 1.0 of Pinocchio's ABA batched, 2.0 in a scan",
    3: "closed-loop simulation and its derivatives",
    4: "ASIM: 1 s at 1 kHz in 50 ms, streamed step p99 200 us",
    5: "compilation, first row of the main job",
    6: "growth: linear in samples and cases, at most quadratic in coordinates",
    7: "equal to the reference routes",
    8: "numeric inverse kinematics: 99.9 % of all poses within limits, 32 starts",
}
COLUMNS = (
    "name",
    "value",
    "batch",
    "threads",
    "peer",
    "peer's value",
    "ratio",
    "difference",
    "compile [s]",
    "memory [MiB]",
    "target",
    "holds",
)


def markdown(header: dict, rows: list[dict], problems: list[str], notes: str) -> str:
    """`RESULTS.md` as one text.

    Args:
        header: machine, versions, date and length of the run.
        rows: of the table.
        problems: cases that gave no rows, one line each.
        notes: a section written by hand, or an empty text.
    """
    parts = ["# Benchmarks", _machine(header), "## Conditions", _conditions(rows)]
    if problems:
        parts += ["## Cases that failed", "\n".join(f"- {line}" for line in problems)]
    if notes:
        parts.append(notes.strip())
    for name in SUITE:
        found = [entry for entry in rows if entry["benchmark"] == name]
        if found:
            question, how = description(name)
            parts += [f"## {question}", how, _table(found), _remarks(found)]
    parts.append(
        "Value and peer's value: best of the repeats, measured turn by turn in one "
        "process. Difference: largest relative difference of the results. Memory: peak "
        "of the whole process. Every row with all its figures: `results.json`. Made by "
        "`make bench`."
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def _machine(header: dict) -> str:
    machine, versions = header["machine"], header["versions"]
    shown = ", ".join(f"{k} {v}" for k, v in versions.items() if v is not None)
    length = "" if header["minutes"] is None else f", {header['minutes']:.0f} min"
    quick = " **Quick run: rough figures.**" if header["quick"] else ""
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['memory_gib']} GiB, "
        f"{machine['system']}; float64. {header['date']}{length}.{quick}\n\n{shown}."
    )


def _conditions(rows: list[dict]) -> str:
    """What is asked for, and whether it holds."""
    lines = ["| line | asks for | checks | hold | worst |", "|---|---|---|---|---|"]
    for line, text in LINES.items():
        checks = [(e, c) for e in rows for c in e["checks"] if c["line"] == line]
        if not checks:
            lines.append(f"| {line} | {text} | not measured | | |")
            continue
        worst, check = max(checks, key=lambda pair: _excess(pair[1]))
        held = sum(_excess(check) <= 1 for _, check in checks)
        lines.append(
            f"| {line} | {text} | {len(checks)} | {held} | {label(worst)}: "
            f"{check['quantity']} {number(worst[check['quantity']])}, at most "
            f"{check['limit']:g} |"
        )
    failed = failures(rows)
    if failed:
        lines += ["", "What fails the run:", "", *(f"- {text}" for text in failed)]
    return "\n".join(lines)


def _excess(check: dict) -> float:
    return float("inf") if check["excess"] is None else check["excess"]


def _table(rows: list[dict]) -> str:
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for entry in rows:
        name = entry["name"]
        if entry.get("variant"):
            name += f" ({entry['variant']})"
        unit = entry["unit"] if entry["unit"] != "exponent" else ""
        cells = [
            name,
            f"{number(entry['value'])} {unit}".strip(),
            str(entry["batch"]),
            str(entry["threads"]),
            entry["peer"] or "",
            f"{number(entry['peer_value'])} {unit}".strip() if entry["peer"] else "",
            number(entry["ratio"]),
            number(entry["max_difference"], 1),
            number(entry["compile_s"]),
            number(entry.get("memory_mib")),
            entry["target"] or "",
            {True: "yes", False: "**no**", None: ""}[entry["holds"]],
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _remarks(rows: list[dict]) -> str:
    notes: dict[str, list[str]] = {}
    for entry in rows:
        if entry.get("note"):
            name = entry["name"]
            if entry.get("variant"):
                name += f" ({entry['variant']})"
            names = notes.setdefault(entry["note"], [])
            if name not in names:
                names.append(name)
    return "\n".join(f"- {', '.join(names)}: {note}." for note, names in notes.items())


def number(value: float | None, digits: int = 3) -> str:
    """A figure with some digits, or nothing."""
    if value is None:
        return ""
    if value and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits - 1}e}"
    if abs(value) >= 10 ** (digits - 1) and digits > 1:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def read_notes(folder: pathlib.Path) -> str:
    """The section written by hand, `NOTES.md` beside the runner."""
    path = folder / "NOTES.md"
    return path.read_text(encoding="utf-8") if path.is_file() else ""
