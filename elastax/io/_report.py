"""Tables for the terminal, and the report of a run as one HTML page."""

import base64
import dataclasses
import html
import math
from collections.abc import Mapping, Sequence
from typing import Any


@dataclasses.dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        key: of the rows.
        title: of the column.
        unit: in which the numbers are shown; empty if there is none.
        factor: from the rows' unit to the shown one.
        digits: significant digits of the largest number.
    """

    key: str
    title: str
    unit: str = ""
    factor: float = 1.0
    digits: int = 4


LABELS = {"rigid": "rigid", "flexible_joint": "flexible joint (RLFJ)", "asim": "ASIM"}
FEEDFORWARD_COLUMNS = (
    Column("inverse", "feed-forward"),
    Column("path_error_integral", "path error", "mm s", 1e3),
    Column("ratio", "/ RLFJ", "-"),
    Column("path_error_integral_relative", "offset subtracted", "mm s", 1e3),
    Column("ratio_relative", "/ RLFJ", "-"),
    Column("path_error_max", "largest", "mm", 1e3),
    Column("criterion", "C", "m/s"),
    Column("settling_time", "settling", "ms", 1e3, 3),
    Column("seconds_per_sample", "per sample", "us", 1e6, 3),
)


def feedforward_rows(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of a `elastax.feedforward/1` result for `FEEDFORWARD_COLUMNS`."""
    inverses = result["inverses"]
    base = inverses.get("flexible_joint", {})
    rows = []
    for name, figures in inverses.items():
        row = {"inverse": LABELS.get(name, name), **figures}
        for ratio, key in (
            ("ratio", "path_error_integral"),
            ("ratio_relative", "path_error_integral_relative"),
        ):
            value, reference = figures.get(key), base.get(key)
            row[ratio] = value / reference if value is not None and reference else None
        rows.append(row)
    return rows


def format_table(rows: Sequence[Mapping[str, Any]], columns: Sequence[Column]) -> str:
    """Aligned text table; units in the second line, `-` for what is not known.

    A column's numbers share their decimals, so that points stand below each other;
    numbers that would keep less than two digits, or are huge, take an exponent.

    Args:
        rows: numbers, text, or `None` by the columns' keys.
        columns: what is shown, in this order.
    """
    cells = [
        [column.title, f"[{column.unit}]" if column.unit else "", *_texts(rows, column)]
        for column in columns
    ]
    if not any(column[1] for column in cells):
        cells = [[column[0], *column[2:]] for column in cells]
    lines = []
    for line in zip(*cells):
        parts = []
        for text, column, all_texts in zip(line, columns, cells):
            width = max(map(len, all_texts))
            left = _is_text(rows, column)
            parts.append(text.ljust(width) if left else text.rjust(width))
        lines.append("  ".join(parts).rstrip())
    heads = 1 if not any(column.unit for column in columns) else 2
    lines.insert(heads, "-" * max(map(len, lines)))
    return "\n".join(lines)


def render_report(
    result: Mapping[str, Any], figures: Sequence[tuple[str, str, str, bytes]]
) -> str:
    """One self-contained HTML page: tables, figures, assumptions, configuration.

    Shows whatever of these the result holds: "inverses", "recording", "robot" (a name,
    or a mapping with "name", "assumptions" and "sources"), "assumptions", "sources",
    "configuration", "versions", "not_finite"; other numbers and texts come in a table
    of their own.

    Args:
        result: plain data, as in `result.json`.
        figures: name, title, caption and PNG.
    """
    robot = result.get("robot", "")
    about = robot if isinstance(robot, Mapping) else {"name": robot}
    job = str(result.get("schema", "result")).split("/")[0].split(".")[-1]
    name = about.get("name", "")
    heading = f"{job}: {name}" if name else job
    parts = [f"<h1>{_escape(heading)}</h1>"]
    if "inverses" in result:
        parts.append(_section("Comparison", _comparison(result)))
    for _, title, caption, picture in figures:
        data = base64.b64encode(picture).decode("ascii")
        parts.append(
            f'<figure><img alt="{_escape(title)}" '
            f'src="data:image/png;base64,{data}">'
            f"<figcaption><b>{_escape(title)}.</b> {_escape(caption)}</figcaption>"
            "</figure>"
        )
    if "recording" in result:
        parts.append(_section("Recording", _recording(result["recording"])))
    for title, key in (("Assumptions", "assumptions"), ("Sources", "sources")):
        lines = result.get(key) or about.get(key)
        if lines:
            items = "".join(f"<li>{_escape(line)}</li>" for line in lines)
            parts.append(_section(title, f"<ul>{items}</ul>"))
    known = {"inverses", "recording", "robot", "assumptions", "sources"}
    known |= {"configuration", "versions", "not_finite", "grid", "files"}
    rest = {key: value for key, value in result.items() if key not in known}
    for title, mapping in (
        ("Configuration", result.get("configuration")),
        ("Not finite", result.get("not_finite")),
        ("Run", rest),
        ("Versions", result.get("versions")),
    ):
        if mapping:
            parts.append(_section(title, _mapping(mapping)))
    return _PAGE.format(title=_escape(heading), style=_STYLE, body="\n".join(parts))


