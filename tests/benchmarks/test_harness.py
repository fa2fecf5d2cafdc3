"""Timing, growth, uses and the runner."""

import json
import subprocess
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from benchmarks import __main__ as runner
from benchmarks._growth import exponent
from benchmarks._suite import FOLDER, SUITE, Case, description, select
from benchmarks._timing import Effort, compile_timed, measure, peak_memory
from benchmarks._uses import PROGRAMS, USES

from tests import systems
from tests.helpers import assert_close


@pytest.mark.parametrize("power", [0.0, 1.0, 2.5])
def test_exponent_of_a_power(power):
    sizes = np.array([3.0, 10.0, 40.0])
    # rounding
    np.testing.assert_allclose(exponent(sizes, 7e-6 * sizes**power), power, atol=1e-12)


def test_exponent_refuses():
    with pytest.raises(ValueError, match="same number"):
        exponent([1.0], [2.0])
    with pytest.raises(ValueError, match="positive"):
        exponent([1.0, 2.0], [1.0, 0.0])


def test_measure_finds_the_time_of_a_call():
    effort = Effort(least=0.0, repeats=3, budget=10.0)
    short, long = measure(effort, lambda: None, lambda: time.sleep(0.01))
    assert short.repeats == long.repeats == 3
    assert short.best <= short.median < 0.01 <= long.best <= long.median


def test_measure_keeps_its_budget():
    effort = Effort(least=0.0, repeats=100, budget=0.0)
    (found,) = measure(effort, lambda: time.sleep(0.001))
    assert found.repeats == 1


def test_compiled_program_and_its_memory():
    program = compile_timed(lambda x: 2.0 * x, jnp.ones((2**17,)))
    assert_close(program.call(jnp.ones((2**17,))), np.full(2**17, 2.0), rtol=0)
    assert program.seconds > 0 and program.program_mib >= 1.0
    assert peak_memory() > 1.0


def test_uses_agree():
    """Value and derivatives of a function of the mass and of two states."""
    robot = systems.two_mass_oscillator(load=2.0, rotor=1.0, stiffness=1e3, damping=2.0)

    def function(robot, x, y):
        return jnp.sum(robot.drives.stiffness.linear) * x[None] * y[:, None], x

    generator = np.random.default_rng(0)
    states = [jnp.asarray(generator.standard_normal((5, n))) for n in (1, 2)]
    results = {
        use: jax.device_get(jax.jit(PROGRAMS[use](function))(robot, *states))
        for use in USES
        if use != "single"
    }
    x, y = (np.asarray(s) for s in states)
    value = 1e3 * x[:, None] * y[:, :, None]
    for use in ("scan", "vmap"):  # rounding
        assert_close(results[use], (value, x), rtol=1e-15)
    # relative change of 0.1 of three factors  # rounding
    assert_close(results["jvp"], (0.3 * value, 0.1 * x), rtol=1e-14)
    (by_x, by_y), (one, zero) = results["jacfwd"]  # rounding
    assert_close(by_x[..., 0], value / x[:, None], rtol=1e-14)  # rounding
    assert_close(by_y[:, 0, 0, 0], 1e3 * x[:, 0], rtol=1e-14)
    assert_close((one, zero), (np.ones((5, 1, 1)), np.zeros((5, 1, 2))), rtol=0)
    pulled, pulled_x, _ = results["vjp"]
    by_stiffness = np.sum(x * y)[None]  # rounding
    assert_close(pulled.drives.stiffness.linear, by_stiffness, rtol=1e-14)  # rounding
    assert_close(pulled_x, 1e3 * y.sum(axis=1, keepdims=True) + 1.0, rtol=1e-14)


def test_every_benchmark_asks_a_question():
    for name, cases in SUITE.items():
        question, how = description(name)
        assert question.endswith("?") and how
        assert len({case.name for case in cases}) == len(cases) > 0


def test_unknown_benchmark_is_bad_input(capsys):
    with pytest.raises(ValueError, match="must be one of"):
        select(["nothing"])
    assert runner.main(["nothing"]) == 2
    assert "nothing" in capsys.readouterr().err


def test_importing_needs_no_peer():
    """The runner starts where no peer is installed."""
    code = (
        "import sys\n"
        "sys.modules.update(dict.fromkeys(['pinocchio', 'mujoco']))\n"
        "import benchmarks.__main__\n"
        "assert 'jax' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=FOLDER.parent, check=True)


def test_environment_of_a_case(monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "somewhere")
    monkeypatch.setenv("XLA_FLAGS", "--some")
    found = runner.environment(Case("a", threads=1))
    assert "JAX_COMPILATION_CACHE_DIR" not in found
    assert found["OMP_NUM_THREADS"] == "1" and found["XLA_FLAGS"] == "--some"
    found = runner.environment(Case("a", devices=2))
    assert found["XLA_FLAGS"].endswith("device_count=2")


def test_crash_keeps_the_rows_and_fails_the_run(tmp_path, monkeypatch):
    def crash(name, case, file, quick):
        entry = {"name": "a", "value": float("inf"), "unit": "us", "holds": None}
        empty = ("peer", "peer_value", "ratio", "max_difference", "compile_s", "target")
        entry |= dict.fromkeys(empty) | {"batch": 1, "threads": 1, "checks": []}
        file.write_text(json.dumps(entry) + "\n")
        return "status 1: gone" if case.name == "one" else None

    monkeypatch.setattr(runner, "run_case", crash)
    assert runner.main(["simulation", "--out", str(tmp_path)]) == 1
    rows = json.loads((tmp_path / "results.json").read_text())
    assert len(rows) == len(SUITE["simulation"])
    # JSON has no infinity
    assert rows[0]["value"] is None and rows[0]["machine"]["cores"] > 0
    assert "simulation, one: status 1: gone" in (tmp_path / "RESULTS.md").read_text()
    # kept beside the rows of another benchmark
    assert runner.main(["main_job", "--keep", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "results.json").read_text())
    assert [r["benchmark"] for r in rows] == ["simulation"] * 3 + ["main_job"]
