"""The relation of two bases from measured poses: recovery, rank, uncertainty."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    identify_base_relation,
    inverse_transform,
    rotation_from_rpy,
    slave_pose,
    transform,
    transform_from_twist,
    twist_from_transform,
)

from tests.helpers import assert_close


RELATION = transform(
    rotation_from_rpy(jnp.array([0.1, -0.2, 2.5])), jnp.array([1.8, 0.3, -0.1])
)
GRASP = transform(
    rotation_from_rpy(jnp.array([3.0, 0.1, -0.5])), jnp.array([0.4, 0.0, 0.1])
)
NOISE = jnp.array([5e-5, 5e-5, 5e-5, 1e-4, 1e-4, 1e-4])  # [m], [rad]

SAMPLES = 10  # in all tests, which so share their programs

identify = eqx.filter_jit(identify_base_relation)
quietly = eqx.filter_jit(functools.partial(identify_base_relation, throw=False))


@jax.jit
def follow(twists):
    """Poses of the master's tool, displaced from a common one."""
    rotation = rotation_from_rpy(jnp.array([0.3, 0.8, -0.4]))
    start = transform(rotation, jnp.array([1.0, 0.2, 0.9]))
    return start[None] @ jax.vmap(transform_from_twist)(twists)


def masters(turns=(1.0, 1.0, 1.0), shifts=(0.5, 0.5, 0.5), seed=0, different=SAMPLES):
    """Poses with random displacements up to these sizes, some of them repeated."""
    rng = np.random.default_rng(seed)
    twists = rng.uniform(-1, 1, (different, 6)) * np.array([*shifts, *turns])
    return follow(jnp.asarray(np.tile(twists, (SAMPLES // different, 1))))


@jax.jit
def slaves(ahead, off=None, relation=RELATION, grasp=GRASP):
    """Poses of the slave's tool that belong to them, displaced by errors `off`."""
    exact = jax.vmap(slave_pose, (None, 0, None))(relation, ahead, grasp)
    return exact if off is None else exact @ jax.vmap(transform_from_twist)(off)


@pytest.mark.slow
def test_exact_data():
    ahead = masters()
    found = quietly(ahead, slaves(ahead))
    assert_close(found.relation, RELATION, rtol=0.0, atol=1e-13)
    assert_close(found.grasp, GRASP, rtol=0.0, atol=1e-13)
    assert int(found.rank) == 12 and bool(found.converged)
    assert_close(found.residuals, jnp.zeros((SAMPLES, 6)), rtol=0.0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_any_orientation_is_found(seed):
    """Of bases and grasps far away from all 24 starts."""
    rng = np.random.default_rng(seed)
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2)]
    both = [
        transform(jnp.asarray(r * np.linalg.det(r)), jnp.asarray(rng.uniform(-2, 2, 3)))
        for r in turns
    ]
    ahead = masters(seed=seed)
    found = quietly(ahead, slaves(ahead, None, *both))
    assert_close((found.relation, found.grasp), tuple(both), rtol=0.0, atol=1e-12)


# what is left open: of the shifts along the only axis of the turns the difference, and
# if the origin of the tool moves along that axis only, of the turns about it as well;
# of constant orientations the difference of the shifts; of two poses what one screw
# commutes with; of one pose the whole grasp
DEGENERATE = {
    "one axis": (masters((0, 0, 1.0)), 11),
    "one axis, shifts along it": (masters((0, 0, 1.0), (0, 0, 0.5)), 10),
    "shifts only": (masters((0, 0, 0)), 9),
    "two poses": (masters(different=2), 10),
    "one pose": (masters(different=1), 6),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", DEGENERATE)
def test_refuses_what_is_not_determined(case):
    ahead, rank = DEGENERATE[case]
    behind = slaves(ahead)
    with pytest.raises(eqx.EquinoxRuntimeError, match=f"determine only {rank}: "):
        identify(ahead, behind)
    quiet = quietly(ahead, behind)
    assert int(quiet.rank) == rank
    assert np.all(np.isfinite(quiet.relation)) and np.all(np.isfinite(quiet.covariance))
    # with the grasp given the same poses are enough
    known = quietly(ahead, behind, grasp=GRASP)
    assert int(known.rank) == 6
    assert_close(known.relation, RELATION, rtol=0.0, atol=1e-13)
    assert_close(known.grasp, GRASP, rtol=0.0)


@pytest.fixture(scope="module")
def noisy():
    """Results of 200 sets of noisy pairs."""
    ahead = masters()
    off = jax.random.normal(jax.random.key(1), (200, SAMPLES, 6)) * NOISE[None, None]
    length = 0.5  # [m], position noise over that of the angles
    one = functools.partial(
        identify_base_relation, characteristic_length=length, throw=False
    )
    return jax.jit(jax.vmap(lambda off: one(ahead, slaves(ahead, off))))(off)


@pytest.mark.slow
def test_uncertainty_is_that_of_the_results(noisy):
    """Errors in units of the stated standard deviation have the variance one."""
    off = jax.vmap(
        lambda t, m: twist_from_transform(inverse_transform(t) @ m), (None, 0)
    )
    errors = jnp.concatenate(
        [off(RELATION, noisy.relation), off(GRASP, noisy.grasp)], 1
    )
    assert bool(jnp.all(noisy.converged)) and bool(jnp.all(noisy.rank == 12))
    # the true noise has the stated proportion of angles to positions
    spread = jnp.sqrt(
        jnp.mean(jnp.diagonal(noisy.covariance, axis1=1, axis2=2), axis=0)
    )
    ratio = errors.std(axis=0) / spread
    # 200 results know a standard deviation to 5 per cent
    assert_close(ratio, np.ones(12), rtol=0.0, atol=0.2)
    solved = jax.vmap(jnp.linalg.solve)(noisy.covariance, errors)
    square = jnp.sum(errors * solved, axis=1)
    # F-distributed: 12 times 48 / 46 on average, with a spread of about 5.8
    assert_close(square.mean(), 12.5, rtol=0.0, atol=1.5)


@pytest.mark.slow
def test_derivative_by_the_measurements():
    """A displacement of all slave poses by their base moves the relation with them."""
    ahead = masters()
    behind = slaves(ahead)

    def moved(twist):
        shifted = transform_from_twist(twist)[None] @ behind
        found = identify_base_relation(ahead, shifted)
        return twist_from_transform(found.relation @ inverse_transform(RELATION))

    zero = jnp.zeros(6)
    both = jax.jit(lambda t: (jax.jacfwd(moved)(t), jax.jacrev(moved)(t)))
    for slopes in both(zero):
        assert_close(slopes, jnp.eye(6), rtol=0.0, atol=1e-11)


def test_refuses_bad_samples():
    ahead = masters()
    behind = slaves(ahead)
    with pytest.raises(ValueError, match="must hold poses in pairs"):
        identify_base_relation(ahead, behind[:3])
    with pytest.raises(ValueError, match=r"`slaves\[2\]`: `rotation` must be orthog"):
        identify_base_relation(ahead, behind.at[2, 0, 0].add(0.01))
    with pytest.raises(ValueError, match=r"`masters\[1\]`: `pose` must be finite"):
        identify_base_relation(ahead.at[1].set(jnp.nan), behind)
