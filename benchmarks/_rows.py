"""Rows of the table: what was measured, against whom, and whether it is good enough."""

import dataclasses
import math
from typing import Any

import numpy as np


# keys of every row; further ones are allowed
KEYS = (
    "name",
    "value",
    "unit",
    "batch",
    "threads",
    "peer",
    "peer_value",
    "ratio",
    "max_difference",
    "compile_s",
)
# acceptance lines that must hold; others may be missed by a factor of two
STRICT = (1, 4, 6, 7, 8)
ALLOWANCE = 2.0

SYMBOLS = {
    "value": "{limit:g} {unit}",
    "ratio": "ratio {limit:g}",
    "max_difference": "difference {limit:g}",
    "compile_s": "compile {limit:g} s",
}


@dataclasses.dataclass(frozen=True)
class Check:
    """A quantity of the row that must not exceed a limit.

    Attributes:
        quantity: key of the row.
        limit: the largest value that holds.
        line: acceptance condition that asks for it.
    """

    quantity: str
    limit: float
    line: int


def row(
    name: str,
    value: float,
    unit: str,
    *,
    batch: int = 1,
    threads: int = 1,
    peer: str | None = None,
    peer_value: float | None = None,
    max_difference: float | None = None,
    compile_s: float | None = None,
    checks: tuple[Check, ...] = (),
    **extra: Any,
) -> dict[str, Any]:
    """One row as a dictionary that JSON can hold.

    Args:
        name: of the row.
        value: what was measured, in `unit`; a time is that of one evaluation.
        unit: of `value` and `peer_value`.
        batch: evaluations per call.
        threads: that both sides may use.
        peer: what `value` is compared with.
        peer_value: measured in the same process, turn by turn.
        max_difference: largest relative difference of the results.
        compile_s: tracing, lowering and compiling [s].
        checks: what the row must keep.
        extra: `variant`, `note`, `memory_mib` and others.

    Raises:
        ValueError: a check on a quantity that the row does not hold.
    """
    ratio = None if peer_value is None else float(value) / float(peer_value)
    result = {
        "name": name,
        "value": _number(value),
        "unit": unit,
        "batch": int(batch),
        "threads": int(threads),
        "peer": peer,
        "peer_value": _number(peer_value),
        "ratio": _number(ratio),
        "max_difference": _number(max_difference),
        "compile_s": _number(compile_s),
    }
    result |= {key: _plain(value) for key, value in extra.items()}
    judged = [_judge(result, check) for check in checks]
    result["target"] = ", ".join(text for text, _ in judged) or None
    result["holds"] = all(e <= 1 for _, e in judged) if judged else None
    result["checks"] = [
        dataclasses.asdict(check) | {"excess": _number(excess)}
        for check, (_, excess) in zip(checks, judged)
    ]
    return result


def _judge(result: dict, check: Check) -> tuple[str, float]:
    """Text of the target, and the measured value over the limit."""
    if check.quantity not in result:
        raise ValueError(
            f"the check's `quantity` must be a key of the row, but is {check.quantity}"
        )
    measured = result[check.quantity]
    excess = math.inf if measured is None else measured / check.limit
    text = SYMBOLS.get(check.quantity, check.quantity + " {limit:g}")
    text = text.format(limit=check.limit, unit=result["unit"])
    return f"at most {text}", math.inf if math.isnan(excess) else excess


def _number(value) -> float | None:
    return None if value is None else float(value)


def _plain(value):
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return value


def failures(rows: list[dict]) -> list[str]:
    """What fails the run, one line each.

    A check of a strict line that does not hold, and any other that is missed by more
    than a factor of two.
    """
    found = []
    for entry in rows:
        for check in entry["checks"]:
            excess = check["excess"]
            limit = 1.0 if check["line"] in STRICT else ALLOWANCE
            if excess is None or not excess <= limit:
                found.append(
                    f"{label(entry)}: {check['quantity']} must be at most "
                    f"{check['limit']:g} (line {check['line']}), but is "
                    f"{entry[check['quantity']]}"
                )
    return found


def label(entry: dict) -> str:
    """Name of a row with what tells it from its neighbours."""
    parts = [entry.get("variant"), entry["peer"]]
    parts = [str(part) for part in parts if part]
    if entry["batch"] > 1:
        parts.append(f"batch {entry['batch']}")
    parts.append(f"{entry['threads']} thread" + "s" * (entry["threads"] > 1))
    return f"{entry['name']} ({', '.join(parts)})"


def relative_difference(actual, desired) -> float:
    """Largest difference of two sets of samples, over each sample's largest magnitude.

    Args:
        actual, desired: arrays of one shape, samples along the leading axis.
    """
    actual, desired = np.asarray(actual), np.asarray(desired)
    if actual.shape != desired.shape:
        raise ValueError(
            f"`actual` must have the shape {desired.shape}, but has {actual.shape}"
        )
    if actual.size == 0:
        return 0.0
    count = len(actual)
    error = np.abs(actual - desired).reshape(count, -1).max(axis=1)
    scale = np.abs(desired).reshape(count, -1).max(axis=1)
    return float(np.max(error / np.maximum(scale, np.finfo(float).tiny)))
