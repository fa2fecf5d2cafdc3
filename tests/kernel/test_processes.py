"""Kernels on several devices, switched off, and in the compilation cache."""

import os
import re
import subprocess
import sys
import textwrap

import jax
import numpy as np
import pytest


PREAMBLE = """
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

from elastax._kernel import kernel

X = jnp.array([0.3, -1.2, 2.5])
M = jnp.array([[2.0, 0.3, -0.1], [0.3, 3.0, 0.2], [-0.1, 0.2, 1.5], [0.4, 0.1, 0.0]])


def plain(a, b):
    return jnp.sin(a) * b + jnp.arange(3.0), a @ b


def sorting(a, b):
    return jnp.sort(a) * b + jnp.arange(3.0), a @ b


def close(actual, desired):
    check = lambda a, d: np.testing.assert_allclose(a, d, rtol=1e-12, atol=1e-13)
    jax.tree.map(check, actual, desired)
"""


def run_script(text: str, **variables: str) -> str:
    """Output of a script in a process of its own."""
    environment = dict(os.environ)
    for name in ("XLA_FLAGS", "JAX_NUM_CPU_DEVICES", "ELASTAX_KERNELS"):
        environment.pop(name, None)
    environment.update(
        JAX_COMPILATION_CACHE_DIR=str(jax.config.jax_compilation_cache_dir),
        JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS="0.1",
        PYTHONPATH=os.pathsep.join(sys.path),
    )
    environment.update(variables)
    done = subprocess.run(
        [sys.executable, "-c", PREAMBLE + textwrap.dedent(text)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=240.0,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout + done.stderr


@pytest.mark.slow
def test_several_devices():
    """Each device computes for itself, or XLA splits: it cannot split a kernel."""
    run_script(
        """
        from elastax import over_devices
        from jax.sharding import Mesh, NamedSharding, PartitionSpec as P

        mesh = Mesh(np.array(jax.devices()), ("i",))
        assert len(jax.devices()) == 2

        def total(mapped):
            return lambda a, b: sum(jnp.sum(jnp.cos(x)) for x in mapped(a, b))

        def results(mapped, a=M, b=X):
            return jax.jit(lambda a, b: (
                mapped(a, b),
                jax.grad(total(mapped), (0, 1))(a, b),
                jax.jvp(mapped, (a, b), (a, b)),
            ))(a, b)

        def sharded(function, check):
            specs = dict(in_specs=(P("i"), P()), out_specs=P("i"))
            rows = jax.vmap(function, (0, None))
            return jax.shard_map(rows, mesh=mesh, check_vma=check, **specs)

        for definition in (plain, sorting):
            expected = results(jax.vmap(definition, (0, None)))
            for outside_first in (False, True):
                function = kernel(definition)
                rows = jax.vmap(function, (0, None))
                if outside_first:
                    close(results(rows), expected)
                close(results(over_devices(function, (0, None))), expected)
                for check in (False, True):
                    close(results(sharded(function, check)), expected)
                close(results(rows), expected)
            for spec in (P("i"), P(None, None)):
                a = jax.device_put(M, NamedSharding(mesh, spec))
                close(results(rows, a), expected)
                close(rows(a, X), expected[0])

        function = kernel(plain)
        text = jax.jit(over_devices(function, (0, None))).lower(M, X).as_text()
        assert "mhlo.fusion" in text
        columns = jax.device_put(X[:2], NamedSharding(mesh, P("i")))
        square = kernel(lambda a: jnp.outer(a, jnp.sin(a)))
        close(jax.jit(square)(columns), jnp.outer(X[:2], jnp.sin(X[:2])))
        close(square(columns), jnp.outer(X[:2], jnp.sin(X[:2])))

        # replicated within, and over one of two axes of the mesh
        same = lambda f: lambda a, b: (a * f(b, b)[0], a[:, 0])
        for check in (False, True):
            specs = dict(in_specs=(P("i"), P()), out_specs=P("i"))
            split = jax.shard_map(same(function), mesh=mesh, check_vma=check, **specs)
            close(results(split), results(same(plain)))
        auto = jax.sharding.AxisType.Auto
        two = jax.make_mesh((1, 2), ("one", "i"), axis_types=(auto, auto))
        part = jax.shard_map(
            jax.vmap(function, (0, None)),
            mesh=two,
            in_specs=(P("one"), P()),
            out_specs=P("one"),
            axis_names={"one"},
            check_vma=False,
        )
        a = jax.device_put(M, NamedSharding(two, P("i")))
        close(jax.jit(part)(a, X), jax.vmap(plain, (0, None))(M, X))
        """,
        XLA_FLAGS="--xla_force_host_platform_device_count=2",
    )


TABLE = """
from elastax.dynamics import forward_dynamics
from tests.systems import elastic_2r, random_state

robot = elastic_2r()
q, eta, theta, qd, etad, thetad, tau, *_ = random_state(robot, 0, 3)
function = lambda *x: jnp.concatenate(forward_dynamics(robot, *x))
rows = jax.jit(jax.vmap(function))
args = q, eta, theta, qd, etad, thetad, tau
print("fused", "fusion" in rows.lower(*args).as_text())
for number in np.ravel(rows(*args)):
    print(f"value {number:.17e}")
"""


def numbers(output: str) -> np.ndarray:
    return np.array([float(x) for x in re.findall("^value (.*)", output, re.MULTILINE)])


@pytest.mark.slow
def test_switched_off():
    on = run_script(TABLE)
    off = run_script(TABLE, ELASTAX_KERNELS="0")
    assert "fused True" in on and "fused False" in off
    assert numbers(on).size > 10
    np.testing.assert_allclose(numbers(on), numbers(off), rtol=1e-9)


def test_kept_in_the_compilation_cache(tmp_path):
    """The program of a kernel is the same text in every process."""
    script = """
    events = []
    jax.monitoring.register_event_listener(lambda name, **_: events.append(name))
    function = kernel(plain)
    rows = jax.jit(lambda m, x: jax.vmap(function, (0, None))(m, x))
    gradient = jax.jit(jax.grad(lambda m, x: sum(map(jnp.sum, rows(m, x)))))
    for value in np.ravel(gradient(M, X)):
        print(f"value {value:.17e}")
    for kind in ("hits", "misses"):
        print(kind, events.count("/jax/compilation_cache/cache_" + kind))
    """
    variables = dict(
        JAX_COMPILATION_CACHE_DIR=str(tmp_path),
        JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS="0",
    )
    cold = run_script(script, **variables)
    warm = run_script(script, **variables)
    assert "misses 0" not in cold and "misses 0" in warm
    assert "hits 0" not in warm
    np.testing.assert_array_equal(numbers(cold), numbers(warm))
