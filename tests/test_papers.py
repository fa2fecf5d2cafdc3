"""The scripts under `papers/` run and give the order of the texts."""

import importlib.util
import pathlib

import pytest


PAPERS = pathlib.Path(__file__).parents[1] / "papers"


def load(path: str):
    spec = importlib.util.spec_from_file_location("script", PAPERS / path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_table_6_1(capsys):
    ours = load("Reiner2010/table_6_1.py").main()
    printed = capsys.readouterr().out
    for what in ("integral", "largest"):
        assert ours[f"{what} asim"] < ours[f"{what} rlfj"] < 1
    assert "0.5744" in printed and "difference" in printed


@pytest.mark.slow
def test_figure_2_3(tmp_path, capsys):
    script = load("Reiner2010/figure_2_3.py")
    ours = script.main(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    printed = capsys.readouterr().out
    assert "difference" in printed and "p4" in printed
    for name, reference in script.REFERENCE.items():
        # Algebra: the coefficients cancel a digit or two.
        assert abs(ours[name] - reference) < 1e-13
    assert ours["least slope of the cubic"] > 0.2
    for place in ("the step speed", "1 rad/s"):
        assert ours[f"jump of the slope at {place}"] < 1e-9
