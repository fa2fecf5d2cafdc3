"""Batches over devices: equal to one device, every size, derivatives, simulations."""

import os
import subprocess
import sys
import textwrap

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax import over_devices


PREAMBLE = """
import os

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)
assert len(jax.devices()) == 2

from elastax import over_devices
"""


def run_on_two_devices(text: str, timeout: float = 240.0) -> str:
    """Run a script in a process of its own: the devices are counted only once."""
    environment = dict(os.environ)
    environment.pop("XLA_FLAGS", None)
    environment.pop("JAX_NUM_CPU_DEVICES", None)
    cache = jax.config.jax_compilation_cache_dir
    environment.update(
        JAX_COMPILATION_CACHE_DIR=str(cache),
        JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS="0.1",
        PYTHONPATH=os.pathsep.join(sys.path),
    )
    done = subprocess.run(
        [sys.executable, "-c", PREAMBLE + textwrap.dedent(text)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout


def test_one_device_is_vmap():
    x = jnp.arange(6.0).reshape(2, 3)
    mapped = over_devices(lambda a, x: {"y": a * x}, in_axes=(None, 1))
    result = jax.jit(mapped)(2.0, x)
    np.testing.assert_array_equal(result["y"], 2.0 * x.T)


@pytest.mark.slow
def test_sizes_axes_derivatives_and_nesting():
    run_on_two_devices("""
        def function(parameters, x, y):
            a, (b, c), nothing = parameters
            grow = lambda s: (s[0] + 1, jnp.sin(s[1]) * b + c.sum())
            few = lambda s: s[0] < 3 + x[0]
            _, looped = jax.lax.while_loop(few, grow, (0.0, x.sum() * a))
            slide = lambda s, _: (jnp.sin(s) * b + c.sum(), s)
            last, all = jax.lax.scan(slide, x.sum() * a, None, length=4)
            return {"loop": looped, "all": (all, y @ x), "outer": a * x[:, None] * x}

        def close(actual, desired):
            jax.tree.map(
                lambda a, d: np.testing.assert_allclose(a, d, rtol=1e-13, atol=1e-13),
                actual,
                desired,
            )

        parameters = (jnp.asarray(1.3), (jnp.asarray(0.7), jnp.arange(3.0)), None)
        axes = ((None, None, None), 0, -1)
        alone, split = jax.vmap(function, axes), over_devices(function, axes)

        def smooth(mapped):
            def total(parameters, x, y):
                result = mapped(parameters, x, y)
                return sum(jnp.sum(jnp.cos(v)) for v in result["all"])

            return total

        for number in (1, 2, 7, 8):
            x = jnp.arange(3.0 * number).reshape(number, 3) / 7
            y = jnp.arange(6.0 * number).reshape(2, 3, number)
            result = jax.jit(split)(parameters, x, y)
            close(result, jax.jit(alone)(parameters, x, y))
            if number == 8:
                assert len(result["loop"].sharding.device_set) == 2
            if number == 7:
                close(split(parameters, x, y), result)  # without jit
                # the last sample is computed twice, but counts once
                reverse = lambda m: jax.jit(
                    jax.grad(lambda p, x: smooth(m)((*p, None), x, y), (0, 1))
                )(parameters[:2], x)
                close(reverse(split), reverse(alone))
                forward = lambda m: jax.jit(
                    jax.jacfwd(lambda p: smooth(m)((*p, None), x, y))
                )(parameters[:2])
                close(forward(split), forward(alone))

        # within one another, closed-over values, a chosen device
        grid = jnp.arange(30.0).reshape(5, 2, 3)
        scale = jnp.asarray(2.0)
        for outer in (over_devices, jax.vmap):
            rows = outer(lambda rows: over_devices(lambda x: scale * x @ x)(rows))
            close(jax.jit(rows)(grid), 2.0 * jnp.sum(grid**2, -1))
        close(
            jax.grad(lambda s: over_devices(lambda x: s * x @ x)(grid[0]).sum())(scale),
            jnp.sum(grid[0] ** 2),
        )
        one = over_devices(lambda x: 2 * x, devices=jax.devices()[1:])
        close(jax.jit(one)(grid), 2 * grid)
        """)


@pytest.mark.slow
def test_linear_algebra_does_not_wait_for_ever():
    """Batched LAPACK calls on every device at once would hang in jaxlib 0.10."""
    run_on_two_devices(
        """
        matrices = np.broadcast_to(3.0 * np.eye(14) + 0.1, (1024, 14, 14)).copy()

        def solve(a):
            return jnp.linalg.cholesky(a), jnp.linalg.solve(a, a[0])

        program = jax.jit(over_devices(solve))
        desired = jax.jit(jax.vmap(solve))(matrices)
        for _ in range(200):
            result = jax.block_until_ready(program(matrices))
        for one, other in zip(result, desired):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
        """,
        timeout=480.0,
    )


@pytest.mark.slow
def test_simulations_of_different_robots():
    """A batch of robots: payload and gear stiffness per case, fixed steps."""
    run_on_two_devices("""
        import diffrax
        import equinox as eqx
        from elastax.dynamics import simulate
        from tests import systems

        robot = systems.elastic_2r()
        times = jnp.linspace(0.0, 0.02, 5)
        command = systems.constant_command(times, jnp.array([0.3, -0.5]), jnp.zeros(2))
        scale = lambda robot, f: eqx.tree_at(
            lambda r: (r.payload.mass, r.payload.inertia, r.structure_damping),
            robot,
            replace_fn=lambda x: f * x,
        )
        factors = jnp.linspace(0.5, 2.0, 5)
        robots = jax.vmap(lambda f: scale(robot, f))(factors)

        def case(robot, command):
            result = simulate(
                robot, command, systems.TorqueControl(),
                solver=diffrax.Tsit5(), rtol=1e-7, atol=1e-9, max_steps=4000,
                throw=False,
            )
            return result.q, result.eta, result.tool_pose

        split = jax.jit(over_devices(case, in_axes=(0, None)))(robots, command)
        alone = jax.jit(jax.vmap(case, in_axes=(0, None)))(robots, command)
        for one, other in zip(split, alone):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-10)
        assert np.ptp(np.asarray(split[0])[:, -1], axis=0).min() > 1e-6
        """)


@pytest.mark.parametrize(
    ("in_axes", "sizes"), [((None, None), "none"), ((0, 0), "2, 3")]
)
def test_bad_batches_are_refused(in_axes, sizes):
    two = jax.local_devices() * 2  # refused before the devices matter
    mapped = over_devices(lambda a, b: a, in_axes, devices=two)
    with pytest.raises(ValueError, match=f"but have {sizes}"):
        mapped(jnp.zeros(2), jnp.zeros(3))
