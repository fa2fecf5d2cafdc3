"""Results of a run: what is written, read back, checked and refused."""

import copy
import json
import pathlib
import socket

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.io import check_schema, read_result, versions, write_results


PNG = b"\x89PNG\r\n\x1a\n"


class Picture:
    """Has the `savefig` of a figure."""

    def __init__(self, data: bytes = PNG):
        self.data = data

    def savefig(self, path, **options):
        """Write the data, or fail as a full disk would."""
        if self.data is None:
            raise OSError("no space left")
        pathlib.Path(path).write_bytes(self.data)


def figures(*names):
    return [(name, f"Title of {name}", "Caption.", Picture()) for name in names]


def result():
    """A complete result of `feedforward`."""
    inverse = {
        "criterion": 0.1,
        "path_error_integral": 1e-3,
        "path_error_integral_relative": 9e-4,
        "path_error_max": 2e-3,
        "peak_motor_torque": [1.0] * 6,
        "peak_gear_torque": [100.0] * 6,
        "settling_time": 0.2,
        "seconds_per_sample": 2e-5,
    }
    return {
        "schema": "elastax.feedforward/1",
        "robot": "kr210",
        "versions": {"elastax": "0"},
        "wall_s": 12.0,
        "compile_s": 8.0,
        "inverses": {
            name: dict(inverse) for name in ("rigid", "flexible_joint", "asim")
        },
        "grid": {
            "poses": [[0.0] * 6] * 3,
            "moves": [[0.1] * 6] * 2,
            "criterion": {"asim": [[1.0] * 3] * 2},
        },
        "recording": {
            "axes": [1, 2, 3],
            "skew_s": [0.003] * 3,
            "torque": {
                key: [0.9] * 3
                for key in ("r2", "rms", "r2_raw", "stored_r2", "stored_rms")
            },
            "windup": {"r2": [0.9] * 3, "rms": [1e-4] * 3},
        },
    }


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_round_trip(tmp_path):
    arrays = {"asim/q": jnp.arange(6.0).reshape(2, 3), "file": np.array([1, 2])}
    folder = tmp_path / "deep" / "run"
    assert write_results(folder, result(), arrays, figures("a", "b-2")) == folder
    expected = ["a.png", "arrays.npz", "b-2.png", "report.html", "result.json"]
    assert names(folder) == expected
    assert names(tmp_path / "deep") == ["run"]
    back, read = read_result(folder)
    assert back["inverses"] == result()["inverses"]
    assert back["files"]["figures"] == ["a.png", "b-2.png"]
    assert set(read) == {"asim/q", "file"}
    np.testing.assert_array_equal(read["asim/q"], np.arange(6.0).reshape(2, 3))
    assert read["file"].dtype == np.array([1, 2]).dtype
    assert "Title of b-2" in (folder / "report.html").read_text(encoding="utf-8")


def test_arrays_and_numbers_become_plain(tmp_path):
    value = {
        "schema": "any/1",
        "array": jnp.array([[1.5, 2.0]]),
        "scalar": np.float64(0.1),
        "count": np.int64(3),
        "yes": np.bool_(True),
        "path": pathlib.Path("a") / "b",
        "tuple": (1, None),
    }
    write_results(tmp_path / "run", value, {})
    back, _ = read_result(tmp_path / "run")
    assert back["array"] == [[1.5, 2.0]]
    assert (back["scalar"], back["count"], back["yes"]) == (0.1, 3, True)
    assert back["path"] == str(pathlib.Path("a") / "b")
    assert back["tuple"] == [1, None]
    assert "not_finite" not in back


def test_numbers_that_are_not_finite_are_named(tmp_path):
    value = result()
    value["inverses"]["rigid"]["criterion"] = float("nan")
    value["grid"]["criterion"]["asim"] = np.array([[1.0, np.inf, 1.0]] * 2)
    write_results(tmp_path / "run", value, {"x": np.array([np.nan])})
    text = (tmp_path / "run" / "result.json").read_text(encoding="utf-8")
    assert "NaN" not in text and "Infinity" not in text
    back, arrays = read_result(tmp_path / "run")
    assert back["inverses"]["rigid"]["criterion"] is None
    assert back["not_finite"] == {
        "inverses.rigid.criterion": "nan",
        "grid.criterion.asim[0][1]": "inf",
        "grid.criterion.asim[1][1]": "inf",
    }
    assert np.isnan(arrays["x"][0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"odd": object()}, "`odd` must hold numbers"),
        ({"odd": {"deep": [1, {2}]}}, r"`odd.deep\[1\]` must hold numbers"),
        ({"odd": {1: 2}}, "keys of `odd` must be text"),
        ({"schema": None}, 'under "schema"'),
    ],
)
def test_refuses_what_json_cannot_hold(tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        write_results(tmp_path / "run", {**result(), **change}, {})
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("arrays", "pictures", "message"),
    [
        ({"x": np.array([object()])}, [], "array `x` must hold numbers"),
        ({}, figures("../a"), "letters, digits"),
        ({}, figures("a", "a"), "'a' is twice"),
    ],
)
def test_refuses_arrays_and_names(tmp_path, arrays, pictures, message):
    with pytest.raises(ValueError, match=message):
        write_results(tmp_path / "run", result(), arrays, pictures)
    assert names(tmp_path) == []


