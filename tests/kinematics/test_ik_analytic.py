"""Closed-form inverse kinematics: published solutions, laws, singular poses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ConstantDamping,
    JointKind,
    SerialChain,
    SphericalWrist,
    forward_kinematics,
    inverse_kinematics,
    inverse_kinematics_path,
    rotation_from_rpy,
    select_branch,
    solve_damped,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, kuka, planar, puma, turned


def moved():
    """The KUKA-like arm with reversed axes and another base."""
    base = transform(
        rotation_from_rpy(jnp.array([0.3, -0.8, 2.0])), jnp.array([1.0, -2, 0.5])
    )
    return kuka(signs=(-1.0, 1, -1, 1, -1, -1), base=base)


arms = {"fanuc": fanuc(1e-3), "kuka": kuka(), "puma": puma(), "moved": moved()}
each_arm = pytest.mark.parametrize("chain", arms.values(), ids=arms.keys())
solve = jax.jit(inverse_kinematics)
poses_of = jax.jit(jax.vmap(forward_kinematics, (None, 0)))


def assert_contains(solutions, valid, q, atol):
    """`q` is a valid solution, up to whole turns."""
    distance = np.max(np.abs(turned(solutions, q[None]) - q[None]), axis=1)
    assert np.min(np.where(valid, distance, np.inf)) <= atol, distance


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", load_vectors("003 (3-45)-(3-97)"), ids=["pose 1", "pose 2"]
)
def test_published_solutions(case):
    arm, expected = SphericalWrist.from_chain(fanuc()), case["outputs"]
    pose = forward_kinematics(arm.chain, jnp.array(case["inputs"]["theta"]))
    solutions, valid = solve(arm, pose)
    assert int(jnp.sum(valid)) == expected["n_solutions"]
    for solution in expected["solutions"]:
        signs = (solution[k] for k in ("shoulder", "root_3_73", "wrist"))
        row = int(np.dot([4, 2, 1], [(1 - sign) // 2 for sign in signs]))
        assert bool(valid[row])
        assert_close(solutions[row], solution["theta"], rtol=1e-8, atol=1e-8)


def test_published_offsets():
    case = load_vectors("Reiner 3.53 (offset extension)")[0]
    arm, tol = SphericalWrist.from_chain(kuka()), case["tol"]
    # the tool is 0.115 m in front of the wrist centre, along its own z
    position = jnp.array(case["inputs"]["r_HWP"]) + jnp.array([0, 0, 0.115])
    solutions, valid = solve(arm, transform(jnp.eye(3), position))
    for solution in case["outputs"]["solutions"]:
        row = 0 if solution["elbow"] == "+" else 2
        angles = [solution[name] for name in ("A1", "A2", "A3")]
        assert bool(valid[row])
        assert_close(solutions[row, :3], angles, rtol=tol, atol=tol)


def test_published_kuka_signs():
    case = load_vectors("A.6 / 3.53 sign convention")[0]
    inputs, expected = case["inputs"], case["outputs"]
    chain = SerialChain.from_frames(
        np.tile(np.eye(3), (6, 1, 1)),
        np.array([0, 0, inputs["l1"], inputs["l2"], 0, 0])[:, None] * np.eye(3)[0],
        [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]],
    )
    position = jnp.array([expected[name] for name in ("x_base", "y_base", "z")])
    pose = transform(jnp.eye(3), position)
    solutions, valid = solve(SphericalWrist.from_chain(chain), pose)
    angles = np.deg2rad([inputs[name] for name in ("A1_deg", "A2_deg", "A3_deg")])
    assert np.all(valid)
    assert_close(solutions[0, :3], angles, rtol=1e-12)


@pytest.mark.slow
@each_arm
def test_inverse_of_forward_kinematics(chain):
    arm = SphericalWrist.from_chain(chain)
    batch = jnp.asarray(np.random.default_rng(1).uniform(-np.pi, np.pi, (40, 6)))
    targets = poses_of(chain, batch)
    solutions, valid = jax.jit(jax.vmap(inverse_kinematics, (None, 0)))(arm, targets)
    assert np.all((solutions > -np.pi) & (solutions <= np.pi))
    # all valid rows reach the pose; rounding grows near the boundary of the workspace
    reached = poses_of(chain, solutions.reshape(-1, 6)).reshape(40, 8, 4, 4)
    error = jnp.max(jnp.abs(reached - targets[:, None]), axis=(2, 3))
    assert np.max(np.where(valid, error, 0.0)) < 1e-12
    for q, rows, flags in zip(batch, solutions, valid, strict=True):
        assert_contains(rows, flags, q, 1e-9)
    # the wrist flips without limits, hence rows come in pairs
    assert np.all(valid[:, ::2] == valid[:, 1::2])
    assert 0 < int(jnp.sum(valid)) and np.any(np.sum(valid, axis=1) == 8)


@each_arm
def test_solutions_are_distinct(chain):
    arm = SphericalWrist.from_chain(chain)
    q = jnp.array([0.2, -0.5, 0.6, 0.4, 0.8, -0.3])
    solutions, valid = solve(arm, forward_kinematics(chain, q))
    rows = np.asarray(solutions)[np.asarray(valid)]
    gap = np.asarray(turned(rows[:, None] - rows[None], jnp.zeros((1, 1, 6))))
    distance = np.max(np.abs(gap), axis=2) + 10 * np.eye(len(rows))
    assert np.min(distance) > 1e-3


@pytest.mark.slow
def test_iterative_solution_agrees():
    chain = puma()
    q = jnp.array([0.3, -1.0, 0.8, 0.5, 0.9, -0.4])
    target = forward_kinematics(chain, q + 0.05)
    solutions, valid = solve(SphericalWrist.from_chain(chain), target)
    nearest = select_branch(solutions, valid, q)
    iterated = solve_damped(chain, target, q, damping=ConstantDamping(1e-3))
    # tolerance of the iteration over the smallest singular value
    assert_close(nearest, iterated.value, rtol=0.0, atol=1e-8)
    assert_close(nearest, q + 0.05, rtol=1e-11)


@pytest.mark.slow
@each_arm
def test_derivative_is_the_inverse_jacobian(chain):
    arm = SphericalWrist.from_chain(chain)
    q = jnp.array([0.3, -0.4, 0.7, 0.5, 0.9, -0.4])

    def roundtrip(x):
        solutions, valid = inverse_kinematics(arm, forward_kinematics(chain, x))
        return select_branch(solutions, valid, q)

    for derivative in (jax.jacfwd, jax.jacrev):
        matrix = jax.jit(derivative(roundtrip))(q)
        assert_close(matrix, jnp.eye(6), rtol=0.0, atol=1e-11)


@pytest.mark.slow
def test_gradient_of_all_branches():
    joints = fanuc(1e-3).joints
    q = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])
    pose = forward_kinematics(fanuc(1e-3), q)

    def function(lengths, offsets, pose):
        chain = SerialChain.from_dh(joints.theta, offsets, lengths, joints.alpha)
        return inverse_kinematics(SphericalWrist.from_chain(chain), pose)[0]

    assert np.all(solve(SphericalWrist.from_chain(fanuc(1e-3)), pose)[1])
    assert_gradient(function, joints.a, joints.d, pose)


@pytest.mark.slow
@pytest.mark.parametrize(
    "position",
    [[5.0, 0, 0], [0, 0, 1e8], [0.3, 0, 0.8], [0.26, 0, 0.79]],
    ids=["far", "very far", "near axis 2", "on axis 2"],
)
def test_out_of_reach_is_masked_and_finite(position):
    arm = SphericalWrist.from_chain(kuka(wrist_height=0.5))
    pose = transform(jnp.eye(3), jnp.array(position))
    solutions, valid = solve(arm, pose)
    assert not np.any(valid[:4])
    assert np.all(np.isfinite(solutions))
    gradient = jax.jit(jax.jacrev(lambda pose: inverse_kinematics(arm, pose)[0]))(pose)
    assert np.all(np.isfinite(gradient))


def test_lateral_offset_out_of_reach():
    arm = SphericalWrist.from_chain(puma())
    # nearer to axis 1 than the sideways offset of the wrist
    pose = transform(jnp.eye(3), jnp.array([0.05, 0.0, 0.9]))
    solutions, valid = solve(arm, pose)
    assert not np.any(valid) and np.all(np.isfinite(solutions))


@pytest.mark.slow
@pytest.mark.parametrize("bend", [0.0, np.pi])
def test_aligned_wrist_keeps_axis_4(bend):
    chain = fanuc(1e-3)
    arm = SphericalWrist.from_chain(chain)
    q = jnp.array([0.3, 1.2, -0.4, 0.5, bend, -1.1])
    pose = forward_kinematics(chain, q)
    solutions, valid = solve(arm, pose, q)
    assert bool(valid[2])
    assert_close(turned(solutions[2], q), q, rtol=0.0, atol=1e-11)
    # without a previous pose axis 4 is zero
    case = load_vectors("003 (3-96)/(3-97) at S5=0")[0]
    solutions, _ = solve(arm, pose)
    assert_close(solutions[2, 3], 0.0, rtol=0.0)
    if bend == 0.0:
        combination = case["outputs"]["combination"]
        assert_close(solutions[2, 5], combination, rtol=0.0, atol=1e-11)
    reached = poses_of(chain, solutions[2:4])
    assert_close(reached, jnp.stack([pose, pose]), rtol=0.0, atol=1e-11)
    gradient = jax.jit(jax.jacrev(lambda pose: inverse_kinematics(arm, pose, q)[0]))
    assert np.all(np.isfinite(gradient(pose)))


@pytest.mark.slow
def test_wrist_centre_on_axis_1_keeps_axis_1():
    chain = kuka(wrist_height=0.0)
    arm = SphericalWrist.from_chain(chain)
    # upper arm upright, forearm back over axis 1
    q = jnp.array([0.7, -np.pi / 2, -np.arcsin(0.26 / 0.67), 0.2, 0.9, 0.4])
    pose = forward_kinematics(chain, q)
    centre = pose[:3, 3] - 0.115 * pose[:3, 2]
    assert_close(centre[:2], jnp.zeros(2), rtol=0.0, atol=1e-12)
    solutions, valid = solve(arm, pose, q)
    assert_contains(solutions, valid, q, 1e-10)
    reached = poses_of(chain, solutions)
    error = jnp.max(jnp.abs(reached - pose[None]), axis=(1, 2))
    assert np.all(valid) and np.max(error) < 1e-10
    gradient = jax.jit(jax.jacrev(lambda pose: inverse_kinematics(arm, pose, q)[0]))
    assert np.all(np.isfinite(gradient(pose)))


@pytest.mark.slow
def test_stretched_arm():
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    # forearm and upper arm in line
    stretched = np.arctan2(-0.035, 0.67)
    q = jnp.array([0.4, -0.3, stretched, 0.3, 0.5, 0.2])
    pose = forward_kinematics(chain, q)
    solutions, valid = solve(arm, pose)
    # the square root of the rounding, in both elbow branches
    assert_contains(solutions, valid, q, 1e-7)
    reached = poses_of(chain, solutions[:4])
    assert np.all(valid[:4])
    assert np.max(np.abs(reached - pose[None])) < 1e-11
    gradient = jax.jit(jax.jacrev(lambda pose: inverse_kinematics(arm, pose)[0]))
    assert np.all(np.isfinite(gradient(pose)))


def test_select_branch():
    solutions = jnp.array([[0.0, 3.0], [0.1, -3.0], [2.0, 2.0]])
    valid = jnp.array([True, True, False])
    near = lambda *previous: select_branch(solutions, valid, jnp.array(previous))
    assert_close(near(0.1, 3.2), [0.1, 2 * np.pi - 3], rtol=1e-15)
    assert_close(near(0.0, 2.9), [0.0, 3.0], rtol=0.0)
    assert_close(near(20 * np.pi, 3.0), [20 * np.pi, 3.0], rtol=1e-15)
    # an unreachable row is taken only if there is no other
    assert_close(near(2.0, 2.0), [0.0, 3.0], rtol=0.0)
    nothing = select_branch(solutions, ~valid & False, jnp.array([2.0, 2.1]))
    assert_close(nothing, [2.0, 2.0], rtol=0.0)


def test_path_through_the_singular_wrist_and_over_whole_turns():
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    s = jnp.linspace(-1.0, 1.0, 41)
    start, rate = np.array([0.4, -1.1, 1.3, 0.3, 0.0, 0.0]), [0.5, 0.2, 0.1, 0, 0.4, 8]
    path = start[None] + s[:, None] * np.array(rate)[None]
    follow = jax.jit(inverse_kinematics_path)
    q, valid = follow(arm, poses_of(chain, path), path[0])
    assert np.all(valid)
    # at the sample in the middle axes 4 and 6 are aligned
    assert_close(q, path, rtol=0.0, atol=1e-10)
    # one pose after the other gives the same
    previous, loop = path[0], []
    for pose in poses_of(chain, path)[:5]:
        previous = select_branch(*solve(arm, pose, previous), previous)
        loop.append(previous)
    assert_close(q[:5], jnp.stack(loop), rtol=0.0, atol=1e-13)


def test_path_leaves_the_workspace():
    chain = kuka()
    arm = SphericalWrist.from_chain(chain)
    q = jnp.array([0.0, -0.3, 0.4, 0.1, 0.5, 0.2])
    pose = forward_kinematics(chain, q)
    shift = jnp.zeros((5, 4, 4)).at[:, 0, 3].set(jnp.array([0.0, -0.1, 9, -0.1, 0]))
    path, valid = inverse_kinematics_path(arm, pose[None] + shift, q)
    assert valid.tolist() == [True, True, False, True, True]
    assert np.all(np.isfinite(path))
    assert_close(path[::4], jnp.stack([q, q]), rtol=0.0, atol=1e-12)


def test_refusals():
    def refuse(message, chain):
        with pytest.raises(ValueError, match=message):
            SphericalWrist.from_chain(chain)

    def changed(**values):
        table = dict(
            theta=np.zeros(6),
            d=np.array([0.0, 0, 0, 1.28, 0, 0.2]),
            a=np.array([0.3, 1, 0.2, 0, 0, 0]),
            alpha=np.array([1, 0, 1, -1, 1, 0]) * np.pi / 2,
        )
        for name, (index, value) in values.items():
            table[name][index] = value
        return SerialChain.from_dh(**table)

    assert SphericalWrist.from_chain(changed()).chain.number == 6
    refuse("six revolute joints", planar(1.0, 1.0))
    slide = (JointKind.REVOLUTE,) * 5 + (JointKind.PRISMATIC,)
    zero = np.zeros(6)
    refuse("prismatic", SerialChain.from_dh(zero, zero, zero, zero, kinds=slide))
    refuse("axis 1 .* perpendicular to axis 2", changed(alpha=(0, 1.5)))
    refuse("axis 2 .* parallel to axis 3", changed(alpha=(1, 0.01)))
    refuse("axis 4 .* perpendicular to axis 5", changed(alpha=(3, -1.5)))
    refuse("axis 5 .* perpendicular to axis 6", changed(alpha=(4, 1.0)))
    refuse("must lie apart", changed(a=(1, 0.0)))
    refuse("meet in one point", changed(a=(3, 0.01)))
    refuse("meet in one point", changed(d=(4, 0.01)))
    refuse("must be finite", changed(d=(3, np.nan)))
