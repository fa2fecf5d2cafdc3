"""Calibrated arms: three Newton steps from the closed form, on all branches."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    ConstantDamping,
    SerialChain,
    SphericalWrist,
    calibrated_inverse_kinematics,
    forward_kinematics,
    inverse_kinematics,
    jacobian,
    solve_damped,
)
from elastax.robots import fanuc, kr210

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import planar, turned


def as_frames(chain: SerialChain) -> SerialChain:
    """The same chain with all placements as parameters."""
    frames = chain.joints.frames()
    before = frames.before.at[1:].set(frames.after[:-1] @ frames.before[1:])
    return SerialChain.from_frames(
        before[:, :3, :3],
        before[:, :3, 3],
        frames.axis,
        base=chain.base,
        tool=frames.after[-1] @ chain.tool,
    )


def calibrated(chain: SerialChain, seed: int, scale: float = 1.0) -> SerialChain:
    """All parameters off by up to 0.5 mm and 0.1 degrees."""
    parameters = ChainParameters.of(chain)
    size = {"m": 0.5e-3, "rad": np.deg2rad(0.1)}
    sizes = np.array([size[unit] for unit in parameters.units])
    uniform = np.random.default_rng(seed).uniform(-1, 1, sizes.shape)
    return parameters.moved(jnp.asarray(scale * sizes * uniform))


@pytest.fixture(scope="module")
def arms():
    """Nominal and calibrated chains."""
    nominal = {"fanuc": fanuc().chain, "kr210": as_frames(kr210().arm().chain)}
    return {
        name: (SphericalWrist.from_chain(chain), calibrated(chain, 0))
        for name, chain in nominal.items()
    }


@jax.jit
def examine(nominal, chain, q):
    """Solutions at poses of the calibrated chain, and how singular they are."""

    def one(q):
        pose = forward_kinematics(chain, q)
        starts, valid = inverse_kinematics(nominal, pose)
        solution = calibrated_inverse_kinematics(nominal, chain, pose)
        again = jax.vmap(forward_kinematics, (None, 0))(chain, solution.value)
        matrix = jax.vmap(jacobian, (None, 0))(chain, solution.value)
        smallest = jnp.linalg.svd(matrix, compute_uv=False)[:, -1]
        own = jnp.linalg.svd(jacobian(chain, q), compute_uv=False)[-1]
        return starts, valid, solution, again - pose[None], smallest, own

    return jax.vmap(one)(q)


solve = jax.jit(calibrated_inverse_kinematics, static_argnames=("steps", "tolerance"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fanuc", "kr210"])
def test_three_steps_reach_rounding(arms, name):
    nominal, chain = arms[name]
    q = jnp.asarray(np.random.default_rng(1).uniform(-np.pi, np.pi, (1500, 6)))
    starts, valid, solution, difference, smallest, own = examine(nominal, chain, q)
    # a metre per radian stands for arms of this size; a tenth is "away from singular"
    regular = np.asarray(valid & (smallest > 0.1))
    assert np.sum(np.any(regular, axis=1)) >= 1000
    assert np.sum(regular) > 4000
    position, rotation = map(
        np.asarray, (solution.position_error, solution.rotation_error)
    )
    assert np.max(position[regular]) < 1e-12
    assert np.max(rotation[regular]) < 1e-12
    assert np.all(np.asarray(solution.reached)[regular])
    # the same, not by the errors that the function reports
    assert np.max(np.abs(np.asarray(difference)[regular])) < 1e-12
    # the closed form alone is off by millimetres
    change = np.max(np.abs(np.asarray(solution.value - starts)), axis=2)
    assert 1e-3 < np.median(change[regular]) < 2e-2
    # the angles it started from are found
    distance = np.abs(np.asarray(turned(solution.value, q[:, None]) - q[:, None]))
    nearest = np.min(np.max(distance, axis=2), axis=1)
    assert np.max(nearest[np.asarray(own) > 0.1]) < 1e-10


@pytest.mark.slow
def test_near_singular_poses_are_finite_and_marked(arms):
    """Wrist within a degree of aligned, where errors of a tenth of a degree matter."""
    nominal, chain = arms["fanuc"]
    rng = np.random.default_rng(2)
    q = rng.uniform(-1, 1, (300, 6))
    q[:, 4] = np.deg2rad(rng.uniform(-1, 1, 300))
    _, _, solution, difference, _, _ = examine(nominal, chain, jnp.asarray(q))
    reached = np.asarray(solution.reached)
    assert np.all(np.isfinite(solution.value))
    # some rows converge, some need more than three steps: the mask tells which
    assert 0.2 < np.mean(reached) < 1.0
    assert np.max(np.abs(np.asarray(difference)[reached])) < 1e-8


@pytest.mark.slow
def test_no_errors_no_change(arms):
    nominal, _ = arms["fanuc"]
    pose = forward_kinematics(nominal.chain, jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1]))
    starts, valid = inverse_kinematics(nominal, pose)
    solution = solve(nominal, nominal.chain, pose)
    assert np.all(valid) and np.all(solution.reached)
    assert_close(solution.value, starts, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_iterative_solution_agrees(arms):
    nominal, chain = arms["kr210"]
    q = jnp.array([0.3, -1.0, 1.1, 0.5, 0.9, -0.4])
    pose = forward_kinematics(chain, q)
    iterated = solve_damped(chain, pose, q + 0.02, damping=ConstantDamping(1e-3))
    solution = solve(nominal, chain, pose)
    distance = jnp.max(jnp.abs(solution.value - iterated.value[None]), axis=1)
    # tolerance of the iteration over the smallest singular value
    assert float(jnp.min(distance)) < 1e-8


@pytest.mark.slow
def test_error_shrinks_with_every_step(arms):
    nominal, chain = arms["fanuc"]
    pose = forward_kinematics(chain, jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1]))
    errors = [
        float(jnp.max(solve(nominal, chain, pose, steps=k).position_error))
        for k in range(4)
    ]
    assert errors[0] > 1e-3
    for before, after in zip(errors, errors[1:], strict=False):
        assert after < 100 * before**2 + 1e-14


@pytest.mark.slow
def test_derivatives(arms):
    """By the pose, J^-1; by the parameters, central differences."""
    nominal, chain = arms["fanuc"]
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    row = 2

    def roundtrip(x):
        pose = forward_kinematics(chain, x)
        return calibrated_inverse_kinematics(nominal, chain, pose).value[row]

    for derivative in (jax.jacfwd, jax.jacrev):
        # damping of the solver, 1e-13 over the squared smallest singular value
        matrix = jax.jit(derivative(roundtrip))(q)
        assert_close(matrix, jnp.eye(6), rtol=0.0, atol=1e-9)
    joints, pose = chain.joints, forward_kinematics(chain, q)

    def function(lengths, twists, base):
        moved = dataclasses.replace(joints, a=lengths, alpha=twists)
        arm = SerialChain(moved, base, chain.tool, chain.kinds)
        # rounding of four steps decides the difference quotient, not three
        return calibrated_inverse_kinematics(nominal, arm, pose, steps=4).value

    assert_gradient(function, joints.a, joints.alpha, chain.base)


@pytest.mark.slow
def test_out_of_reach_is_masked_and_finite(arms):
    nominal, chain = arms["fanuc"]
    pose = jnp.eye(4).at[0, 3].set(9.0)
    solution = solve(nominal, chain, pose)
    assert not np.any(solution.reached) and np.all(np.isfinite(solution.value))
    slopes = jax.jit(
        jax.jacrev(lambda x: calibrated_inverse_kinematics(nominal, chain, x).value)
    )
    assert np.all(np.isfinite(slopes(pose)))


def test_refusals(arms):
    nominal, _ = arms["fanuc"]
    with pytest.raises(ValueError, match="`chain` must have six joints, but has 2"):
        calibrated_inverse_kinematics(nominal, planar(1.0, 1.0), jnp.eye(4))
