"""The planar arm: published numbers, both solutions, stretched and folded poses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    PlanarArm,
    jacobian,
    planar_inverse,
    planar_inverse_geometric,
    select_branch,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import planar


ARM = PlanarArm(1.0, 0.7)
solve = jax.jit(planar_inverse)
solve_geometric = jax.jit(planar_inverse_geometric)
each_solution = pytest.mark.parametrize(
    "inverse", [solve, solve_geometric], ids=["algebraic", "geometric"]
)


@each_solution
def test_published_solution(inverse):
    case = load_vectors("004 planar 2R")[0]
    inputs, expected, tol = case["inputs"], case["outputs"], case["tol"]
    arm = PlanarArm(inputs["l1"], inputs["l2"])
    q, reached = inverse(arm, jnp.array([inputs["x"], inputs["y"]]))
    assert np.all(reached)
    for row, solution in zip(q, expected["solutions"], strict=True):
        wanted = [solution["theta1"], solution["theta2"]]
        assert_close(row, wanted, rtol=tol)
        # the direction of the tool is no free condition
        assert_close(row[0] + row[1], solution["phi"], rtol=tol)
        assert_close(jnp.cos(row[1]), expected["c2"], rtol=tol)
    # theta_1 = beta -+ psi
    assert_close((q[0, 0] + q[1, 0]) / 2, expected["beta"], rtol=tol)
    assert_close((q[1, 0] - q[0, 0]) / 2, expected["psi"], rtol=tol)


def test_published_jacobian():
    case = load_vectors("004 J^-1")[0]
    inputs, expected, tol = case["inputs"], case["outputs"], case["tol"]
    arm, q = PlanarArm(inputs["l1"], inputs["l2"]), jnp.array(inputs["theta"])
    assert_close(arm.jacobian(q), expected["J"], rtol=tol)
    inverse, regular = arm.inverse_jacobian(q)
    assert bool(regular)
    assert_close(inverse, expected["Jinv"], rtol=tol)
    printed = np.array(expected["Jinv_printed_wrong"])
    assert np.max(np.abs(np.asarray(inverse) - printed)) > 0.1


def test_jacobian_is_that_of_the_chain_and_of_autodiff():
    q = jnp.array([0.4, -1.3])
    matrix = jacobian(planar(1.0, 0.7), q)
    assert_close(ARM.jacobian(q), matrix[:2], rtol=1e-14)
    assert_close(jax.jacfwd(ARM.position)(q), ARM.jacobian(q), rtol=1e-14)
    inverse, _ = ARM.inverse_jacobian(q)
    # products of numbers of order one
    assert_close(inverse @ ARM.jacobian(q), jnp.eye(2), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("bend", [0.0, np.pi])
def test_singular_jacobian_has_no_inverse(bend):
    q = jnp.array([0.4, bend])
    inverse, regular = ARM.inverse_jacobian(q)
    assert not bool(regular) and np.all(np.asarray(inverse) == 0)
    gradient = jax.jacrev(lambda q: ARM.inverse_jacobian(q)[0])(q)
    assert np.all(np.isfinite(gradient))


@pytest.mark.slow
@each_solution
def test_inverse_of_position(inverse):
    q = jnp.asarray(np.random.default_rng(0).uniform(-np.pi, np.pi, (50, 2)))
    solutions, reached = jax.jit(jax.vmap(inverse, (None, 0)))(
        ARM, jax.vmap(ARM.position)(q)
    )
    assert np.all(reached)
    row = np.where(np.asarray(q[:, 1]) > 0, 0, 1)
    # rounding over the smallest sine of the second angle in the batch
    assert_close(solutions[np.arange(50), row], q, rtol=0.0, atol=1e-13)
    places = jax.vmap(jax.vmap(ARM.position))(solutions)
    wanted = jnp.broadcast_to(jax.vmap(ARM.position)(q)[:, None], places.shape)
    assert_close(places, wanted, rtol=0.0, atol=1e-14)


@each_solution
def test_jit_vmap_and_loop_agree(inverse):
    places = jnp.array([[0.9, 0.6], [-0.4, 0.5], [3.0, 1.0], [0.0, 0.0]])
    batch = jax.vmap(inverse, (None, 0))(ARM, places)
    loop = [inverse(ARM, place) for place in places]
    # one rounding of the compiled trigonometry
    assert_close(batch[0], jnp.stack([q for q, _ in loop]), rtol=1e-14, atol=1e-15)
    assert batch[1].tolist() == [r.tolist() for _, r in loop]


@pytest.mark.slow
@each_solution
def test_gradients(inverse):
    place = jnp.array([0.9, 0.6])
    function = lambda arm, place: inverse(arm, place)[0]
    assert_gradient(function, ARM, place, order=2)
    q, _ = inverse(ARM, place)
    for k, slope in enumerate(jax.jacfwd(function, 1)(ARM, place)):
        assert_close(slope, ARM.inverse_jacobian(q[k])[0], rtol=1e-13)


@pytest.mark.slow
@each_solution
@pytest.mark.parametrize(
    "place",
    [[1.7, 0.0], [0.0, -0.3], [5.0, 2.0], [0.1, 0.05], [0.0, 0.0]],
    ids=["stretched", "folded", "far", "too near", "on joint 1"],
)
def test_boundary_and_beyond(inverse, place):
    place = jnp.array(place)
    distance = np.linalg.norm(place)
    q, reached = inverse(ARM, place)
    assert np.all(np.asarray(reached) == bool(distance in (1.7, 0.3)))
    assert np.all(np.isfinite(q))
    # the arm points to the place as far as it can
    nearest = np.clip(distance, 0.3, 1.7)
    for row in q:
        tool = ARM.position(row)
        assert_close(jnp.linalg.norm(tool), nearest, rtol=1e-12)
        assert_close(tool @ place, nearest * distance, rtol=1e-12)
    for derivative in (jax.jacfwd, jax.jacrev):
        slopes = derivative(lambda arm, x: inverse(arm, x)[0], (0, 1))(ARM, place)
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))


@each_solution
def test_equal_links_on_joint_1_keep_the_first_angle(inverse):
    arm = PlanarArm(0.6, 0.6)
    q, reached = inverse(arm, jnp.zeros(2), jnp.array([0.8, 3.0]))
    assert np.all(reached)
    assert_close(q, [[0.8, np.pi], [0.8, np.pi]], rtol=1e-14)
    slopes = jax.jacrev(lambda x: inverse(arm, x)[0])(jnp.zeros(2))
    assert np.all(np.isfinite(slopes))


def test_branch_follows_a_path():
    s = jnp.linspace(0.0, 1.0, 30)
    path = jnp.stack([2 * s, -0.6 - 1.5 * s], axis=1)
    places = jax.vmap(ARM.position)(path)

    def step(previous, place):
        solutions, reached = planar_inverse(ARM, place, previous)
        q = select_branch(solutions, reached, previous)
        return q, q

    _, followed = jax.lax.scan(step, path[0], places)
    assert_close(followed, path, rtol=0.0, atol=1e-13)


def test_refusals():
    with pytest.raises(ValueError, match="`first` must be positive"):
        PlanarArm(0.0, 1.0)
    with pytest.raises(ValueError, match="`second` must be positive"):
        PlanarArm(1.0, -1.0)
