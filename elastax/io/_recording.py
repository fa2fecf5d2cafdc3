"""Recorded motions from MATLAB and CSV files."""

import csv
import pathlib
import re

import numpy as np
from scipy.io import loadmat

from ..identification import Recording


# The recordings of [Weigand2021] count the angles from their first sample, the pose
# with upright link arm and stretched forearm [rad].
START_POSE = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])

_MAT_FIELDS = (
    "ref_kin.phi_r_all",
    "rec.time_cont",
    "rec.act_pos_mot_deg",
    "rec.act_vel_mot_deg_per_s",
    "rec.act_torque_abs_nm",
)

# column: quantity and whether a file must have it
_COLUMNS = {
    "q_ref": ("angle", True),
    "qd_ref": ("speed", False),
    "qdd_ref": ("rad/s^2", False),
    "qddd_ref": ("rad/s^3", False),
    "qdddd_ref": ("rad/s^4", False),
    "q_motor": ("angle", True),
    "qd_motor": ("speed", False),
    "q_link": ("angle", False),
    "tau_motor": ("N m", True),
    "tau_stored": ("N m", False),
}
_UNITS = {
    "s": {"s": 1.0, "ms": 1e-3},
    "angle": {"rad": 1.0, "deg": np.pi / 180.0},
    "speed": {"rad/s": 1.0, "deg/s": np.pi / 180.0},
    "N m": {"N m": 1.0, "Nm": 1.0},
    "rad/s^2": {"rad/s^2": 1.0},
    "rad/s^3": {"rad/s^3": 1.0},
    "rad/s^4": {"rad/s^4": 1.0},
}
_HEADER = re.compile(r"(?P<name>[a-z_]+?)(_(?P<axis>\d+))? *\[(?P<unit>[^\]]+)\]")


