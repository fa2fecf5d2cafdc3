"""Streaming ahead of time and export: equal to the offline feed-forward."""

import json
import os
import subprocess
import sys
import zipfile

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import MotorSample
from elastax.inverse import (
    ASIM,
    AbstractInverse,
    FlexibleJointInverse,
    PositionCorrection,
    RigidInverse,
    compile_step,
    export_step,
    feedforward_by_steps,
    latency,
)
from elastax.inverse._flat import FlatLayout

from tests import systems
from tests.helpers import assert_close


ELASTIC = ASIM(correction=PositionCorrection(axes=(0, 1)))
INVERSES = [RigidInverse(), FlexibleJointInverse(), ELASTIC]


class Echo(AbstractInverse):
    """Does nothing: what is left is the cost of a call."""

    def order(self, model):
        return 1

    def init(self, model, sample, dt):
        return {"count": jnp.zeros((), jnp.int64), "started": jnp.asarray(False)}

    def step(self, model, state, sample):
        zero = sample[0, :0]
        command = MotorSample(*([sample[0] * model.payload.mass[0]] * 6), zero)
        return command, {"count": state["count"] + 1, "started": state["count"] >= 0}

    def feedforward(self, model, reference):
        raise NotImplementedError


@pytest.fixture(scope="module")
def model():
    return systems.elastic_2r()


@pytest.fixture(scope="module")
def reference():
    return systems.smooth_reference([0.3, -0.9], [0.4, 0.5], 0.1, dt=2e-3)


@pytest.fixture(scope="module")
def samples(reference):
    return np.swapaxes(np.asarray(reference.derivatives), 0, 1)


def stream(streamed, samples):
    """Outputs over a motion, stacked."""
    streamed.init(samples[0])
    outputs = [streamed(sample) for sample in samples]
    return jax.tree.map(lambda *rows: np.stack(rows), *outputs)


@pytest.mark.slow
@pytest.mark.parametrize("inverse", INVERSES, ids=lambda i: type(i).__name__)
def test_equals_steps_offline(inverse, model, reference, samples):
    offline = eqx.filter_jit(feedforward_by_steps)(inverse, model, reference)
    streamed = compile_step(inverse, model, reference.dt)
    for _ in range(2):  # `init` starts again
        outputs = stream(streamed, samples)
        for name in ("theta", "thetad", "thetadd", "tau_m", "tau_a", "q", "eta"):
            desired = getattr(offline, name)
            scale = float(jnp.max(jnp.abs(desired), initial=0.0))
            # two programs of one function: rounding, seen through the Newton steps
            assert_close(
                getattr(outputs, name), desired, rtol=0.0, atol=1e-11 * scale + 1e-14
            )
    assert isinstance(outputs.theta, np.ndarray)


def test_parameters_change_without_compiling(model, reference, samples):
    inverse, dt = FlexibleJointInverse(), reference.dt
    heavy = model.with_payload(60.0, np.zeros(3), 0.2 * np.eye(3))
    streamed, other = (compile_step(inverse, m, dt) for m in (model, heavy))
    light = stream(streamed, samples).tau_m
    streamed.update(inverse, heavy)
    changed = stream(streamed, samples).tau_m
    assert np.min(np.max(np.abs(changed - light), axis=0)) > 10.0
    np.testing.assert_array_equal(changed, stream(other, samples).tau_m)
    # in the middle of a motion the state stays
    streamed.update(inverse, model)
    streamed.init(samples[0])
    for sample in samples[:20]:
        streamed(sample)
    streamed.update(inverse, heavy)
    now = streamed(samples[20]).tau_a
    np.testing.assert_allclose(now, stream(other, samples).tau_a[20], rtol=1e-12)


def test_refusals(model, samples):
    streamed = compile_step(Echo(), model, 1e-3)
    with pytest.raises(ValueError, match="call `init`"):
        streamed(samples[0])
    with pytest.raises(ValueError, match=r"shape \(2, 2\), .* but has \(5, 1\)"):
        streamed.init(samples[0, :, :1])
    with pytest.raises(ValueError, match="structure that was compiled"):
        streamed.update(Echo(), model.rigid())
    with pytest.raises(ValueError, match="structure that was compiled"):
        streamed.update(FlexibleJointInverse(), model)


def test_any_state_and_input(model, samples):
    """Integers and booleans in the state; lists and JAX arrays as samples."""
    streamed = compile_step(Echo(), model, 1e-3)
    outputs = stream(streamed, samples)
    np.testing.assert_array_equal(outputs.theta, 6.0 * samples[:, 0])
    for same in (samples[3].tolist(), jnp.asarray(samples[3])):
        np.testing.assert_array_equal(streamed(same).q, 6.0 * samples[3, 0])