def test_refuses_a_file_as_folder(tmp_path):
    (tmp_path / "run").write_text("mine")
    with pytest.raises(ValueError, match="must be a folder"):
        write_results(tmp_path / "run", result(), {})
    assert (tmp_path / "run").read_text() == "mine"


def test_an_error_leaves_nothing_behind(tmp_path):
    broken = [*figures("good"), ("bad", "Bad", "Caption.", Picture(None))]
    with pytest.raises(OSError, match="no space"):
        write_results(tmp_path / "new", result(), {}, broken)
    assert names(tmp_path) == []
    write_results(tmp_path / "old", result(), {"x": np.ones(2)}, figures("first"))
    before = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    with pytest.raises(OSError, match="no space"):
        write_results(tmp_path / "old", result(), {}, broken)
    after = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    assert after == before


def test_replaces_an_earlier_result_and_keeps_other_files(tmp_path):
    folder = tmp_path / "run"
    write_results(folder, result(), {"x": np.ones(2)}, figures("first", "both"))
    (folder / "notes.txt").write_text("mine")
    (folder / "mine.png").write_bytes(PNG)
    write_results(folder, result(), {"y": np.ones(3)}, figures("both", "second"))
    assert names(folder) == [
        "arrays.npz",
        "both.png",
        "mine.png",
        "notes.txt",
        "report.html",
        "result.json",
        "second.png",
    ]
    assert list(read_result(folder)[1]) == ["y"]


def test_removes_only_figures_of_an_earlier_result(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (tmp_path / "keep.png").write_bytes(PNG)
    (folder / "notes.txt").write_text("mine")
    listed = {"files": {"figures": ["../keep.png", "notes.txt", 3]}}
    (folder / "result.json").write_text(json.dumps(listed))
    write_results(folder, result(), {})
    assert (tmp_path / "keep.png").exists()
    assert (folder / "notes.txt").exists()


def test_reading_refuses_what_is_no_result(tmp_path):
    with pytest.raises(ValueError, match=r"has no result\.json"):
        read_result(tmp_path)
    write_results(tmp_path / "run", result(), {})
    (tmp_path / "run" / "result.json").write_text("{")
    with pytest.raises(ValueError, match="cannot be read"):
        read_result(tmp_path / "run")
    (tmp_path / "run" / "result.json").write_text("[]")
    with pytest.raises(ValueError, match="must hold a mapping"):
        read_result(tmp_path / "run")


def test_reading_never_unpickles(tmp_path):
    write_results(tmp_path / "run", result(), {})
    np.savez(tmp_path / "run" / "arrays.npz", x=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="cannot be read"):
        read_result(tmp_path / "run")


def test_schema_accepts_a_complete_result():
    check_schema(result())
    smaller = result()
    del smaller["grid"], smaller["recording"], smaller["inverses"]["asim"]
    smaller["inverses"]["rigid"]["settling_time"] = None
    check_schema(smaller)


def paths(mapping, prefix=()):
    for key, value in mapping.items():
        if isinstance(value, dict) and key != "criterion":
            yield from paths(value, (*prefix, key))
        else:
            yield (*prefix, key)


@pytest.mark.parametrize(
    "path",
    [path for path in paths(result()) if path[0] not in ("grid", "recording")]
    + [path for path in paths(result()) if path[0] in ("grid", "recording")]
    + [("inverses",), ("recording", "windup")],
    ids=".".join,
)
def test_schema_names_the_missing_key(path):
    value = copy.deepcopy(result())
    inner = value
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    name = ".".join(path)
    with pytest.raises(ValueError, match=f"`{name}` is missing"):
        check_schema(value)


@pytest.mark.parametrize(
    ("path", "wrong", "message"),
    [
        ("schema", "elastax.feedforward/2", "must be 'elastax.feedforward/1'"),
        ("wall_s", "long", "`wall_s` must be a number"),
        ("wall_s", True, "`wall_s` must be a number"),
        ("inverses.asim.peak_gear_torque", 3.0, "must be a list of numbers"),
        ("inverses", {}, "`inverses` must hold at least one inverse"),
        ("grid.criterion.asim", [[1.0]], r"2 lists of 3"),
        ("recording.skew_s", [1.0], r"one number per axis \(3\), but holds 1"),
    ],
)
def test_schema_refuses_other_kinds(path, wrong, message):
    value = result()
    inner = value
    *keys, last = path.split(".")
    for key in keys:
        inner = inner[key]
    inner[last] = wrong
    with pytest.raises(ValueError, match=message):
        check_schema(value)


def test_writing_checks_the_schema(tmp_path):
    value = result()
    del value["inverses"]["asim"]["criterion"]
    with pytest.raises(ValueError, match=r"`inverses\.asim\.criterion` is missing"):
        write_results(tmp_path / "run", value, {})


def test_versions():
    found = versions()
    for name in ("elastax", "jax", "numpy", "diffrax", "python", "processor"):
        assert found[name]
    assert socket.gethostname() not in found.values()