def load_recording(path: str | pathlib.Path, *, start_pose=None) -> Recording:
    """Read a recorded motion.

    A `.mat` file is one of [Weigand2021]: a structure `ref_kin` with `phi_r_all` and
    its derivatives `phi_r_all_d1` to `_d4` [rad/s^k], shape (times, axes), a structure
    `rec` with `time_cont` [s], `act_pos_mot_deg`, `act_vel_mot_deg_per_s`,
    `act_torque_abs_nm` (motor side) and, where there is a link-side encoder,
    `act_pos_se_deg`, shape (axes, times), and `tau_ff_all`, the feed-forward torque
    (motor side, minus its first sample). A row of zeros means that the axis has no
    encoder.

    A `.csv` file has one line of headings `name_axis [unit]`, separated by commas, axes
    counted from 1, and one line per sample:

    - `time [s]`
    - `q_ref_1 [rad]`, `q_ref_2 [rad]`, ...: reference angles; with `qd_ref_1 [rad/s]`,
      `qdd_ref_1 [rad/s^2]`, `qddd_ref_1`, `qdddd_ref_1` their derivatives, if known
    - `q_motor_1 [rad]`: motor angles over the gear ratio; `qd_motor_1 [rad/s]` their
      speed (differences of the angles, if absent)
    - `q_link_1 [rad]`: link-side encoders, of the axes that have one
    - `tau_motor_1 [N m]`: motor torques on the motor side; `tau_stored_1 [N m]` the
      feed-forward torques that were used, if known

    Angles are the maker's; `deg` and `deg/s` are converted.

    Args:
        path: of a `.mat` or `.csv` file.
        start_pose: added to all angles [rad], shape (axes,); the upright pose of the
            KR300's recordings for a `.mat` file, zero for a `.csv` file, unless given.

    Raises:
        ValueError: another kind of file, missing fields or columns (named), values that
            are not finite, times that are not uniform, too few samples, jumps, motors
            that do not follow the reference.
    """
    path = pathlib.Path(path)
    if not path.is_file():
        raise ValueError(f"the recording {path} does not exist")
    readers = {".mat": _read_mat, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise ValueError(f"the recording {path} must be a .mat or a .csv file")
    fields = readers[path.suffix.lower()](path)
    axes = fields["motor_angle"].shape[1]
    if start_pose is None and path.suffix.lower() == ".mat":
        start_pose = START_POSE
    start = np.zeros(axes) if start_pose is None else np.asarray(start_pose, float)
    if start.shape != (axes,):
        raise ValueError(
            f"`start_pose` must have one angle for each of the {axes} axes of "
            f"{path.name}, but has the shape {start.shape}"
        )
    fields["reference"][0] += start
    fields["motor_angle"] = fields["motor_angle"] + start
    fields["link_angle"] = fields["link_angle"] + start[list(fields["encoders"])]
    return Recording(**fields, name=path.name)


def _read_mat(path: pathlib.Path) -> dict:
    try:
        content = loadmat(path, simplify_cells=True)
    except (ValueError, NotImplementedError, TypeError, OSError, EOFError) as error:
        raise ValueError(
            f"the recording {path.name} cannot be read as a MATLAB file of version 5 "
            f"to 7 ({error})"
        ) from None
    missing = [name for name in _MAT_FIELDS if _lookup(content, name) is None]
    if missing:
        raise ValueError(
            f"the recording {path.name} must hold the fields {', '.join(_MAT_FIELDS)}, "
            f"but lacks {', '.join(missing)}"
        )
    times = np.atleast_1d(np.asarray(content["rec"]["time_cont"], float))
    motor = _rows(path, content, "rec.act_pos_mot_deg", times)
    shape = motor.shape
    derivatives = []
    for k in range(5):
        name = "ref_kin.phi_r_all" + (f"_d{k}" if k else "")
        if _lookup(content, name) is None:
            break
        # these are the other way round
        derivatives.append(_rows(path, content, name, times, shape, transpose=False))
    speed = _rows(path, content, "rec.act_vel_mot_deg_per_s", times, shape)
    link = np.zeros((len(times), 0))
    encoders: tuple[int, ...] = ()
    if _lookup(content, "rec.act_pos_se_deg") is not None:
        link = _rows(path, content, "rec.act_pos_se_deg", times, shape)
        encoders = tuple(np.flatnonzero(np.any(link != 0, axis=0)).tolist())
    stored = None
    if _lookup(content, "tau_ff_all") is not None:
        stored = _rows(path, content, "tau_ff_all", times, shape)
    return {
        "times": times,
        "reference": np.stack(derivatives),
        "motor_angle": np.deg2rad(motor),
        "motor_speed": np.deg2rad(speed),
        "motor_torque": _rows(path, content, "rec.act_torque_abs_nm", times, shape),
        "link_angle": np.deg2rad(link[:, list(encoders)]),
        "stored_torque": stored,
        "encoders": encoders,
    }


def _lookup(content: dict, name: str):
    """Field of nested structures, or `None`."""
    value: object = content
    for part in name.split("."):
        if not isinstance(value, dict) or part not in value:
            return None
        value = value[part]
    return value


def _rows(path, content, name, times, shape=None, transpose=True) -> np.ndarray:
    """Array (times, axes) of a field."""
    try:
        array = np.asarray(_lookup(content, name), float)
    except (TypeError, ValueError):
        raise ValueError(f"`{name}` of {path.name} must hold numbers") from None
    array = array.T if transpose and array.ndim == 2 else array
    expected = (len(times), "axes") if shape is None else shape
    if array.ndim != 2 or len(array) != len(times) or (shape and array.shape != shape):
        raise ValueError(
            f"`{name}` of {path.name} must have the shape {expected} "
            f"({'transposed ' if transpose else ''}in the file), but has {array.shape}"
        )
    return array


def _read_csv(path: pathlib.Path) -> dict:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [line for line in csv.reader(file) if line]
    except UnicodeDecodeError:
        raise ValueError(f"the recording {path.name} must be text in UTF-8") from None
    if len(lines) < 2:
        raise ValueError(f"the recording {path.name} must hold headings and samples")
    columns = _parse_headings(path, lines[0])
    values = _parse_samples(path, lines[1:], len(lines[0]))
    axes = _axes(path, columns)
    data = {}
    for (name, axis), (column, factor) in columns.items():
        data[name, axis] = values[:, column] * factor

    def table(name):
        return np.stack([data[name, axis] for axis in range(1, axes + 1)], axis=1)

    times = data["time", 0]
    angle = table("q_motor")
    derivatives = []
    for name in ("q_ref", "qd_ref", "qdd_ref", "qddd_ref", "qdddd_ref"):
        if (name, 1) not in data:
            break
        derivatives.append(table(name))
    encoders = [k for k in range(axes) if ("q_link", k + 1) in data]
    link = [data["q_link", k + 1] for k in encoders]
    with np.errstate(divide="ignore", invalid="ignore"):  # bad times are refused later
        slope = (
            np.gradient(angle, times, axis=0) if len(times) > 1 else np.zeros((1, axes))
        )
    return {
        "times": times,
        "reference": np.stack(derivatives),
        "motor_angle": angle,
        "motor_speed": table("qd_motor") if ("qd_motor", 1) in data else slope,
        "motor_torque": table("tau_motor"),
        "link_angle": np.stack(link, axis=1) if link else np.zeros((len(times), 0)),
        "stored_torque": table("tau_stored") if ("tau_stored", 1) in data else None,
        "encoders": tuple(encoders),
    }


def _parse_headings(path: pathlib.Path, headings: list[str]) -> dict:
    """Column number and unit factor by name and axis; the time has axis 0."""
    columns = {}
    for number, text in enumerate(headings):
        match = _HEADER.fullmatch(text.strip())
        name = match["name"] if match else text.strip()
        known = name == "time" or name in _COLUMNS
        if not match or not known or (name == "time") != (match["axis"] is None):
            raise ValueError(
                f"heading `{text.strip()}` of {path.name} must be `time [s]` or one of "
                f"{', '.join(_COLUMNS)} with axis and unit, such as `q_ref_1 [rad]`"
            )
        quantity = "s" if name == "time" else _COLUMNS[name][0]
        units = _UNITS[quantity]
        if match["unit"].strip() not in units:
            raise ValueError(
                f"the unit of `{text.strip()}` in {path.name} must be one of "
                f"{', '.join(units)}"
            )
        key = (name, int(match["axis"] or 0))
        if key in columns:
            raise ValueError(f"{path.name} must hold `{text.strip()}` only once")
        columns[key] = (number, units[match["unit"].strip()])
    return columns


def _axes(path: pathlib.Path, columns: dict) -> int:
    """Number of axes; every kind of column but `q_link` has all or none."""
    axes = max((axis for name, axis in columns if name != "time"), default=0)
    missing = [] if ("time", 0) in columns else ["time [s]"]
    for name, (_, required) in _COLUMNS.items():
        found = [(name, axis) in columns for axis in range(1, axes + 1)]
        if name == "q_link" or not (required or any(found)):
            continue
        missing += [f"{name}_{k + 1}" for k, there in enumerate(found) if not there]
        missing += [f"{name}_1"] if not found else []
    if missing:
        raise ValueError(
            f"the recording {path.name} lacks the columns {', '.join(missing)}"
        )
    return axes


def _parse_samples(path: pathlib.Path, lines: list[list[str]], width: int):
    for number, line in enumerate(lines):
        if len(line) != width:
            raise ValueError(
                f"line {number + 2} of {path.name} must have {width} values, but has "
                f"{len(line)}"
            )
    try:
        return np.array(lines, float)
    except ValueError as error:
        raise ValueError(
            f"the samples of {path.name} must be numbers: {error}"
        ) from None