def test_latency(model, samples):
    times = latency(compile_step(Echo(), model, 1e-3), samples, calls=200)
    assert times.calls == 200
    assert 0.0 < times.p50 <= times.p99 <= times.p999 <= times.largest


def test_flat_layout():
    tree = {
        "b": (jnp.arange(6.0).reshape(2, 3), None),
        "a": jnp.asarray(3),
        "c": [jnp.asarray(True), jnp.zeros((0, 2))],
    }
    layout = FlatLayout.of(tree)
    assert layout.size == 8
    assert layout.names == ("a", "b.0", "c.0", "c.1")
    assert_close(jax.jit(layout.pack)(tree), layout.numbers(tree), rtol=0.0)
    back = jax.jit(layout.unpack)(layout.pack(tree))
    assert_close(back, tree, rtol=0.0)
    assert back["a"].dtype == tree["a"].dtype and back["c"][0].dtype == bool
    assert layout.table()[1] == {"name": "b.0", "start": 1, "shape": [2, 3]}
    assert layout.fits(tree) and not layout.fits(tree["b"])
    assert FlatLayout.of(None).numbers(None).shape == (0,)
    with pytest.raises(ValueError, match="`z` must be real"):
        FlatLayout.of({"z": jnp.asarray(1j)})


READER = """
import sys

for package in ("elastax", "equinox", "jaxtyping", "diffrax", "lineax"):
    sys.modules[package] = None  # importing it fails
import json, zipfile, jax, numpy as np
from jax import export

jax.config.update("jax_enable_x64", True)
file, motion, result = sys.argv[1:]
samples = np.load(motion)
with zipfile.ZipFile(file) as archive:
    layout = json.loads(archive.read("layout.json"))
    read = lambda name: export.deserialize(bytearray(archive.read(name)))
    init, step = (jax.jit(read(f"{n}.bin").call) for n in ("init", "step"))
parameters = np.array(layout["parameters"]["values"])
state = init(parameters, samples[0], layout["dt"])
motors = {entry["name"]: [] for entry in layout["output"]["entries"]}
for sample in samples:
    output, state = step(parameters, state, sample)
    for entry in layout["output"]["entries"]:
        size = np.prod(entry["shape"], dtype=int)
        part = output[entry["start"] : entry["start"] + size]
        motors[entry["name"]].append(np.reshape(part, entry["shape"]))
np.savez(result, **motors)
"""


@pytest.mark.parametrize(
    "inverse",
    [FlexibleJointInverse(), pytest.param(ELASTIC, marks=pytest.mark.slow)],
    ids=lambda i: type(i).__name__,
)
def test_export_runs_without_the_package(inverse, model, reference, samples, tmp_path):
    pytest.importorskip("flatbuffers")
    dt = float(reference.dt)
    archive = export_step(inverse, model, dt)
    file, motion, result = (tmp_path / n for n in ("s.zip", "motion.npy", "out.npz"))
    file.write_bytes(archive)
    np.save(motion, samples[:, : inverse.order(model) + 1])
    script = tmp_path / "reader.py"
    script.write_text(READER)
    cache = jax.config.jax_compilation_cache_dir
    done = subprocess.run(
        [sys.executable, "-I", str(script), str(file), str(motion), str(result)],
        capture_output=True,
        text=True,
        timeout=240.0,
        env=dict(os.environ, JAX_COMPILATION_CACHE_DIR=str(cache)),
    )
    assert done.returncode == 0, done.stderr[-3000:]
    desired = stream(compile_step(inverse, model, dt), samples)
    with np.load(result) as motors:
        for name in motors.files:
            expected = getattr(desired, name)
            scale = np.max(np.abs(expected), initial=0.0)
            np.testing.assert_allclose(
                motors[name], expected, rtol=0.0, atol=1e-12 * scale
            )
    with zipfile.ZipFile(file) as content:
        assert set(content.namelist()) == {"init.bin", "step.bin", "layout.json"}
        layout = json.loads(content.read("layout.json"))
    (mass,) = (
        entry
        for entry in layout["parameters"]["entries"]
        if entry["name"] == "model.payload.mass"
    )
    assert layout["parameters"]["values"][mass["start"]] == 6.0
    assert layout["schema"] == "elastax.step/1" and layout["dt"] == dt
