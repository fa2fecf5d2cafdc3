"""Results of a run in a folder: numbers, arrays, figures and a report."""

import importlib.metadata
import json
import math
import os
import pathlib
import platform
import re
import shutil
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ._report import render_report


RESULT, ARRAYS, REPORT = "result.json", "arrays.npz", "report.html"
DPI = 120
FEEDFORWARD = "elastax.feedforward/1"
FIGURES_OF_MERIT = (
    "criterion",
    "path_error_integral",
    "path_error_integral_relative",
    "path_error_max",
    "settling_time",
    "seconds_per_sample",
)
PEAKS = ("peak_motor_torque", "peak_gear_torque")


def versions() -> dict[str, str]:
    """Versions of what computes, and the machine's processor; no name of the host."""
    names = ("elastax", "jax", "jaxlib", "numpy", "diffrax")
    found = {name: importlib.metadata.version(name) for name in names}
    found["python"] = platform.python_version()
    found["platform"] = f"{platform.system()} {platform.machine()}"
    found["processor"] = f"{_processor()}, {os.cpu_count()} cores"
    found["backend"] = f"{jax.default_backend()} ({jax.devices()[0].device_kind})"
    return found


def write_results(
    folder: str | pathlib.Path,
    result: Mapping[str, Any],
    arrays: Mapping[str, Any],
    figures: Sequence[tuple[str, str, str, Any]] = (),
) -> pathlib.Path:
    """Write `result.json`, `arrays.npz`, PNGs and `report.html` into a folder.

    Everything is written beside and moved into place at the end: after an error there
    is no half-written result, and an earlier one is untouched. A new folder appears in
    one step. In an existing folder the files are moved one by one, `result.json` is
    taken away first and comes last, the figures of an earlier result are removed, and
    other files stay.

    In `result.json` a number that is not finite becomes `null`, and "not_finite" lists
    where it stood and what it was. "files" names the files.

    Args:
        folder: where the result goes; made with its parents.
        result: numbers in SI units, text, lists, arrays and mappings with text keys;
            "schema" names the layout.
        arrays: numerical arrays by name.
        figures: name (of the file, without ending), title, caption, and what has
            matplotlib's `savefig`.

    Returns:
        The folder.

    Raises:
        ValueError: a value that JSON or a plain array cannot hold, a key that the
            schema asks for, a name that is no file name, or a folder that is a file.
    """
    folder = pathlib.Path(folder)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"`folder` must be a folder, but {folder} is a file")
    plain, lost = _to_plain(result)
    if not isinstance(plain.get("schema"), str):
        raise ValueError('`result` must name its layout under "schema"')
    names = [name for name, *_ in figures]
    _check_names(names)
    plain["files"] = {
        "arrays": ARRAYS,
        "report": REPORT,
        "figures": [f"{name}.png" for name in names],
    }
    if lost:
        plain["not_finite"] = lost
    if plain["schema"] == FEEDFORWARD:
        check_schema(plain)
    prepared = _prepare_arrays(arrays)
    text = json.dumps(plain, indent=2, allow_nan=False, ensure_ascii=False) + "\n"

    name = f".{uuid.uuid4().hex}.partial"
    existing = folder.is_dir()
    if not existing:
        folder.parent.mkdir(parents=True, exist_ok=True)
    partial = (folder if existing else folder.parent) / name
    partial.mkdir()
    try:
        pictures = []
        for name, title, caption, figure in figures:
            path = partial / f"{name}.png"
            figure.savefig(path, format="png", dpi=DPI)
            pictures.append((name, title, caption, path.read_bytes()))
        _write_arrays(partial / ARRAYS, prepared)
        page = render_report(plain, pictures)
        (partial / REPORT).write_text(page, encoding="utf-8")
        (partial / RESULT).write_text(text, encoding="utf-8")
        if existing:
            _move_into(partial, folder)
        else:
            partial.rename(folder)
    finally:
        if partial.exists():
            shutil.rmtree(partial)
    return folder


