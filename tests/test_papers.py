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
