"""The GPU benchmark on the default device, for one case."""

import json

import jax
from benchmarks import gpu


def test_a_case_is_measured_and_written(tmp_path, monkeypatch):
    shrunk = gpu._kinematics("pose", 64)
    monkeypatch.setattr(gpu, "cases", lambda: [("pose", lambda: shrunk)])
    monkeypatch.setattr(gpu, "EFFORT", gpu.Effort(least=1e-3, repeats=1, budget=1.0))
    assert gpu.main(["--out", str(tmp_path)]) == 0
    content = json.loads((tmp_path / "gpu.json").read_text())
    (entry,) = content["rows"]
    assert content["header"]["device"] == jax.devices()[0].device_kind
    assert entry["batch"] == 64 and entry["value"] > 0
    assert entry["max_difference"] <= entry["bound"]
    assert "| pose | 64 |" in (tmp_path / "GPU.md").read_text()


def test_a_difference_fails_the_run(tmp_path, monkeypatch):
    wrong = {"holds": False, "name": "pose", "batch": 1, "value": 1.0, "call_ms": 1.0}
    wrong |= {"max_difference": 1.0, "bound": 0.1, "compile_s": 1.0, "note": ""}
    monkeypatch.setattr(gpu, "cases", lambda: [("pose", lambda: None)])
    monkeypatch.setattr(gpu, "measured", lambda name, case: wrong)
    assert gpu.main(["--out", str(tmp_path)]) == 1