def read_result(
    folder: str | pathlib.Path,
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What `write_results` wrote: the result and the arrays.

    Raises:
        ValueError: no complete result in the folder.
    """
    folder = pathlib.Path(folder)
    for name in (RESULT, ARRAYS):
        if not (folder / name).is_file():
            raise ValueError(
                f"`folder` must hold a result, but {folder} has no {name}; write one "
                "with `elastax ... --out`"
            )
    try:
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        with np.load(folder / ARRAYS, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"the result in {folder} cannot be read: {error}") from None
    if not isinstance(result, dict):
        raise ValueError(f"{RESULT} in {folder} must hold a mapping")
    return result, arrays


def check_schema(result: Mapping[str, Any]) -> None:
    """Check the layout `elastax.feedforward/1`.

    Numbers may be `None` where they were not finite; "grid" and "recording" may be
    absent, and "inverses" holds those that ran.

    Raises:
        ValueError: a key is missing, which is named, or holds the wrong kind of value.
    """
    if (schema := _get(result, "schema")) != FEEDFORWARD:
        raise ValueError(f"`schema` must be {FEEDFORWARD!r}, but is {schema!r}")
    _get(result, "robot")
    _get(result, "versions.elastax")
    for key in ("wall_s", "compile_s"):
        _check_number(result, key)
    if not (inverses := _get(result, "inverses")):
        raise ValueError("`inverses` must hold at least one inverse, but is empty")
    for inverse in inverses:
        for key in FIGURES_OF_MERIT:
            _check_number(result, f"inverses.{inverse}.{key}")
        for key in PEAKS:
            _check_numbers(result, f"inverses.{inverse}.{key}")
    if "grid" in result:
        poses, moves = _get(result, "grid.poses"), _get(result, "grid.moves")
        criterion = _get(result, "grid.criterion")
        for name in criterion:
            shape = [len(row) for row in criterion[name]]
            if shape != [len(poses)] * len(moves):
                raise ValueError(
                    f"`grid.criterion.{name}` must hold one list per move with one "
                    f"number per pose ({len(moves)} lists of {len(poses)}), but its "
                    f"lists have the lengths {shape}"
                )
    if "recording" in result:
        axes = len(_get(result, "recording.axes"))
        _check_numbers(result, "recording.skew_s", axes)
        for key in ("r2", "rms", "r2_raw", "stored_r2", "stored_rms"):
            _check_numbers(result, f"recording.torque.{key}", axes)
        for key in ("r2", "rms"):
            _check_numbers(result, f"recording.windup.{key}", axes)


def _get(result, path: str):
    value = result
    for depth, key in enumerate(keys := path.split(".")):
        if not isinstance(value, Mapping) or key not in value:
            missing = ".".join(keys[: depth + 1])
            raise ValueError(f"`{missing}` is missing in the result")
        value = value[key]
    return value


def _is_number(value) -> bool:
    return value is None or (
        isinstance(value, int | float) and not isinstance(value, bool)
    )


def _check_number(result, path: str) -> None:
    value = _get(result, path)
    if not _is_number(value):
        raise ValueError(f"`{path}` must be a number, but is {value!r}")


def _check_numbers(result, path: str, count: int | None = None) -> None:
    value = _get(result, path)
    if not (isinstance(value, list | tuple) and all(map(_is_number, value))):
        raise ValueError(f"`{path}` must be a list of numbers, but is {value!r}")
    if count is not None and len(value) != count:
        raise ValueError(
            f"`{path}` must hold one number per axis ({count}), but holds {len(value)}"
        )


def _to_plain(result: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """What JSON can hold, and where which numbers were not finite."""
    lost: dict[str, str] = {}

    def convert(value: Any, path: str) -> Any:
        if isinstance(value, np.ndarray | np.generic | jax.Array):
            value = np.asarray(value).tolist()
        if value is None or isinstance(value, bool | int | str):
            return value
        if isinstance(value, float):
            if math.isfinite(value):
                return value
            lost[path] = str(value)
            return None
        if isinstance(value, pathlib.PurePath):
            return str(value)
        if isinstance(value, Mapping):
            for key in value:
                if not isinstance(key, str):
                    place = f"`{path}`" if path else "`result`"
                    raise ValueError(
                        f"the keys of {place} must be text, but one is {key!r}"
                    )
            prefix = f"{path}." if path else ""
            return {key: convert(value[key], prefix + key) for key in value}
        if isinstance(value, list | tuple):
            return [convert(item, f"{path}[{k}]") for k, item in enumerate(value)]
        raise ValueError(
            f"`{path}` must hold numbers, text, lists or mappings, but is a "
            f"{type(value).__name__}"
        )

    return convert(result, ""), lost


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            raise ValueError(
                "a figure's name must consist of letters, digits, `_` and `-`, but is "
                f"{name!r}"
            )
        if names.count(name) > 1:
            raise ValueError(f"the names of figures must differ, but {name!r} is twice")


def _prepare_arrays(arrays: Mapping[str, Any]) -> dict[str, np.ndarray]:
    prepared = {}
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind not in "biufcU":
            raise ValueError(
                f"the array `{name}` must hold numbers, but has the type {array.dtype}"
            )
        prepared[name] = array
    return prepared


def _write_arrays(path: pathlib.Path, arrays: Mapping[str, np.ndarray]) -> None:
    """As `numpy.savez`, with any text as a name, and without pickle."""
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)


def _move_into(partial: pathlib.Path, folder: pathlib.Path) -> None:
    """Replace the result in `folder`; without `result.json` there is none."""
    earlier = folder / RESULT
    try:
        old = json.loads(earlier.read_text(encoding="utf-8"))["files"]["figures"]
    except (OSError, ValueError, KeyError, TypeError):
        old = []
    earlier.unlink(missing_ok=True)
    for name in old:
        # only names that `write_results` can have given
        if isinstance(name, str) and re.fullmatch(r"[\w-]+\.png", name):
            (folder / name).unlink(missing_ok=True)
    for path in sorted(partial.iterdir(), key=lambda path: path.name == RESULT):
        path.replace(folder / path.name)
    partial.rmdir()


def _processor() -> str:
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1] for line in lines if line.startswith("model name")]
    return (models[0] if models else platform.processor()).strip() or "unknown"
