"""Damped least squares and the iterative inverse."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import Series, compose, from_derivatives
from elastax.kinematics import (
    ConstantDamping,
    CorrectionLimiter,
    PoseResults,
    SigmoidDamping,
    damped_least_squares,
    forward_kinematics,
    jacobian,
    pose_error,
    rotation_z,
    row_weights,
    smallest_singular_value,
    solve_damped,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import kuka, mixed, planar


DAMPING = SigmoidDamping.from_limits(1e-4, 0.1, 0.01, 0.1)
POSE = jnp.array([0.3, -1.1, 1.3, 0.4, 0.8, -0.3])


def tilted():
    """An arm with bent axes, which has no closed-form inverse."""
    axes = np.array(
        [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    )
    bent = axes + np.random.default_rng(5).uniform(-0.02, 0.02, (6, 3))
    return kuka(axes=bent / np.linalg.norm(bent, axis=1, keepdims=True))


def published_step():
    case = load_vectors("Reiner 3.57/3.85/3.86")[0]
    inputs = case["inputs"]
    chain = planar(1.0, 1.0)
    q, source = jnp.array(inputs["phi"]), jnp.array(inputs["target_from"])
    return case, chain, q, forward_kinematics(chain, source), jnp.array(inputs["lam"])


def test_one_step():
    case, chain, q, target, damping = published_step()
    expected, tol = case["outputs"], case["tol"]
    error = pose_error(target, forward_kinematics(chain, q))[:2]
    assert_close(error, expected["delta_r"], rtol=tol, atol=1e-12)
    matrix = jacobian(chain, q)[:2]
    step = damped_least_squares(matrix, error, damping)
    assert_close(step, expected["delta_phi"], rtol=tol)
    distance = lambda step: jnp.linalg.norm(
        pose_error(target, forward_kinematics(chain, q + step))[:2]
    )
    # distances are differences of lengths of order one
    assert_close(distance(0 * step), expected["err_before"], rtol=tol)
    assert_close(distance(step), expected["err_after"], rtol=tol, atol=1e-13)
    wrong = expected["err_after_with_printed_sign"]
    assert_close(distance(-step), wrong, rtol=tol)


def test_three_equal_forms():
    case = load_vectors("Reiner 3.65/3.70/3.87")[0]
    inputs, expected, tol = case["inputs"], case["outputs"], case["tol"]
    matrix = jacobian(planar(1.0, 1.0), jnp.array(inputs["phi"]))[:2]
    error, damping = jnp.array(inputs["delta_r"]), jnp.array(inputs["lam"])
    step = damped_least_squares(matrix, error, damping)
    assert_close(step, expected["delta_phi"], rtol=tol)
    assert_close(smallest_singular_value(matrix), expected["sigma"][1], rtol=tol)
    assert_close(smallest_singular_value(matrix, 1), expected["sigma"][0], rtol=tol)
    undamped = damped_least_squares(matrix, error, jnp.array(1e-9))
    # the square of the damping over that of the singular value, and the condition
    assert_close(undamped, expected["undamped_delta_phi"], rtol=1e-8)


@pytest.mark.parametrize("shape", [(3, 6), (6, 3), (4, 4)])
def test_shapes_against_the_singular_value_decomposition(shape):
    rng = np.random.default_rng(0)
    matrix, error = rng.standard_normal(shape), rng.standard_normal(shape[0])
    weights = rng.uniform(0.5, 2, shape[0])
    u, s, v = np.linalg.svd(weights[:, None] * matrix, full_matrices=False)
    # [Reiner2010] (3.65)
    expected = v.T @ (s / (s**2 + 0.3**2) * (u.T @ (weights * error)))
    arguments = jnp.asarray(matrix), jnp.asarray(error), jnp.array(0.3)
    step = damped_least_squares(*arguments, jnp.asarray(weights))
    assert_close(step, expected, rtol=1e-12)
    # and the augmented problem (3.62)
    stacked = np.vstack([weights[:, None] * matrix, 0.3 * np.eye(shape[1])])
    right = np.concatenate([weights * error, np.zeros(shape[1])])
    assert_close(step, np.linalg.lstsq(stacked, right)[0], rtol=1e-11)


def test_singular_matrix_is_damped():
    matrix = jnp.outer(jnp.array([1.0, 2]), jnp.array([1.0, 1]))
    assert_close(smallest_singular_value(matrix), 0.0, rtol=0.0, atol=1e-15)
    assert_close(smallest_singular_value(jnp.zeros((2, 3))), 0.0, rtol=0.0)
    step = damped_least_squares(matrix, jnp.array([2.0, -1]), jnp.array(0.1))
    # the error is orthogonal to what the joints can do
    assert_close(step, jnp.zeros(2), rtol=0.0, atol=1e-13)
    zero = damped_least_squares(jnp.zeros((2, 3)), jnp.ones(2), jnp.array(1e-3))
    assert_close(zero, jnp.zeros(3), rtol=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(2, 3), (3, 2)])
def test_series_are_nested_jvps(shape):
    rng = np.random.default_rng(4)
    a, b = jnp.asarray(rng.standard_normal((2, *shape)))
    c = jnp.asarray(rng.standard_normal(shape[0]))
    parts = (
        lambda t: jnp.sin(a * t) + b,
        lambda t: jnp.cos(c * t),
        lambda t: 0.2 + 0.1 * jnp.exp(-t),
    )
    weights = jnp.arange(1.0, shape[0] + 1)

    def nested(f):
        values = []
        for _ in range(4):
            values.append(f(jnp.array(0.2)))
            f = lambda t, f=f: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack(values)

    @jax.jit
    def both():
        plain = lambda t: damped_least_squares(*(part(t) for part in parts), weights)
        series = [from_derivatives(nested(part)) for part in parts]
        frozen = lambda t: damped_least_squares(
            parts[0](t), c, parts[2](jnp.array(0.2)), weights
        )
        return (
            damped_least_squares(*series, weights).derivatives(),
            nested(plain),
            damped_least_squares(
                series[0], c, parts[2](jnp.array(0.2)), weights
            ).derivatives(),
            nested(frozen),
        )

    moving, expected, held, expected_held = both()
    scale = float(jnp.max(jnp.abs(expected)))
    assert_close(moving, expected, rtol=1e-10, atol=1e-12 * scale)
    assert_close(held, expected_held, rtol=1e-10, atol=1e-12 * scale)


@pytest.mark.slow
def test_limited_series_keeps_the_lowest_order():
    matrix = Series(jnp.zeros((3, 2, 2)).at[0].set(jnp.eye(2)))
    error = Series(jnp.ones((5, 2)))
    step = damped_least_squares(matrix, error, jnp.array(0.1))
    limiter = CorrectionLimiter(-0.5, 0.5, 100.0)
    assert (step.order, compose(limiter, step).order) == (2, 2)


@pytest.mark.slow
def test_correction_gradient():
    case, chain, q, target, damping = published_step()

    def correction(chain, q, target, damping):
        error = pose_error(target, forward_kinematics(chain, q))
        weights = row_weights(0.5)
        return damped_least_squares(jacobian(chain, q), error, damping, weights)

    assert_gradient(correction, chain, q, target, 10 * damping)


def test_characteristic_length_makes_units_irrelevant():
    matrix, error = jacobian(kuka(), POSE), jnp.arange(1.0, 7) * 1e-2
    metres = damped_least_squares(matrix, error, jnp.array(0.02), row_weights(0.5))
    scale = jnp.where(jnp.arange(6) < 3, 1e3, 1.0)
    millimetres = damped_least_squares(
        matrix * scale[:, None], error * scale, jnp.array(20.0), row_weights(500.0)
    )
    assert_close(millimetres, metres, rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("chain", [kuka(), tilted()], ids=["kuka", "tilted"])
def test_pose_is_reached(chain):
    solve = jax.jit(lambda target, q: solve_damped(chain, target, q, damping=DAMPING))
    solution = solve(forward_kinematics(chain, POSE), POSE + 0.1)
    # tolerance of the solver over the smallest singular value
    assert_close(solution.value, POSE, rtol=0.0, atol=1e-9)
    assert bool(solution.result == PoseResults.successful)
    assert float(solution.error) <= 1e-10
    assert 0 < int(solution.steps) < 20
    still = solve(forward_kinematics(chain, POSE), POSE)
    assert_close(still.value, POSE, rtol=0.0, atol=1e-15)
    assert int(still.steps) == 0


@pytest.mark.slow
def test_three_axes_reach_a_position():
    # axes 1 to 3 correct a deformed arm in position only, [Reiner2010] (3.54)
    chain = tilted()
    target = forward_kinematics(kuka(), POSE)
    solution = solve_damped(
        chain, target, POSE, damping=DAMPING, axes=(0, 1, 2), rows=(0, 1, 2)
    )
    reached = forward_kinematics(chain, solution.value)
    assert_close(reached[:3, 3], target[:3, 3], rtol=0.0, atol=1e-10)
    assert_close(solution.value[3:], POSE[3:], rtol=0.0)


@pytest.mark.slow
def test_limiter_bounds_every_step():
    chain, limiter = kuka(), CorrectionLimiter(-0.01, 0.01, 1e4)
    solution = solve_damped(
        chain,
        forward_kinematics(chain, POSE),
        POSE + 0.1,
        damping=DAMPING,
        limiter=limiter,
        max_steps=3,
        throw=False,
    )
    assert bool(solution.result == PoseResults.max_steps_reached)
    assert int(solution.steps) == 3
    assert np.all(np.abs(solution.value - POSE - 0.1) <= 0.03)


def test_pose_slightly_out_of_reach():
    # stretched arm, 1 mm too short
    chain = planar(1.0, 1.0)
    target = transform(jnp.eye(3), jnp.array([0.0, 2.001, 0]))
    options = dict(damping=DAMPING, rows=(0, 1), max_steps=1000)
    start = jnp.array([1.3, 0.3])
    solution = solve_damped(chain, target, start, throw=False, **options)
    assert bool(solution.result == PoseResults.out_of_reach)
    assert_close(solution.error, 0.001, rtol=1e-6)
    assert_close(solution.value, [np.pi / 2, 0.0], rtol=0.0, atol=1e-6)
    with pytest.raises(eqx.EquinoxRuntimeError, match="out of reach"):
        solve_damped(chain, target, start, **options).value.block_until_ready()


def test_half_a_turn_away_is_not_a_solution():
    chain, q = kuka(), POSE
    target = forward_kinematics(chain, q) @ transform(
        rotation_z(jnp.array(np.pi)), jnp.zeros(3)
    )
    solution = solve_damped(chain, target, q, damping=DAMPING, throw=False)
    turned = forward_kinematics(chain, solution.value)
    near = np.allclose(turned, target, atol=1e-9)
    assert near == bool(solution.result == PoseResults.successful)


@pytest.mark.slow
def test_derivative_is_that_of_the_implicit_function():
    chain = kuka()

    def solve(target, start):
        return solve_damped(chain, target, start, damping=DAMPING).value

    target = forward_kinematics(chain, POSE)
    forward = jax.jit(jax.jacfwd(lambda q: solve(forward_kinematics(chain, q), POSE)))
    # from the exact solution the derivative of inverse and forward kinematics is one
    assert_close(forward(POSE), jnp.eye(6), rtol=0.0, atol=1e-12)
    backward = jax.jit(jax.jacrev(lambda q: solve(forward_kinematics(chain, q), POSE)))
    assert_close(backward(POSE), jnp.eye(6), rtol=0.0, atol=1e-12)
    start = jax.jit(jax.jacfwd(lambda q: solve(target, q)))(POSE + 0.05)
    assert_close(start, jnp.zeros((6, 6)), rtol=0.0)


@pytest.mark.slow
def test_gradient_with_resting_joints():
    chain = mixed()
    q = jnp.array([0.3, 0.2, -0.5, 0.4, 0.7])
    target = forward_kinematics(chain, q)

    def solve(chain, target, q):
        return solve_damped(
            chain,
            target,
            q,
            damping=DAMPING,
            axes=(0, 1, 2),
            rows=(0, 1, 2),
            tolerance=1e-13,
        ).value

    assert_gradient(solve, chain, target, q.at[0].add(0.05))


@pytest.mark.slow
def test_jit_vmap_and_loop_agree():
    chain = kuka()
    starts = POSE[None] + jnp.array([0.0, 0.05, -0.1])[:, None]
    target = forward_kinematics(chain, POSE)
    solve = jax.jit(lambda q: solve_damped(chain, target, q, damping=DAMPING).value)
    loop = jnp.stack([solve(q) for q in starts])
    assert_close(jax.jit(jax.vmap(solve))(starts), loop, rtol=0.0, atol=1e-10)


def test_refusals():
    chain, target = kuka(), forward_kinematics(kuka(), POSE)
    constant = ConstantDamping(0.1)
    with pytest.raises(ValueError, match="`axes` must be distinct"):
        solve_damped(chain, target, POSE, damping=constant, axes=(0, 6))
    with pytest.raises(ValueError, match="`rows` must be distinct"):
        solve_damped(chain, target, POSE, damping=constant, rows=(1, 1))
    with pytest.raises(ValueError, match="`count` must be from 1 to 2"):
        smallest_singular_value(jnp.eye(2), 3)
