"""The jobs of the command line from end to end."""

import json
import pathlib

import jax
import numpy as np
import pytest
from elastax.cli import main
from elastax.cli._motion import allowed_move
from elastax.io import read_result
from elastax.robots import kr210


EXAMPLE = str(pathlib.Path(__file__).parents[2] / "examples" / "robot.toml")


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch):
    # the tests' own compilation cache stays in place
    monkeypatch.setenv(
        "JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir)
    )


def test_reversed_sign_is_told():
    robot = kr210()
    start = np.array([0.0, 18.0, 0.0, 0.0, 0.0, 0.0])
    move, notes = allowed_move(robot, start, np.array([5.0, 5.0, 5.0, 0.0, 0.0, 0.0]))
    assert move[1] == -5.0
    assert len(notes) == 1 and "A2" in notes[0]


@pytest.mark.slow
def test_file_robot_with_everything(tmp_path, capsys):
    out = tmp_path / "run"
    status = main(
        ["feedforward", "--robot", EXAMPLE, "--pose", "0", "-20", "40"]
        + ["--move", "5", "-5", "5", "--perturb", "0.2", "--rate", "100", "--stream"]
        + ["--out", str(out)]
    )
    printed = capsys.readouterr()
    assert status == 0
    result, arrays = read_result(out)
    assert set(result["inverses"]) == {"rigid", "flexible_joint", "asim"}
    assert set(result["perturbation"]) == {"nominal"} | {
        f"{what} {sign}20%"
        for what in ("stiffness", "damping", "payload")
        for sign in "+-"
    }
    asim, rlfj = (result["inverses"][n] for n in ("asim", "flexible_joint"))
    assert asim["path_error_integral"] < rlfj["path_error_integral"]
    assert asim["step_median_s"] > 0
    assert "streamed" in printed.out and "compiling" in printed.err
    commands = np.loadtxt(out / "commands_asim.csv", delimiter=",", skiprows=1)
    header = (out / "commands_asim.csv").read_text().splitlines()[0].split(",")
    assert header[:2] == ["t [s]", "theta_1 [rad]"] and len(header) == 10
    # every tenth millisecond sample, on the motor side
    ratio = np.array([100.0, 120.0, 80.0])
    expected = arrays["asim_command_theta"][::10] * ratio
    np.testing.assert_allclose(
        commands[:, 1:4], expected[: len(commands)], rtol=1e-10, atol=1e-10
    )
    assert (out / "report.html").is_file()


@pytest.mark.slow
def test_default_job_meets_its_figures(tmp_path):
    out = tmp_path / "demo"
    assert main(["feedforward", "--quiet", "--out", str(out)]) == 0
    inverses = json.loads((out / "result.json").read_text())["inverses"]
    rigid, rlfj, asim = (inverses[n] for n in ("rigid", "flexible_joint", "asim"))
    for figure in ("path_error_integral", "path_error_integral_relative"):
        assert asim[figure] <= 0.15 * rlfj[figure]
    for figure in (
        "path_error_integral",
        "path_error_integral_relative",
        "path_error_max",
        "path_error_max_relative",
        "criterion",
    ):
        assert asim[figure] < rlfj[figure] < rigid[figure]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "part"),
    [("--parts", "stops_and_lag"), ("--plant-parts", "exact_friction")],
)
def test_other_parts_of_the_drive_trains(option, part, tmp_path):
    """An inverse that knows the parts keeps its lead over the flexible-joint one."""
    path = pathlib.Path(__file__).parents[2] / "examples" / "drive_parts"
    arguments = [option, str(path / f"{part}.toml"), "--out", str(tmp_path)]
    assert main(["feedforward", "--inverse", "flexible_joint", "asim", *arguments]) == 0
    result, _ = read_result(tmp_path)
    asim, rlfj = (result["inverses"][n] for n in ("asim", "flexible_joint"))
    ratio = asim["path_error_integral"] / rlfj["path_error_integral"]
    assert ratio < 0.2  # 0.113 without them


@pytest.mark.slow
def test_pose_grid_meets_its_figures(tmp_path):
    out = tmp_path / "grid"
    arguments = ["--inverse", "flexible_joint", "asim", "--out", str(out)]
    assert main(["feedforward", "--quiet", "--grid", "6", *arguments]) == 0
    grid = json.loads((out / "result.json").read_text())["grid"]
    criterion = {name: np.array(c) for name, c in grid["criterion"].items()}
    assert all(c.shape == (2, 36) and np.isfinite(c).all() for c in criterion.values())
    ratio = criterion["asim"] / criterion["flexible_joint"]
    assert np.all(np.median(ratio, axis=1) <= 0.3)
    assert np.all(ratio < 1)


@pytest.mark.slow
def test_recordings_meet_their_figures(tmp_path, data_dir):
    from elastax.identification import evaluate_recording, fit_friction
    from elastax.io import load_recording
    from elastax.robots import kr300

    robot = kr300()
    first, second = (
        load_recording(data_dir / "kuka_kr300" / f"kr300_10s_FF_{run}.mat")
        for run in "AB"
    )
    fit = fit_friction(robot, first)
    for recording, bounds in (
        (first, [0.896, 0.826, 0.735]),
        (second, [0.840, 0.880, 0.828]),
    ):
        summary = evaluate_recording(robot, recording, fit).summary
        assert np.all(np.array(summary["torque"]["r2"]) >= bounds)
        skew = np.array(summary["skew_s"])
        assert np.all((skew > 2.9e-3) & (skew < 3.2e-3))


def test_info(capsys):
    assert main(["info", EXAMPLE, "--quiet"]) == 0
    printed = capsys.readouterr().out
    assert "motors locked" in printed and "tilt 1 x" in printed