def _comparison(result) -> str:
    rows = feedforward_rows(result)
    table = _table(rows, FEEDFORWARD_COLUMNS)
    peaks = []
    axes = 0
    for name, figures in result["inverses"].items():
        for key, side in (
            ("peak_motor_torque", "motor, motor side"),
            ("peak_gear_torque", "gear, output side"),
        ):
            values = figures.get(key) or []
            axes = max(axes, len(values))
            row = {f"A{k + 1}": value for k, value in enumerate(values)}
            peaks.append({"inverse": LABELS.get(name, name), "torque": side, **row})
    columns = [Column("inverse", "feed-forward"), Column("torque", "peak torque")]
    columns += [Column(f"A{k + 1}", f"A{k + 1}", "N m") for k in range(axes)]
    note = (
        "Path error: distance of the tool from the rigid robot's tool on the same "
        "filtered reference, integrated from 0 to t_0 + 0.9 s. C: criterion (6.1) over "
        "0.9 s from t_0. Settling: until the tool stays within 0.1 mm."
    )
    text = table + f'<p class="note">{_escape(note)}</p>'
    return text + (_table(peaks, columns, split=True) if axes else "")


def _recording(recording) -> str:
    columns = [Column("axis", "axis")]
    rows = [{"axis": f"A{axis}"} for axis in recording.get("axes", [])]

    def add(values, key, title, unit="", factor=1.0, digits=3):
        if not values:
            return
        for row, value in zip(rows, values):
            row[key] = value
        columns.append(Column(key, title, unit, factor, digits))

    torque, windup = recording.get("torque", {}), recording.get("windup", {})
    add(recording.get("skew_s"), "skew", "skew", "ms", 1e3)
    add(torque.get("r2"), "r2", "torque R²")
    add(torque.get("rms"), "rms", "rms", "N m")
    add(torque.get("r2_raw"), "raw", "R², means kept")
    add(torque.get("stored_r2"), "stored", "stored R²")
    add(torque.get("stored_rms"), "stored_rms", "rms", "N m")
    add(windup.get("r2"), "windup", "wind-up R²")
    add(windup.get("rms"), "windup_rms", "rms", "mrad", 1e3)
    return _table(rows, columns)


# ------------------------------------------------------------------------------ numbers


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_text(rows, column: Column) -> bool:
    return any(isinstance(row.get(column.key), str) for row in rows)


def _texts(rows, column: Column) -> list[str]:
    values = [row.get(column.key) for row in rows]
    scaled = [column.factor * value if _is_number(value) else value for value in values]
    sizes = [
        abs(value)
        for value, raw in zip(scaled, values)
        if isinstance(raw, float) and math.isfinite(value) and value
    ]
    top = max(sizes, default=1.0)
    decimals = max(0, column.digits - 1 - math.floor(math.log10(top)))
    if math.floor(math.log10(min(sizes, default=1.0))) + decimals < column.digits - 2:
        decimals += 1
    exponent = top >= 1e7 or decimals > column.digits + 3

    def text(value, raw):
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "-"
        if not _is_number(value):
            return str(value)
        if isinstance(raw, int) and column.factor == 1.0:
            return str(raw)
        if math.isinf(value):
            return str(value)
        if exponent or (value and abs(value) < 10 * 10.0**-decimals):
            return f"{value:.{column.digits - 2}e}"
        return f"{value:.{decimals}f}"

    return [text(value, raw) for value, raw in zip(scaled, values)]


# --------------------------------------------------------------------------------- HTML


def _escape(text) -> str:
    return html.escape(str(text), quote=True)


def _section(title: str, body: str) -> str:
    return f"<section><h2>{_escape(title)}</h2>{body}</section>"


def _table(rows, columns: Sequence[Column], split: bool = False) -> str:
    """HTML table; with `split`, rows do not share the decimals of a column."""
    texts = [
        [text for row in rows for text in _texts([row], column)]
        if split
        else _texts(rows, column)
        for column in columns
    ]
    classes = ['class="text"' if _is_text(rows, c) else "" for c in columns]
    head = "".join(
        f"<th {style}>{_escape(column.title)}"
        + (f" <small>[{_escape(column.unit)}]</small>" if column.unit else "")
        + "</th>"
        for column, style in zip(columns, classes)
    )
    body = "".join(
        "<tr>"
        + "".join(f"<td {s}>{_escape(t)}</td>" for t, s in zip(line, classes))
        + "</tr>"
        for line in zip(*texts)
    )
    return (
        f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _mapping(mapping: Mapping[str, Any]) -> str:
    rows = "".join(
        f'<tr><th class="text">{_escape(key)}</th>'
        f'<td class="text">{_escape(_value(value))}</td></tr>'
        for key, value in _flat(mapping)
    )
    return f'<div class="wide"><table>{rows}</table></div>'


def _flat(mapping: Mapping[str, Any], prefix: str = ""):
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _value(value) -> str:
    if isinstance(value, list):
        return ", ".join(map(_value, value))
    if isinstance(value, float):
        return f"{value:.6g}"
    return "-" if value is None else str(value)


_STYLE = """
:root { color-scheme: light dark; --ink: #222; --soft: #666; --line: #ddd;
  --paper: #fff; --stripe: #f6f6f4; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e6; --soft: #a0a0a0;
  --line: #3a3a3a; --paper: #16181b; --stripe: #1f2226; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink);
  background: var(--paper); max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0;
  font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right;
  border-bottom: 1px solid var(--line); }
th { font-weight: 600; vertical-align: bottom; } small { font-weight: 400;
  color: var(--soft); white-space: nowrap; }
.text { text-align: left; overflow-wrap: anywhere; }
tbody tr:nth-child(even) { background: var(--stripe); }
figure { margin: 2rem 0; break-inside: avoid; }
img { max-width: 100%; background: #fff; border-radius: 6px; padding: 6px;
  box-sizing: border-box; border: 1px solid var(--line); }
figcaption, .note { color: var(--soft); font-size: .92rem; }
figcaption b { color: var(--ink); }
"""

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""
