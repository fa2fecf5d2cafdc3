"""Inverse kinematics by iteration from one start."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ConstantDamping,
    DampedStep,
    ErrorDampedStep,
    PoseResults,
    PseudoInverseStep,
    RestPostureStep,
    SerialChain,
    forward_kinematics,
    jacobian,
    pose_difference,
    rotation_from_vector,
    singular_distance,
    solve_pose,
    transform,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, mixed, planar, puma


POSE = jnp.array([0.3, -1.1, 1.3, 0.4, 0.8, -0.3])
START = POSE + jnp.array([0.3, -0.2, 0.2, -0.3, 0.25, 0.4])
PLANE = (0, 1)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.1, np.pi - 1e-7, np.pi])
def test_difference_is_exact_up_to_half_a_turn(angle):
    vector = angle * jnp.array([0.6, -0.8, 0.0])
    turned = rotation_from_vector(jnp.array([0.2, 0.5, -1.0]))
    here = transform(turned, jnp.array([1.0, 2.0, 3.0]))
    there = transform(rotation_from_vector(vector) @ turned, jnp.array([1.5, 2.0, 1.0]))
    found = jax.jit(pose_difference)(there, here)
    assert_close(found[:3], [0.5, 0.0, -2.0], rtol=1e-15)  # rounding
    # half a turn is a turn about either direction  # rounding
    sign = jnp.where((angle == np.pi) & (found[3] < 0), -1.0, 1.0)
    assert_close(sign * found[3:], vector, rtol=0.0, atol=2e-15)


@pytest.mark.slow
def test_gradient_of_the_difference():
    """At zero and near it the derivative is that of the vector itself."""
    zero = jnp.zeros(3)
    here = transform(rotation_from_vector(jnp.array([0.2, 0.5, -1.0])), zero)

    def function(v):
        there = transform(rotation_from_vector(v) @ here[:3, :3], zero)
        return pose_difference(there, here)[3:]

    slopes = jax.jit(jax.jacfwd(function))
    for size in (0.0, 1e-12, 1e-6):
        # the derivative of the rotation by itself is exact  # rounding
        close = slopes(size * jnp.array([0.6, -0.8, 0.0]))
        assert_close(close, np.eye(3), rtol=0.0, atol=1e-15 + size**2)
    assert_gradient(function, jnp.array([0.5, -2.0, 1.0]))


@pytest.mark.slow
@pytest.mark.parametrize("step", [PseudoInverseStep(), ErrorDampedStep()])
def test_six_axes(step):
    chain = kuka()
    target = forward_kinematics(chain, POSE)
    found = jax.jit(lambda t, q: solve_pose(chain, t, q, step=step))(target, START)
    # tolerance of 1e-9 over the smallest singular value
    assert_close(found.value, POSE, rtol=0.0, atol=1e-7)
    assert found.position_error <= 1e-9 and found.rotation_error <= 1e-9
    assert found.result == PoseResults.successful and 3 <= found.steps <= 20
    singular = np.linalg.svd(jacobian(chain, POSE), compute_uv=False)
    assert_close(found.smallest_singular_value, singular[-1], rtol=1e-6)


def test_newton_converges_quadratically():
    """[KinModell] (3-130) with its bracket."""
    chain, solution = planar(1.0, 1.0), jnp.array([0.4, 1.1])
    goal, step = forward_kinematics(chain, solution), PseudoInverseStep()

    @jax.jit
    def correct(q):
        error = pose_difference(goal, forward_kinematics(chain, q))[:2]
        return jnp.linalg.norm(error), q + step(jacobian(chain, q)[:2], error, q)

    errors, q = [], solution + jnp.array([0.1, -0.1])
    for _ in range(4):
        error, q = correct(q)
        errors.append(float(error))
    # the constant of the square is of the order of one here
    for before, after in zip(errors[:3], errors[1:]):
        assert after < 2 * before**2


@pytest.mark.slow
def test_prismatic_joints_and_skew_axes():
    chain, q = mixed(), jnp.array([0.4, 0.2, -0.7, 0.3, 1.1])
    rows = (0, 1, 2, 3, 4, 5)
    target = forward_kinematics(chain, q)
    # five joints, six rows: over-determined, but this pose is in reach
    found = solve_pose(chain, target, q + 0.2, rows=rows)
    assert_close(found.value, q, rtol=0.0, atol=1e-7)  # as above


@pytest.mark.slow
def test_rest_posture_of_a_redundant_arm():
    """Five joints in a plane: the closest solution to the rest posture."""
    chain, rest = planar(*[0.5] * 5), jnp.array([0.3, 0.4, 0.3, 0.4, 0.3])
    target = transform(jnp.eye(3), jnp.array([1.2, 0.9, 0.0]))
    weights = jnp.array([1.0, 2, 3, 2, 1])
    step = RestPostureStep(rest, weights)
    find = jax.jit(
        lambda q: solve_pose(chain, target, q, step=step, rows=PLANE, max_steps=300)
    )
    # run on: the pose is reached long before the posture settles
    settle = jax.jit(
        lambda q: (
            q
            + step(
                jacobian(chain, q)[:2],
                (target - forward_kinematics(chain, q))[:2, 3],
                q,
            )
        )
    )
    settled = []
    for start in (rest, rest + 0.3 * jnp.array([1.0, -1, 1, -1, 1])):
        found = find(start)
        assert found.result == PoseResults.successful
        q = found.value
        for _ in range(200):
            q = settle(q)
        settled.append(q)
    assert_close(settled[0], settled[1], rtol=0.0, atol=1e-10)
    # stationary: weighted distance across the constraint  # [Berns] gradients
    matrix = jacobian(chain, settled[0])[:2]
    gradient = weights * (settled[0] - rest)
    multipliers = jnp.linalg.lstsq(matrix.T, gradient)[0]
    assert_close(matrix.T @ multipliers, gradient, rtol=0.0, atol=1e-10)


@pytest.mark.slow
def test_limits_hold_and_are_left_again():
    """The elbow has to move the other way round."""
    chain = planar(1.0, 0.8)
    target = forward_kinematics(chain, jnp.array([0.2, 1.2]))
    inside = dict(lower=jnp.array([-3.0, 0.1]), upper=jnp.array([3.0, 2.8]))
    find = lambda q, **kw: solve_pose(chain, target, q, rows=PLANE, **kw)
    free = find(jnp.array([1.5, -0.5]))
    assert free.value[1] < 0  # the branch beyond the limit
    kept = find(jnp.array([1.5, -0.5]), **inside)
    assert_close(kept.value, [0.2, 1.2], rtol=0.0, atol=1e-8)  # tolerance
    # out of reach within limits: at the limit, all others where the error is least
    tight = dict(lower=jnp.array([-3.0, 0.1]), upper=jnp.array([3.0, 1.0]))
    stuck = find(jnp.array([0.5, 0.5]), throw=False, **tight)
    assert_close(stuck.value[1], 1.0, rtol=0.0)
    assert stuck.result == PoseResults.out_of_reach
    error = (target - forward_kinematics(chain, stuck.value))[:2, 3]
    slope = error @ jacobian(chain, stuck.value)[:2]
    assert abs(slope[0]) < 1e-9 < 1e-2 < slope[1]


@pytest.mark.slow
def test_over_determined_arm_finds_the_nearest_pose():
    """Two joints, three rows of a plane's pose: the least-squares solution."""
    chain = planar(1.0, 0.8)
    rows = (0, 1, 5)
    goal = forward_kinematics(chain, jnp.array([0.2, 1.2]))
    target = transform(
        rotation_from_vector(jnp.array([0, 0, 0.3])) @ goal[:3, :3], goal[:3, 3]
    )
    for step in (PseudoInverseStep(), ErrorDampedStep()):
        found = solve_pose(
            chain,
            target,
            jnp.array([0.4, 1.0]),
            step=step,
            rows=rows,
            throw=False,
            max_steps=300,
        )
        assert found.result == PoseResults.out_of_reach
        actual = forward_kinematics(chain, found.value)
        error = pose_difference(target, actual)[np.array(rows)]
        slope = error @ jacobian(chain, found.value)[np.array(rows)]
        # at rest up to the stall criterion of 1e-11
        assert_close(slope, jnp.zeros(2), rtol=0.0, atol=1e-8)
        assert jnp.linalg.norm(error) > 0.1


