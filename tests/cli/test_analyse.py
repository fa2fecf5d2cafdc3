"""`elastax analyse`: a small robot, its results, bad input; the KR210's map."""

import json
import pathlib

import jax
import numpy as np
import pytest
from elastax.analysis import LinearModel
from elastax.cli import main
from elastax.cli._analyse import figures_of, zeros_text


EXAMPLE = pathlib.Path(__file__).parents[2] / "examples" / "robot.toml"


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch):
    # the tests' own compilation cache stays in place
    monkeypatch.setenv(
        "JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir)
    )


def run(tmp_path, *words):
    return main(["analyse", "--quiet", "--out", str(tmp_path / "out"), *words])


@pytest.mark.slow
def test_small_robot_with_map(tmp_path, capsys):
    words = ["--robot", str(EXAMPLE), "--pose", "-37", "42", "5", "--grid", "5"]
    assert run(tmp_path, *words, "--sensitivity") == 0
    printed = capsys.readouterr().out
    assert "mode [Hz]" in printed and "zero, real [1/s]" in printed
    assert "25 poses" in printed and "% per %" in printed
    folder = tmp_path / "out"
    result = json.loads((folder / "result.json").read_text())
    assert result["schema"] == "elastax.analyse/1"
    assert result["infinite_zeros"] == [3, 3, 3]
    assert len(result["zeros"]["real"]) == 9
    slopes = {row["name"]: row for row in result["sensitivity"]}
    assert np.isfinite(slopes["payload.mass[payload]"]["zero"])
    grid = result["grid"]
    assert grid["poses"] == 25
    assert grid["with_right_zeros"] + grid["masked"] <= 25
    for name in ("poles_and_zeros", "frequency_response", "zero_map", "frequency_map"):
        assert (folder / f"{name}.png").stat().st_size > 5_000
    arrays = np.load(folder / "arrays.npz")
    assert arrays["A"].shape == (18, 18)
    assert arrays["grid_frequency"].shape == (25,)
    text = (folder / "report.html").read_text()
    assert "Zeros over the workspace" in text


@pytest.mark.slow
def test_collocated_output_is_stable(tmp_path, capsys):
    words = ["--robot", str(EXAMPLE), "--output", "motor", "--axes", "2"]
    assert run(tmp_path, *words) == 0
    assert "the exact inverse is stable" in capsys.readouterr().out


@pytest.mark.slow
def test_more_outputs_than_inputs(tmp_path, capsys):
    words = ["--robot", str(EXAMPLE), "--axes", "1", "2"]
    assert run(tmp_path, *words) == 0
    assert "no inverse: the transfer matrix of 2 inputs and 3 outputs" in (
        capsys.readouterr().out
    )


def test_zeros_on_the_axis_are_not_called_stable():
    """Two masses on an undamped spring, force and place of the first."""
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    A[2:, :2] = [[-1.0, 1.0], [1.0, -1.0]]
    model = LinearModel(A, np.eye(4)[:, 2:3], np.eye(4)[:1])
    result = figures_of(model)
    assert not result["stable_inverse"] and result["right_zeros"] == 0
    assert "2 zeros on the imaginary axis" in zeros_text(model, result)


REFUSALS = [
    (["--axes", "1", "9"], "--axes must be different numbers of 1 to 6"),
    (["--grid", "1"], "--grid must be 2 or more poses"),
    (["--pose", "up"], "--pose must be one of"),
    (["--pose", "0", "90", "0", "0", "0", "0"], "outside its limits"),
    (["--input", "angle", "--output", "motor"], "measures the input itself"),
    (["--robot", "kr999"], "`kr999` is unknown"),
    (["--payload", "10"], "--payload must give 7 numbers"),
]


@pytest.mark.parametrize(("words", "message"), REFUSALS)
def test_bad_input(tmp_path, capsys, words, message):
    assert run(tmp_path, *words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_map_of_the_kr210(tmp_path, capsys):
    """4,096 poses; almost everywhere there is no stable inverse."""
    assert run(tmp_path, "--grid", "64") == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    grid = result["grid"]
    assert grid["poses"] == 4096
    # those in the README, but for poses at the edge of what counts
    assert abs(grid["masked"] - 94) <= 4
    assert abs(grid["with_right_zeros"] - 4002) <= 4
    right = [x for x in result["zeros"]["real"] if x > 1.0]
    # three printed digits
    np.testing.assert_allclose(sorted(right), [46.8, 295.0, 5113.0], rtol=2e-3)
    low, _, high = grid["first_frequency"]
    assert 4.0 < low < high < 10.0
