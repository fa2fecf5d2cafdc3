"""Figure 2.6 and table 2.1 as a script."""

import math

import pytest

from tests.test_papers import load


@pytest.mark.slow
def test_figure_2_6(capsys, tmp_path):
    path = tmp_path / "figure.png"
    ours = load("Reiner2010/figure_2_6.py").main(path)
    printed = capsys.readouterr().out
    assert "theirs" in printed and "difference" in printed
    assert path.read_bytes().startswith(b"\x89PNG")
    # the bias on a ramp, -ln(1 - e^(-psi v T)) / psi, behind the other limit at 2 r
    for name, psi, delay in (("P*_1", 50, 0.01), ("P*_2", 25, 0.01), ("P*_3", 25, 0.1)):
        bias = -math.log1p(-math.exp(-psi * delay)) / psi
        assert abs(ours[f"(a) on a ramp, {name}"] - bias) < 2e-6 + 2e-3 * bias
    assert ours["(a) largest, P*_1"] < ours["(a) largest, P*_2"]
    assert ours["(a) largest, ours"] < ours["(a) largest, P*_1"]
    # the dead zone of the printed thresholds, and the exact inverse without it
    assert abs(ours["(b) as printed, exact"] - 0.1) < 1e-12
    assert ours["(b) zero first, exact"] < 1e-13
    # the smooth inverse of the table does better than none, a sharper one much better
    assert ours["(b) zero first, ours, psi = 250"] < 0.02
    assert ours["(b) zero first, P*, psi = 25"] < ours["(b) zero first, none"]