@pytest.mark.slow
def test_out_of_reach():
    """The stretched arm points at the target; the damping keeps it from swinging."""
    chain, far = planar(1.0, 1.0), transform(jnp.eye(3), jnp.array([3.0, 0, 0]))
    # squared, more than half the missing metre times the length of the arm
    step = DampedStep(ConstantDamping(1.2))
    find = jax.jit(
        lambda q: solve_pose(
            chain, far, q, step=step, rows=PLANE, max_steps=1000, throw=False
        )
    )
    found = find(jnp.array([0.1, 0.2]))
    assert found.result == PoseResults.out_of_reach
    # it stalls at steps of 1e-11, which shrink by a constant factor
    assert_close(found.value, jnp.zeros(2), rtol=0.0, atol=1e-9)
    assert_close(found.position_error, 1.0, rtol=1e-12)
    assert found.smallest_singular_value < 1e-9
    with pytest.raises(Exception, match="max_steps"):
        solve_pose(chain, far, jnp.array([0.1, 0.2]), rows=PLANE, max_steps=2)


def test_singular_distance():
    chain = kuka()
    wrist = POSE.at[4].set(0.0)
    assert_close(singular_distance(chain, wrist), 0.0, rtol=0.0, atol=1e-15)
    assert singular_distance(chain, POSE) > 0.05
    straight = planar(1.0, 1.0)
    # of the translation alone: [[0, 0], [2, 1]]
    assert_close(
        singular_distance(straight, jnp.zeros(2), rows=PLANE), 0.0, rtol=0.0, atol=1e-15
    )
    with pytest.raises(ValueError, match="rows"):
        singular_distance(chain, POSE, rows=(0, 0))


