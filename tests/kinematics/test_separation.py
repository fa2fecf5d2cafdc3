"""Stepwise separation: the matrix equations, their unknowns, the Fanuc arm."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SerialChain,
    SphericalWrist,
    contained_unknowns,
    forward_kinematics,
    inverse_by_separation,
    inverse_kinematics,
    link_transforms,
    separated_equation,
    separated_equations,
)
from elastax.robots import fanuc

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc as scaled_fanuc, kuka, mixed, planar, turned


@pytest.fixture(scope="module")
def chain():
    return fanuc().chain


solve = jax.jit(inverse_by_separation)
solve_generally = jax.jit(inverse_kinematics)
slopes = jax.jit(
    jax.jacrev(lambda chain, pose: inverse_by_separation(chain, pose)[0], 1)
)
find_unknowns = jax.jit(contained_unknowns, static_argnames=("left", "right"))


@pytest.mark.parametrize("case", load_vectors("003 (3-45)-(3-97)"), ids="12")
def test_published_solutions(case):
    """In millimetres, as the text."""
    arm, expected = scaled_fanuc(), case["outputs"]
    pose = jnp.array(expected["T06"])
    q = jnp.array(case["inputs"]["theta"])
    assert_close(forward_kinematics(arm, q), pose, rtol=1e-9, atol=1e-9)
    solutions, valid = solve(arm, pose)
    assert int(jnp.sum(valid)) == expected["n_solutions"]
    for solution in expected["solutions"]:
        signs = (solution[k] for k in ("shoulder", "root_3_73", "wrist"))
        row = int(np.dot([4, 2, 1], [(1 - sign) // 2 for sign in signs]))
        assert bool(valid[row])
        # the pose is printed to ten or eleven digits
        assert_close(solutions[row], solution["theta"], rtol=0.0, atol=1e-8)


def test_published_aligned_wrist():
    case = load_vectors("003 (3-96)/(3-97) at S5=0")[0]
    arm = scaled_fanuc()
    q = jnp.array(case["inputs"]["theta"])
    pose = forward_kinematics(arm, q)
    transforms = link_transforms(arm, q)
    # T_3^6 by three inversions, (3-84)
    rotation = separated_equation(transforms, pose, left=3).given[:3, :3]
    assert_close(rotation, case["outputs"]["R36"], rtol=0.0, atol=case["tol"])
    solutions, _ = solve(arm, pose)
    assert_close(solutions[2, 3], 0.0, rtol=0.0)
    # theta_4 + theta_6 in all digits that the pose of metres in mm keeps
    combination = case["outputs"]["combination"]
    assert_close(solutions[2, 5], combination, rtol=0.0, atol=1e-11)


def test_folded_back_wrist():
    """Axis 5 half a turn away fixes the difference of axes 4 and 6."""
    arm = scaled_fanuc(1e-3)
    q = jnp.array([0.3, 1.2, -0.4, 0.5, np.pi, -1.1])
    pose = forward_kinematics(arm, q)
    solutions, _ = solve(arm, pose)
    assert_close(solutions[2, 3], 0.0, rtol=0.0)
    assert_close(turned(solutions[2, 5], -1.6), -1.6, rtol=0.0, atol=1e-11)
    assert_close(forward_kinematics(arm, solutions[2]), pose, rtol=0.0, atol=1e-11)


@pytest.mark.slow
def test_agrees_with_the_general_closed_form(chain):
    """All branches of random reachable poses, and the same masks."""
    q = jnp.asarray(np.random.default_rng(0).uniform(-np.pi, np.pi, (1000, 6)))
    poses = jax.jit(jax.vmap(forward_kinematics, (None, 0)))(chain, q)
    ours, valid = jax.jit(jax.vmap(inverse_by_separation, (None, 0)))(chain, poses)
    general = jax.jit(jax.vmap(inverse_kinematics, (None, 0)))
    others, masks = general(SphericalWrist.from_chain(chain), poses)
    assert np.all(np.asarray(valid) == np.asarray(masks))
    assert np.all(np.sum(valid, axis=1) >= 4)
    difference = np.abs(np.asarray(turned(ours, others) - others))
    # rounding over the distance from the nearest singular pose of the batch
    assert np.max(difference[np.asarray(valid)]) < 1e-8
    # where the arm falls short both stretch or fold it
    assert np.all(np.isfinite(ours))


def test_base_and_tool(chain):
    rng = np.random.default_rng(4)
    base = forward_kinematics(chain, jnp.asarray(rng.uniform(-2, 2, 6)))
    tool = forward_kinematics(chain, jnp.asarray(rng.uniform(-2, 2, 6)))
    moved = SerialChain(chain.joints, base, tool, chain.kinds)
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    solutions, valid = solve(moved, forward_kinematics(moved, q))
    assert bool(valid[2])
    assert_close(solutions[2], q, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["fanuc", "kuka", "mixed"])
def test_single_transforms(name, chain):
    arm = {"fanuc": chain, "kuka": kuka(), "mixed": mixed()}[name]
    q = jnp.asarray(np.random.default_rng(1).uniform(-1, 1, arm.number))
    transforms = link_transforms(arm, q)
    pose = jnp.linalg.multi_dot(list(transforms))
    assert_close(pose, forward_kinematics(arm, q), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("row", range(8))
def test_all_equations_hold_at_every_solution(chain, row):
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    pose = forward_kinematics(chain, q)
    solutions, valid = solve(chain, pose)
    assert bool(valid[row])
    transforms = link_transforms(chain, solutions[row])
    equations = separated_equations(transforms, pose)
    # five from the left and five from the right, as listed in the text
    assert len(equations) == 10
    for equation in equations:
        assert_close(equation.given, equation.chain, rtol=0.0, atol=1e-13)
    # a wrong angle is noticed by every equation
    wrong = link_transforms(chain, solutions[row].at[1].add(1e-3))
    for equation in separated_equations(wrong, pose):
        assert np.max(np.abs(equation.given - equation.chain)) > 1e-5


def alone(unknowns):
    """Elements that hold one unknown only, as (row, column): joint."""
    single = np.argwhere(np.sum(unknowns, axis=2) == 1)
    return {(int(i), int(j)): int(np.argmax(unknowns[i, j])) for i, j in single}


@pytest.mark.slow
def test_the_search_finds_the_steps_of_the_text(chain):
    """Which equation holds one unknown only, step after step."""
    # no inversion: every element of the position holds several
    unknowns = np.asarray(find_unknowns(chain))
    assert alone(unknowns) == {}
    # one from each side, (3-57): the third row of the position is (3-60), theta_1 alone
    unknowns = np.asarray(find_unknowns(chain, left=1, right=1))
    assert alone(unknowns) == {(2, 3): 0}
    # its other rows hold theta_1 to theta_3: two equations for two unknowns are left
    assert set(np.flatnonzero(unknowns[0, 3])) == {0, 1, 2}
    assert set(np.flatnonzero(unknowns[1, 3])) == {1, 2}
    # three from the left, (3-84): with theta_1 to theta_3 known, element 33 holds
    # theta_5 alone, the third column theta_4 in addition, the third row theta_6
    unknowns = np.asarray(find_unknowns(chain, left=3))[:, :, 3:]
    assert alone(unknowns)[2, 2] == 1
    assert unknowns[0, 2].tolist() == unknowns[1, 2].tolist() == [True, True, False]
    assert unknowns[2, 0].tolist() == unknowns[2, 1].tolist() == [False, True, True]


def test_planar_arm_is_separated_as_well():
    """One inversion leaves the second angle alone in the rotation."""
    unknowns = np.asarray(find_unknowns(planar(1.0, 0.7), left=1))
    # the constant third row and column hold nothing
    assert not np.any(unknowns[2]) or set(alone(unknowns).values()) <= {0, 1}
    assert unknowns[0, 3].tolist() == [True, True]


@pytest.mark.slow
def test_gradient(chain):
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    joints = chain.joints

    def function(lengths, offsets, pose):
        arm = SerialChain.from_dh(joints.theta, offsets, lengths, joints.alpha)
        return inverse_by_separation(arm, pose)[0]

    assert_gradient(function, joints.a, joints.d, forward_kinematics(chain, q))


@pytest.mark.parametrize(
    "position",
    [[9.0, 0, 0], [0.312, 0, 0.1], [0.0, 0, 0.5]],
    ids=["far", "near", "axis"],
)
def test_out_of_reach_is_masked_and_finite(chain, position):
    pose = jnp.eye(4).at[:3, 3].set(jnp.array(position))
    solutions, valid = solve(chain, pose)
    _, masks = solve_generally(SphericalWrist.from_chain(chain), pose)
    assert valid.tolist() == masks.tolist()
    assert np.all(np.isfinite(solutions))
    assert np.all(np.isfinite(slopes(chain, pose)))


def test_refusals(chain):
    pose, q = jnp.eye(4), jnp.zeros(6)
    transforms = link_transforms(chain, q)
    for options in ({"left": 6}, {"left": 3, "right": 3}, {"left": -1}):
        with pytest.raises(ValueError, match="must leave one of 6 transforms"):
            separated_equation(transforms, pose, **options)
    with pytest.raises(ValueError, match="six Denavit-Hartenberg joints"):
        inverse_by_separation(kuka(), pose)
    with pytest.raises(ValueError, match="six Denavit-Hartenberg joints"):
        inverse_by_separation(planar(1.0, 1.0), pose)
    table = chain.joints
    with pytest.raises(ValueError, match="twists and zeros of table 3-5"):
        tilted = table.alpha.at[1].set(0.01)
        inverse_by_separation(
            SerialChain.from_dh(table.theta, table.d, table.a, tilted), pose
        )
