"""Bad input: status 2, one line that says what to change, nothing half-written."""

import pathlib

import numpy as np
import pytest
from elastax.cli import main


PARTS = pathlib.Path(__file__).parents[2] / "examples" / "drive_parts"
EXAMPLE = pathlib.Path(__file__).parents[2] / "examples" / "robot.toml"
UR10E = str(EXAMPLE.with_name("ur10e.urdf"))


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch, tmp_path):
    # the tests' own compilation cache stays in place
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "cache"))


def refuse(capsys, tmp_path, *arguments: str) -> str:
    """Run `elastax feedforward`, which must refuse; the line it says."""
    out = tmp_path / "out"
    status = main(["feedforward", "--quiet", "--out", str(out), *arguments])
    lines = capsys.readouterr().err.strip().splitlines()
    assert status == 2
    assert len(lines) == 1, lines
    assert not out.exists()
    return lines[0]


def edited(tmp_path, old: str, new: str) -> str:
    """Copy of the example file in which `old` is replaced once."""
    text = EXAMPLE.read_text()
    assert old in text
    file = tmp_path / "robot.toml"
    file.write_text(text.replace(old, new, 1))
    return str(file)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robot", "kr2100"), ("kr2100", "kr210", ".toml")),
        (("--robot", "nowhere.toml"), ("nowhere.toml",)),
        (("--robot", "nowhere.urdf"), ("nowhere.urdf", "cannot be read")),
        (("--robot", UR10E), ("ur10e.urdf", "no gears", "ur10e.toml")),
        (("--pose", "lying"), ("lying", "stretched")),
        (("--pose", "0", "0"), ("one angle per axis",)),
        (("--pose", "0", "-150", "0", "0", "0", "0"), ("A2", "-140")),
        (("--move", "0", "170"), ("A2", "limits")),
        (("--move", "0"), ("at least one axis",)),
        (("--move", *"1234567"), ("at most one angle per axis",)),
        (("--filter-order", "3"), ("filter order", "--filter-order 6")),
        (("--cutoff", "-1"), ("--cutoff", "positive")),
        (("--rate", "0"), ("--rate", "positive")),
        (("--perturb", "1.5"), ("--perturb",)),
        (("--grid", "1"), ("--grid",)),
        (("--payload", "150"), ("--payload", "inertia")),
        (("--payload", "150", *"000000"), ("payload", "inertia")),
        (("--payload", "-5", *"000111"), ("mass", "negative")),
        (("--path", "nowhere.csv"), ("--path", "nowhere.csv")),
        (("--recording", "nowhere.mat"), ("nowhere.mat",)),
        (("--identify-on", "a.mat"), ("--recording",)),
        (("--parts", "nowhere.toml"), ("nowhere.toml", "cannot be read")),
        (("--parts", str(PARTS / "exact_friction.toml")), ("--plant-parts",)),
        (
            ("--plant-parts", str(PARTS / "lag.toml"), "--grid", "2"),
            ("--plant-parts", "--grid"),
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_arguments(capsys, tmp_path, arguments, words):
    line = refuse(capsys, tmp_path, *arguments)
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("stiffness = 2.0e5", "stiffness = -2.0e5", ("stiffness", "positive")),
        ("inertia = [0.8, 0.7, 0.9]", "inertia = [-0.8, 0.7, 0.9]", ("moments",)),
        ("motor_inertia = 5e-4", "motor_inertia = 0.0", ("motor_inertia",)),
        ("damping = 400.0", "dampening = 400.0", ("dampening", "damping")),
        ("axis = [1.0, 0.0, 0.0]", "axis = [0.0, 0.0, 1.0]", ("tilt 1 x", "gear")),
        ('name = "example arm"', 'name = "example arm', ("robot.toml",)),
    ],
    ids=["stiffness", "inertia", "rotor", "unknown key", "coaxial", "syntax"],
)
def test_robot_file(capsys, tmp_path, old, new, words):
    line = refuse(capsys, tmp_path, "--robot", edited(tmp_path, old, new))
    for word in words:
        assert word in line


def test_payload_without_inertia_in_a_file(capsys, tmp_path):
    text = EXAMPLE.read_text()
    start = text.index("[payload]")
    lines = [
        line
        for line in text[start:].splitlines()
        if not line.startswith("inertia") or line.startswith("[")
    ]
    file = tmp_path / "robot.toml"
    file.write_text(text[:start] + "\n".join(lines))
    line = refuse(capsys, tmp_path, "--robot", str(file))
    assert "inertia" in line


def recording(tmp_path, change) -> str:
    """CSV recording of six axes, bent by `change`."""
    times = np.arange(500) * 0.004
    swing = 0.2 * np.sin(2 * np.pi * times / 2) ** 4
    table = {"time [s]": times}
    for k in range(1, 7):
        table[f"q_ref_{k} [rad]"] = swing.copy()
        table[f"q_motor_{k} [rad]"] = swing.copy()
        table[f"tau_motor_{k} [N m]"] = np.zeros(500)
    change(table)
    file = tmp_path / "recording.csv"
    rows = np.column_stack(list(table.values()))
    np.savetxt(file, rows, delimiter=",", header=",".join(table), comments="")
    return str(file)


def test_recording_with_nan(capsys, tmp_path):
    def spoil(table):
        table["q_motor_2 [rad]"][100] = np.nan

    line = refuse(capsys, tmp_path, "--recording", recording(tmp_path, spoil))
    assert "finite" in line or "nan" in line.lower()


def test_recording_with_a_jump(capsys, tmp_path):
    def spoil(table):
        table["q_motor_3 [rad]"][200:] += 1.0

    line = refuse(capsys, tmp_path, "--recording", recording(tmp_path, spoil))
    assert "jump" in line or "step" in line


def test_wrong_recording_file(capsys, tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("a,b\n1,2\n3,4\n")
    line = refuse(capsys, tmp_path, "--recording", str(file))
    assert "table.csv" in line


@pytest.mark.slow
def test_unreachable_path(capsys, tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("5.0, 0.0, 1.0\n")
    line = refuse(capsys, tmp_path, "--pose", "cannon", "--path", str(file))
    assert "out of reach" in line


def test_unwritable_folder(capsys, tmp_path):
    file = tmp_path / "taken"
    file.write_text("")
    status = main(["feedforward", "--quiet", "--out", str(file)])
    assert status == 2
    assert "folder" in capsys.readouterr().err
