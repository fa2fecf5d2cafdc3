"""The example `examples/calibrate_arm.py` runs and calibrates."""

import importlib.util
import pathlib

import pytest


EXAMPLE = pathlib.Path(__file__).parents[2] / "examples" / "calibrate_arm.py"


@pytest.mark.slow
def test_example(capsys):
    spec = importlib.util.spec_from_file_location("calibrate_arm", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    figures = module.main()
    printed = capsys.readouterr().out
    assert "beta_2" in printed and "condition number" in printed
    assert "others do the same as: " in printed and "tool_z" in printed
    # 0.5 mm and 0.3 mrad in 30 parameters, against 50 um over 30 poses
    assert figures["before, mean [mm]"] > 1.0
    assert figures["after, mean [mm]"] < 0.05
    assert figures["after, maximum [mm]"] < 0.1