@pytest.mark.slow
def test_jit_is_vmap_is_loop():
    chain = kuka()
    rng = np.random.default_rng(0)
    poses = POSE[None] + jnp.asarray(rng.uniform(-0.3, 0.3, (4, 6)))
    targets = jax.vmap(lambda q: forward_kinematics(chain, q))(poses)
    one = lambda t: solve_pose(chain, t, START).value
    batch = jax.jit(jax.vmap(one))(targets)
    single = jax.jit(one)
    for k in range(4):
        # rounding of LAPACK-free code in another order of operations
        assert_close(batch[k], single(targets[k]), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    "rows",
    [(0, 1, 2, 3, 4, 5), pytest.param((0, 1, 2), marks=pytest.mark.slow)],
)
def test_gradient(rows):
    """The implicit function, square and redundant."""
    q = jnp.array([0.4, 0.3, -0.5, 0.6, 0.9, -0.2])
    goal = forward_kinematics(puma(), q)

    def function(joints, vector):
        rotation = rotation_from_vector(vector[3:])
        target = transform(rotation @ goal[:3, :3], goal[:3, 3] + vector[:3])
        chain = dataclasses.replace(puma(), joints=joints)
        options = dict(position_tolerance=1e-12, rotation_tolerance=1e-12)
        found = solve_pose(chain, target, q, rows=rows, **options).value
        # what is left free depends on the start: only the tool is a function
        actual = forward_kinematics(chain, found)
        return found if len(rows) == 6 else actual[:3, 3]

    assert_gradient(function, puma().joints, jnp.full(6, 0.05))


@pytest.mark.slow
def test_second_derivative():
    """Elbow of a planar arm by its link lengths."""
    start = jnp.array([0.2, 1.2])
    target = forward_kinematics(planar(1.0, 0.8), start)

    def function(lengths):
        zero = jnp.zeros(2)
        chain = SerialChain.from_dh(zero, zero, lengths, zero)
        options = dict(position_tolerance=1e-13, rows=PLANE)
        return solve_pose(chain, target, start, **options).value

    assert_gradient(function, jnp.array([1.05, 0.82]), order=2)


def test_refusals():
    chain, q = planar(1.0, 1.0), jnp.zeros(2)
    pose = jnp.eye(4)
    with pytest.raises(ValueError, match="rows"):
        solve_pose(chain, pose, q, rows=(6,))
    with pytest.raises(ValueError, match="lower"):
        solve_pose(chain, pose, q, lower=q + 1, upper=q)
