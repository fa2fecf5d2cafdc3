"""What a batch shares is computed in front of its loop."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import _stages, kernel
from elastax._kernel._stages import depends, stages

from tests.helpers import assert_close
from tests.kernel.comparing import is_kernel, program_of


@pytest.fixture
def eager(monkeypatch):
    """Every shared value counts, however cheap."""
    monkeypatch.setattr(_stages, "_WORTH", 1)
    monkeypatch.setattr(_stages, "_PER_VALUE", 0)


def costly(x):
    """Some hundred operations."""
    y = x
    for k in range(60):
        y = jnp.sin(y) * x[::-1] + 0.1 * k
    return y


def shared(p, x):
    """The first argument alone decides most of it."""
    y = costly(p)
    larger = y > 0.3
    return jnp.where(larger, y * x, x - y) + jnp.sum(x), y, jnp.float64(2.5) * x[0]


P, X = jnp.array([0.2, -0.4, 0.9]), jnp.linspace(-1.0, 1.0, 12).reshape(4, 3)


def graph_of(function, *args):
    return program_of(function, *args).scalars


def test_depths_follow_the_inputs():
    graph, results = graph_of(shared, P, X[0])
    count = lambda nodes: sum(graph.names[n] == "sin" for n in nodes)
    inner = lambda n: graph.operands[n][0] >= 3  # elements of x
    found = stages(graph, results, lambda n: int(inner(n)), 1)
    assert count(n for n, d in found.depth.items() if d == 0) == 180
    assert count(n for n, d in found.depth.items() if d == 1) == 0
    # y is handed in; whether it is larger is no number and found where it is read
    assert len(found.handed[0]) == 3
    assert all(graph.dtypes[n] == "float64" for n in found.handed[0])
    assert not any(graph.names[n] == "sin" for n in depends(graph, results, inner))


def test_what_is_cheap_is_computed_again():
    graph, results = graph_of(lambda p, x: (p * p) * x, P, X[0])
    inner = lambda n: int(graph.operands[n][0] >= 3)
    found = stages(graph, results, inner, 1)
    assert found.handed == [[]]
    assert {found.depth[n] for n in results} == {1}


@pytest.mark.slow
@pytest.mark.parametrize("worth", [1, 100, 10**6])
def test_batches_agree_whatever_is_shared(worth, monkeypatch):
    """Values and derivatives; one axis, two axes that change different arguments."""
    monkeypatch.setattr(_stages, "_WORTH", worth)
    fused = kernel(shared)
    nested = lambda f: jax.vmap(jax.vmap(f, (None, 0)), (0, None))
    crossed = lambda f: jax.vmap(jax.vmap(f, (0, None)), (None, 0))
    ps = jnp.stack([P, 2.0 * P])
    cases = [(jax.vmap, (None, 0), P), (nested, None, ps), (crossed, None, ps)]
    for use, axes, p in cases:
        batched = (lambda f: use(f, axes)) if axes else use
        assert is_kernel(batched(fused), p, X)
        one, other = jax.jit(batched(fused))(p, X), jax.jit(batched(shared))(p, X)
        # 60 sines, each rounded in its own way
        assert_close(one, other, rtol=1e-13, atol=1e-15)
    slopes = lambda f: jax.jit(jax.jacfwd(lambda p, x: f(p, x)[0], (0, 1)))
    for one, other in zip(slopes(fused)(P, X[0]), slopes(shared)(P, X[0])):
        assert_close(one, other, rtol=1e-12, atol=1e-14)


def test_results_that_a_loop_does_not_change(eager):
    """A result without the batched argument, and one that is an argument."""
    function = lambda p, x: (jnp.sum(costly(p)), p, x * 2.0)
    fused = jax.jit(jax.vmap(kernel(function), (None, 0)))
    plain = jax.jit(jax.vmap(function, (None, 0)))
    assert_close(fused(P, X), plain(P, X), rtol=1e-14)


def test_costly_part_stands_in_front():
    """The loop's function holds no sine."""
    fused = jax.vmap(kernel(shared), (None, 0))
    text = jax.jit(fused).lower(P, X).as_text()
    bodies = text.split("func.func private ")
    inner = [b for b in bodies if b.startswith("@elastax_shared_stage_1")]
    outer = [b for b in bodies if b.startswith("@elastax_shared_stage_0")]
    assert len(inner) == len(outer) == 1
    assert "stablehlo.sine" not in inner[0] and "stablehlo.sine" in outer[0]
    assert np.all(np.isfinite(np.asarray(jax.jit(fused)(P, X)[0])))


def test_conditions_read_by_two_stages(eager):
    """A condition that both what is shared and what is not asks for."""

    def function(p, x):
        small = p[0] ** 2 + p[1] ** 2 < 0.5
        rest = jnp.where(small, jnp.sin(p), p)
        return rest, jnp.where(small, x, x * rest)

    for place in (1, 2):
        p = place * P
        fused = jax.jit(jax.vmap(kernel(function), (None, 0)))
        plain = jax.jit(jax.vmap(function, (None, 0)))
        assert_close(fused(p, X), plain(p, X), rtol=1e-14)
