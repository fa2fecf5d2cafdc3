import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.inverse import ASIM
from elastax.kinematics import singular_values, smallest_singular_value
from elastax.robots import kr210
from elastax.signals import Reference

from tests.helpers import assert_close, assert_gradient


def matrices(shape, count=300):
    """Random ones, with graded rows, nearly equal values, equal and empty rows."""
    rng = np.random.default_rng(1)
    found = rng.standard_normal((count, *shape))
    found[:60] *= 10.0 ** rng.uniform(-8, 0, (60, shape[0], 1))
    found[60:120] *= 10.0 ** rng.uniform(-8, 0, (60, 1, shape[1]))
    found[120:150, 0] = found[120:150, -1]
    near = rng.uniform(0.999, 1.001, (50, 1, 1)) * np.eye(*shape)
    found[150:200] = near + 1e-5 * rng.standard_normal((50, *shape))
    found[200:210] = 0.0
    found[210:220, 0] = 0.0
    return jnp.asarray(found)


# kernels up to three rows, loops beyond; even and odd; more rows than columns
SHAPES = [(1, 4), (2, 3), (3, 3), (6, 3), (5, 7), (6, 6)]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_equal_to_lapack(shape):
    found = matrices(shape)
    values = jax.jit(jax.vmap(singular_values))(found)
    desired = np.linalg.svd(np.asarray(found), compute_uv=False)
    # rounding of some ten rotations, relative to the largest value
    error = np.abs(values - desired).max(axis=1)
    assert np.all(error <= 1e-14 * desired[:, 0])


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(3, 3), (6, 3), (5, 6)], ids=str)
def test_gradient(shape):
    # the first is generic: graded and equal ones have no slope to compare with
    matrix = jnp.asarray(np.random.default_rng(5).standard_normal(shape))
    assert_gradient(singular_values, matrix)


@pytest.mark.parametrize("shape", [(3, 3), (5, 6)], ids=str)
def test_gradient_is_finite_everywhere(shape):
    slopes = jax.jit(jax.vmap(jax.jacrev(singular_values)))(matrices(shape))
    assert np.all(np.isfinite(slopes))
    # |dS| <= |dA|, also where a value is zero
    assert np.all(np.linalg.norm(slopes, axis=(-2, -1)) <= 1 + 1e-12)


@pytest.mark.slow
def test_one_at_a_time_equals_the_batch():
    found = matrices((3, 4), 230)
    batch = jax.jit(jax.vmap(singular_values))(found)
    single = jax.jit(singular_values)
    assert_close(jnp.stack([single(m) for m in found]), batch, rtol=1e-15, atol=1e-15)


def test_zero_by_structure():
    matrix = jnp.asarray([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    assert_close(smallest_singular_value(matrix), jnp.asarray(0.0), rtol=0)
    assert_close(smallest_singular_value(matrix, 2), jnp.asarray(1.0), rtol=1e-15)
    with pytest.raises(ValueError, match="from 1 to 3, but is 4"):
        smallest_singular_value(matrix, 4)


def _batched_lapack(program: str) -> bool:
    """Whether a program calls LAPACK on more than one matrix at a time."""
    calls = [line for line in program.splitlines() if "@lapack" in line]
    return any('num_batch_dims = "0"' not in line for line in calls)


@pytest.mark.slow
def test_feedforward_calls_no_lapack_on_batches():
    """Batched LAPACK calls that meet on two cores wait for ever (jaxlib 0.10)."""
    robot, inverse = kr210(), ASIM()
    motion = Reference(1e-3 * np.arange(4), np.zeros((5, 4, robot.axes)))
    run = jax.jit(lambda robot, motion: inverse.feedforward(robot, motion))
    assert not _batched_lapack(run.lower(robot, motion).as_text())
    # the search finds what it looks for
    values = jax.jit(jax.vmap(lambda m: jnp.linalg.svd(m, compute_uv=False)))
    assert _batched_lapack(values.lower(jnp.ones((2, 3, 3))).as_text())
