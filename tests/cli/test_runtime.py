"""How the command line sets up JAX: devices that the process may use, or the user's."""

import os
import subprocess
import sys

import pytest


SCRIPT = """
from elastax.cli._runtime import configure

configure()
import jax

configure()  # JAX may have started
print(len(jax.devices()), jax.numpy.zeros(()).dtype)
"""


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@pytest.mark.parametrize(
    ("setting", "devices"),
    [
        ({}, _cores()),
        ({"JAX_NUM_CPU_DEVICES": "3"}, 3),
        ({"XLA_FLAGS": "--xla_force_host_platform_device_count=3"}, 3),
    ],
    ids=["default", "variable", "flag"],
)
def test_one_device_per_core(setting, devices, tmp_path):
    environment = {
        key: value
        for key, value in os.environ.items()
        if key not in ("JAX_NUM_CPU_DEVICES", "XLA_FLAGS")
    }
    environment |= setting
    environment |= {
        "JAX_PLATFORMS": "cpu",
        "JAX_COMPILATION_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120.0,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split() == [str(devices), "float64"]
