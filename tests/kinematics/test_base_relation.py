"""The relation of two bases from measured poses: recovery, rank, uncertainty."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    displacement,
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

identify = eqx.filter_jit(identify_base_relation)


def masters(samples=10, turns=(1.0, 1.0, 1.0), seed=0):
    """Poses of the master's tool with turns of these sizes about a common one."""
    rng = np.random.default_rng(seed)
    vectors = rng.uniform(-1, 1, (samples, 6)) * np.array([0.5, 0.5, 0.5, *turns])
    start = transform(
        rotation_from_rpy(jnp.array([0.3, 0.8, -0.4])), jnp.array([1.0, 0.2, 0.9])
    )
    along = jax.jit(jax.vmap(transform_from_twist))(jnp.asarray(vectors))
    return start[None] @ along


def slaves(ahead, key=None, relation=RELATION, grasp=GRASP):
    exact = jax.vmap(lambda a: slave_pose(relation, a, grasp))(ahead)
    if key is None:
        return exact
    off = jax.random.normal(key, (ahead.shape[0], 6)) * NOISE[None]
    return exact @ jax.vmap(transform_from_twist)(off)


def test_exact_data():
    ahead = masters()
    found = identify(ahead, slaves(ahead))
    assert_close(found.relation, RELATION, rtol=0.0, atol=1e-13)
    assert_close(found.grasp, GRASP, rtol=0.0, atol=1e-13)
    assert int(found.rank) == 12 and bool(found.converged)
    assert_close(found.residuals, jnp.zeros((10, 6)), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_any_orientation_is_found(seed):
    """Of bases and grasps far away from all 24 starts."""
    rng = np.random.default_rng(seed)
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2)]
    both = [
        transform(jnp.asarray(r * np.linalg.det(r)), jnp.asarray(rng.uniform(-2, 2, 3)))
        for r in turns
    ]
    ahead = masters(seed=seed)
    found = identify(ahead, slaves(ahead, None, *both))
    assert_close((found.relation, found.grasp), tuple(both), rtol=0.0, atol=1e-12)


def test_known_grasp_needs_one_pose():
    ahead = masters(samples=1)
    found = identify(ahead, slaves(ahead), grasp=GRASP)
    assert_close(found.relation, RELATION, rtol=0.0, atol=1e-14)
    assert int(found.rank) == 6
    assert_close(found.grasp, GRASP, rtol=0.0)


DEGENERATE = [
    ("one axis", masters(turns=(0.0, 0.0, 1.0)), "11 of the 12|only 11"),
    ("translations only", masters(turns=(0.0, 0.0, 0.0)), "only 9"),
    ("two poses", masters(samples=2), "only (10|11)"),
    ("one pose", masters(samples=1), "only 6"),
]


@pytest.mark.parametrize(
    ("ahead", "message"), [d[1:] for d in DEGENERATE], ids=[d[0] for d in DEGENERATE]
)
def test_refuses_what_is_not_determined(ahead, message):
    with pytest.raises(eqx.EquinoxRuntimeError, match=message):
        identify(ahead, slaves(ahead))
    quiet = identify(ahead, slaves(ahead), throw=False)
    assert int(quiet.rank) < 12
    assert np.all(np.isfinite(quiet.relation)) and np.all(np.isfinite(quiet.covariance))
    # with the grasp given the same poses are enough
    known = identify(ahead, slaves(ahead), grasp=GRASP)
    assert_close(known.relation, RELATION, rtol=0.0, atol=1e-13)


def test_pure_turns_about_one_axis():
    """Neither the turn about the axis nor the shift along it is determined."""
    angles = jnp.linspace(0.0, 2.0, 8)
    twists = jnp.zeros((8, 6)).at[:, 5].set(angles)
    ahead = jax.vmap(transform_from_twist)(twists)
    with pytest.raises(eqx.EquinoxRuntimeError, match="determine only 10"):
        identify(ahead, slaves(ahead))


@pytest.fixture(scope="module")
def noisy():
    """Results of 200 sets of 15 noisy pairs."""
    ahead = masters(samples=15)
    keys = jax.random.split(jax.random.key(1), 200)
    length = 0.5  # [m], position noise over that of the angles
    one = functools.partial(
        identify_base_relation, characteristic_length=length, throw=False
    )
    return jax.jit(jax.vmap(lambda key: one(ahead, slaves(ahead, key))))(keys)


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
    # F-distributed: 12 times 78 / 76 on average, with a spread of about 5.5
    assert_close(square.mean(), 12.3, rtol=0.0, atol=1.5)


def test_more_poses_are_better(noisy):
    ahead = masters(samples=60)
    length = 0.5
    found = identify(
        ahead, slaves(ahead, jax.random.key(2)), characteristic_length=length
    )
    errors = displacement(RELATION, found.relation)
    few = jnp.sqrt(jnp.mean(jnp.diagonal(noisy.covariance, axis1=1, axis2=2), axis=0))
    many = jnp.sqrt(jnp.diag(found.covariance))
    assert_close(many[:6] / few[:6], np.full(6, 0.5), rtol=0.0, atol=0.2)
    assert np.all(np.abs(errors) < 5 * float(jnp.max(many)))


def test_derivative_by_the_measurements():
    """A displacement of all slave poses by their base moves the relation with them."""
    ahead = masters(samples=5)
    behind = slaves(ahead)

    def moved(twist):
        shifted = transform_from_twist(twist)[None] @ behind
        found = identify_base_relation(ahead, shifted)
        return twist_from_transform(found.relation @ inverse_transform(RELATION))

    zero = jnp.zeros(6)
    slopes = jax.jit(jax.jacfwd(moved))(zero)
    assert_close(slopes, jnp.eye(6), rtol=0.0, atol=1e-11)
    reverse = jax.jit(jax.grad(lambda t: moved(t)[4]))(zero)
    assert_close(reverse, jnp.eye(6)[4], rtol=0.0, atol=1e-11)


def test_refuses_bad_samples():
    ahead = masters(samples=4)
    behind = slaves(ahead)
    with pytest.raises(ValueError, match="must hold poses in pairs"):
        identify_base_relation(ahead, behind[:3])
    with pytest.raises(ValueError, match=r"`slaves\[2\]`: `rotation` must be orthog"):
        identify_base_relation(ahead, behind.at[2, 0, 0].add(0.01))
    with pytest.raises(ValueError, match="`masters` must be finite"):
        identify_base_relation(ahead.at[1].set(jnp.nan), behind)
