"""Joint torques and wrenches: power balance, published moments, compliance."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SerialChain,
    analytic_jacobian,
    forward_kinematics,
    generalised_wrench,
    jacobian,
    joint_torques,
    rpy_from_rotation,
    tool_compliance,
    tool_stiffness,
    transform,
    wrench_about,
    wrench_from_generalised,
    wrench_from_joint_torques,
    wrench_to_base,
    wrench_to_tool,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import kuka, mixed, planar


Q = jnp.array([0.3, -1.1, 0.9, 0.4, 0.8, -0.6])
WRENCH = jnp.array([120.0, -45.0, 300.0, 12.0, 30.0, -8.0])
STIFFNESS = jnp.array([2e6, 1.5e6, 1e6, 2e5, 1.5e5, 1e5])

estimate = jax.jit(wrench_from_joint_torques)
compliance = jax.jit(tool_compliance)


def test_power_balance():
    """(3-114): power at the tool is that of the joints, also of sliding ones."""
    for chain in (kuka(), mixed()):
        q, qd = Q[: chain.number], WRENCH[: chain.number] / 100
        velocity = jacobian(chain, q) @ qd
        power = joint_torques(chain, q, WRENCH) @ qd
        assert_close(power, WRENCH @ velocity, rtol=1e-13)


def test_generalised_forces_give_the_same_torques():
    """(3-118) as printed, with the pose in roll-pitch-yaw angles."""
    chain = kuka()
    rpy = rpy_from_rotation(forward_kinematics(chain, Q)[:3, :3])
    generalised = generalised_wrench(rpy, WRENCH)
    torques = analytic_jacobian(chain, Q, throw=False).T @ generalised
    assert_close(torques, joint_torques(chain, Q, WRENCH), rtol=1e-12)
    assert_close(wrench_from_generalised(rpy, generalised), WRENCH, rtol=1e-13)


def test_published_generalised_moment():
    case = load_vectors("003 (3-114)-(3-118)")[0]
    rpy, moment = (jnp.array(case["inputs"][k]) for k in ("Theta", "m_base"))
    force = jnp.array([1.0, 2.0, 3.0])
    found = generalised_wrench(rpy, jnp.concatenate([force, moment]))
    assert_close(found[:3], force, rtol=0.0)
    expected = case["outputs"]["generalised_moment"]
    assert_close(found[3:], expected, rtol=case["tol"])


def test_frames_of_a_wrench():
    chain = kuka()
    pose = forward_kinematics(chain, Q)
    inside = wrench_to_tool(pose, WRENCH)
    assert_close(wrench_to_base(pose, inside), WRENCH, rtol=1e-14)
    # a force along the tool's z is along the third column
    along = wrench_to_base(pose, jnp.array([0.0, 0, 1, 0, 0, 0]))
    assert_close(along[:3], pose[:3, 2], rtol=1e-15)
    # another point of the tool: the same torques from the moment about it
    offset = jnp.array([0.1, -0.2, 0.3])
    tool = chain.tool @ transform(jnp.eye(3), offset)
    longer = SerialChain(chain.joints, chain.base, tool, chain.kinds)
    other = forward_kinematics(longer, Q)[:3, 3]
    moved = wrench_about(WRENCH, pose[:3, 3], other)
    torques = joint_torques(longer, Q, moved)
    assert_close(torques, joint_torques(chain, Q, WRENCH), rtol=1e-12)


def test_wrench_from_torques():
    chain = kuka()
    found = estimate(chain, Q, joint_torques(chain, Q, WRENCH))
    assert_close(found.value, WRENCH, rtol=1e-11)
    assert int(found.rank) == 6
    assert_close(found.undetermined, jnp.zeros((6, 6)), rtol=0.0, atol=1e-12)
    # the residual is a difference of torques of 1000 N m
    assert_close(found.residual, jnp.zeros(6), rtol=0.0, atol=1e-11)


def test_singular_pose_carries_a_wrench_without_torques():
    """Axes 4 and 6 aligned: a moment about the normal of the wrist plane is free."""
    chain, q = kuka(), Q.at[4].set(0.0)
    matrix = jacobian(chain, q)
    found = estimate(chain, q, joint_torques(chain, q, WRENCH))
    assert int(found.rank) == 5
    assert_close(matrix.T @ found.value, matrix.T @ WRENCH, rtol=1e-10, atol=1e-10)
    carried = found.undetermined @ WRENCH
    assert float(jnp.linalg.norm(carried)) > 1.0
    assert_close(matrix.T @ carried, jnp.zeros(6), rtol=0.0, atol=1e-10)
    assert_close(found.value + carried, WRENCH, rtol=1e-10, atol=1e-10)


def test_planar_arm_and_redundant_arm():
    """Two joints know two components; of four torques one is explained by none."""
    two = planar(0.5, 0.4)
    q = jnp.array([0.4, 0.9])
    found = estimate(two, q, jnp.array([3.0, -1.0]))
    assert int(found.rank) == 2
    torques = joint_torques(two, q, found.value)
    assert_close(torques, jnp.array([3.0, -1.0]), rtol=1e-12)
    four = planar(0.5, 0.4, 0.3, 0.2)
    q = jnp.array([0.4, 0.9, -0.5, 0.3])
    found = estimate(four, q, jnp.array([3.0, -1.0, 0.5, 2.0]))
    assert int(found.rank) == 3
    assert_close(jacobian(four, q) @ found.residual, jnp.zeros(6), rtol=0.0, atol=1e-13)
    assert float(jnp.linalg.norm(found.residual)) > 0.1


def test_compliance_of_a_lever():
    """One joint: a force across the lever l moves its end by l^2/k."""
    chain, q = planar(2.0), jnp.zeros(1)
    found = compliance(chain, q, jnp.array([500.0]))
    expected = np.zeros((6, 6))
    expected[1, 1], expected[1, 5], expected[5, 5] = 4 / 500, 2 / 500, 1 / 500
    expected[5, 1] = expected[1, 5]
    assert_close(found, expected, rtol=1e-14, atol=1e-18)


@pytest.mark.slow
def test_stiffness_inverts_the_compliance():
    chain = kuka()
    stiff = eqx.filter_jit(tool_stiffness)(chain, Q, STIFFNESS)
    soft = compliance(chain, Q, STIFFNESS)
    # condition number of the compliance, 1e4, times rounding
    assert_close(stiff @ soft, jnp.eye(6), rtol=0.0, atol=1e-10)
    matrix = np.linalg.inv(np.asarray(jacobian(chain, Q)))
    expected = matrix.T @ np.diag(np.asarray(STIFFNESS)) @ matrix
    scale = float(jnp.max(jnp.abs(stiff)))
    assert_close(stiff, expected, rtol=0.0, atol=1e-10 * scale)
    tip = eqx.filter_jit(tool_stiffness)(chain, Q, STIFFNESS, rows=(0, 1, 2))
    assert_close(jnp.linalg.inv(tip), soft[:3, :3], rtol=1e-9, atol=1e-18)


def test_rigid_joints_and_singular_poses():
    chain = kuka()
    rigid = compliance(chain, Q, jnp.full(6, jnp.inf), WRENCH)
    assert_close(rigid, jnp.zeros((6, 6)), rtol=0.0)
    with pytest.raises(eqx.EquinoxRuntimeError, match="away from singular"):
        eqx.filter_jit(tool_stiffness)(chain, Q.at[4].set(0.0), STIFFNESS)


@pytest.mark.slow
def test_compliance_under_load_is_that_of_the_equilibrium():
    """Second route: the equilibrium of springs and load, differentiated by the load."""
    chain, soft = kuka(), STIFFNESS / 100
    rest = Q - joint_torques(chain, Q, WRENCH) / soft  # springs at rest

    def settle(wrench):
        step = lambda _, q: rest + joint_torques(chain, q, wrench) / soft
        return jax.lax.fori_loop(0, 15, step, Q)

    def moved(wrench):
        pose = forward_kinematics(chain, settle(wrench))
        start = forward_kinematics(chain, Q)
        turn = pose[:3, :3] @ start[:3, :3].T
        vee = jnp.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0]])
        vee = jnp.append(vee, turn[1, 0] - turn[0, 1]) / 2
        return jnp.concatenate([pose[:3, 3], vee])

    expected = jax.jit(jax.jacfwd(moved))(WRENCH)
    found = compliance(chain, Q, soft, WRENCH)
    scale = float(jnp.max(jnp.abs(expected)))
    # each step of the iteration leaves a few per cent of the error
    assert_close(found, expected, rtol=0.0, atol=1e-11 * scale)
    plain = compliance(chain, Q, soft)
    assert float(jnp.max(jnp.abs(found - plain))) > 1e-3 * scale


def test_gimbal_lock_of_generalised_forces():
    rpy, generalised = jnp.array([0.4, np.pi / 2, 1.1]), WRENCH
    with pytest.raises(eqx.EquinoxRuntimeError, match="not determined"):
        eqx.filter_jit(wrench_from_generalised)(rpy, generalised)


@pytest.mark.slow
def test_gradient_and_batches():
    chain = kuka()
    small = planar(0.5, 0.4, 0.3)
    assert_gradient(
        lambda *x: tool_compliance(small, *x), Q[:3], STIFFNESS[:3] / 1e3, WRENCH
    )
    # of constant rank, here 5
    aligned = lambda wrist, torques: (
        wrench_from_joint_torques(
            chain, Q.at[:4].add(wrist).at[4].set(0.0), torques
        ).value
    )
    torques = joint_torques(chain, Q, WRENCH)
    assert_gradient(aligned, jnp.array([0.1, 0.2, 0.1, 0.3]), torques)
    batch = jnp.stack([Q, Q.at[4].set(0.0), 2 * Q])
    loop = jnp.stack([estimate(chain, q, torques).value for q in batch])
    mapped = jax.jit(jax.vmap(wrench_from_joint_torques, (None, 0, None)))
    assert_close(mapped(chain, batch, torques).value, loop, rtol=1e-9, atol=1e-9)
