"""Files of drive-train parts: which laws act in the gears of a robot."""

import dataclasses
import difflib
import pathlib
from typing import Any

import numpy as np

from .. import drivetrain
from ..drivetrain import DriveTrain
from ._toml import load_toml


_FRICTION: dict[str, type] = {
    "asymmetric": drivetrain.AsymmetricFriction,
    "breakaway": drivetrain.BreakawayFriction,
    "coulomb_viscous": drivetrain.CoulombViscousFriction,
    "piecewise": drivetrain.PiecewiseFriction,
    "stribeck": drivetrain.StribeckFriction,
    "temperature": drivetrain.TemperatureFriction,
    "two_scale": drivetrain.TwoScaleFriction,
}
_STIFFNESS: dict[str, type] = {
    "backlash": drivetrain.BacklashStiffness,
    "cubic": drivetrain.CubicStiffness,
    "exponential": drivetrain.ExponentialStiffness,
    "limited": drivetrain.LimitedStiffness,
    "linear": drivetrain.LinearStiffness,
    "table": drivetrain.TabulatedStiffness,
}
# name in a file -> class, by the part of the drive train that it may stand for
KINDS: dict[str, dict[str, type]] = {
    "motor": {"motor": drivetrain.Motor},
    "motor_friction": _FRICTION | {"exact": drivetrain.StickSlipFriction},
    "joint_friction": _FRICTION,
    "mesh": {
        "efficiency": drivetrain.DirectionalEfficiency,
        "load_friction": drivetrain.LoadFriction,
        "exact": drivetrain.ExactEfficiency,
    },
    "transmission_error": {"fourier": drivetrain.TransmissionError},
    "stiffness": _STIFFNESS | {"exact_backlash": drivetrain.Backlash},
    "branch": {
        "relaxation": drivetrain.RelaxationBranch,
        "stops": drivetrain.StopBranch,
        "hysteresis": drivetrain.HysteresisBranch,
        "exact_hysteresis": drivetrain.ExactHysteresisBranch,
        "exact_stops": drivetrain.ExactStopBranch,
    },
}
# laws that other laws hold
HELD: dict[str, type] = {
    **_FRICTION,
    **_STIFFNESS,
    "constant": drivetrain.ConstantEfficiency,
    "falling": drivetrain.FallingEfficiency,
    "rate_independent": drivetrain.RateIndependentPlay,
    "delayed": drivetrain.DelayedPlay,
    "pade": drivetrain.PadeDelay,
}


def load_drive_parts(path: str | pathlib.Path, drives: DriveTrain) -> DriveTrain:
    """Drive trains with the parts that a TOML file names; the others stay.

    A table per part, by the name of the attribute of `DriveTrain`, with its `kind` and
    the attributes of that law. A number holds for all axes, a list has one entry per
    axis; where a law has several plays, a list has one entry per play, a number or a
    list per axis. All values are those of the output side, but for the motor. A table
    `motor` without `kind` changes what it names. `examples/drive_parts` shows each.

    Args:
        path: of the file.
        drives: of the robot.

    Raises:
        ValueError: in one line, with the file and the key, what must be changed.
    """
    content = load_toml(path)
    try:
        return drives_with_parts(content, drives)
    except ValueError as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def drives_with_parts(content: dict[str, Any], drives: DriveTrain) -> DriveTrain:
    """Drive trains with the parts of a table, see `load_drive_parts`.

    Raises:
        ValueError: an unknown part, kind or key, a wrong length, or a value that a law
            refuses.
    """
    parts = {}
    for name, table in content.items():
        if name == "damping":
            parts[name] = _array(table, 1, drives.number, name)
            continue
        if name not in KINDS:
            raise ValueError(_unknown(name, [*KINDS, "damping"]))
        if not isinstance(table, dict):
            raise ValueError(f"`{name}` must be a table")
        if name == "motor" and "kind" not in table:
            named = {f.name for f in dataclasses.fields(drives.motor)}
            table = {"kind": "motor"} | {
                key: np.asarray(getattr(drives.motor, key)).tolist()
                for key in sorted(named - set(table))
                if getattr(drives.motor, key) is not None
            } | table  # fmt: skip
        parts[name] = _law(table, KINDS[name], drives.number, name)
    return dataclasses.replace(drives, **parts)


def _law(table: dict[str, Any], kinds: dict[str, type], axes: int, where: str):
    if "kind" not in table:
        raise ValueError(f"`{where}.kind` is missing: take one of {', '.join(kinds)}")
    kind = table["kind"]
    if kind not in kinds:
        raise ValueError(f"`{where}.kind`: {_unknown(kind, list(kinds))}")
    law = kinds[kind]
    fields = {f.name: f for f in dataclasses.fields(law)}
    values = {}
    for name, value in table.items():
        if name == "kind":
            continue
        if name not in fields:
            raise ValueError(f"`{where}`: {_unknown(name, list(fields))}")
        place = f"{where}.{name}"
        values[name] = _value(value, fields[name], axes, place)
    for name, field in fields.items():
        needed = field.default is dataclasses.MISSING
        needed &= field.default_factory is dataclasses.MISSING
        if needed and name not in values:
            raise ValueError(f"`{where}.{name}` is missing")
    try:
        return law(**values)
    except ValueError as error:
        raise ValueError(f"`{where}`: {error}") from None


def _value(value: Any, field, axes: int, where: str):
    if isinstance(value, dict):
        return _law(value, HELD, axes, where)
    if field.metadata.get("static", False):
        return value
    shape = getattr(_array_type(field.type), "dim_str", "")
    return _array(value, len(shape.split()), axes, where)


def _array_type(annotation: Any) -> Any:
    """The array of an annotation that may allow `None` as well."""
    options = getattr(annotation, "__args__", (annotation,))
    found = [option for option in options if hasattr(option, "dim_str")]
    return found[0] if found else annotation


def _array(value: Any, dimensions: int, axes: int, where: str) -> np.ndarray:
    if dimensions > 1:
        if not isinstance(value, list) or not value:
            raise ValueError(f"`{where}` must be a list with one entry per play")
        rows = [
            _array(row, dimensions - 1, axes, f"{where}[{k + 1}]")
            for k, row in enumerate(value)
        ]
        return np.stack(rows)
    numbers = value if isinstance(value, list) else [value]
    for entry in numbers:
        if isinstance(entry, bool) or not isinstance(entry, int | float):
            raise ValueError(f"`{where}` must hold numbers, but holds {entry!r}")
    if dimensions == 0:
        if isinstance(value, list):
            raise ValueError(f"`{where}` must be one number")
        return np.asarray(float(value))
    if isinstance(value, list) and len(value) != axes:
        raise ValueError(
            f"`{where}` must be a number or a list of {axes}, one per axis, but has "
            f"{len(value)} entries"
        )
    return np.broadcast_to(np.asarray(numbers, float), (axes,)).copy()


def _unknown(name: Any, known: list[str]) -> str:
    close = difflib.get_close_matches(str(name), known, n=1)
    if close:
        return f"`{name}` is unknown: did you mean `{close[0]}`?"
    return f"`{name}` is unknown: take one of {', '.join(known)}"
