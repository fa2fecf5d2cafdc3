"""Forward kinematics against published poses, closed forms and Pinocchio."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    JointKind,
    SerialChain,
    forward_kinematics,
    inverse_transform,
    jacobian,
    link_poses,
    tool_motion,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, kuka, mixed, planar


def test_chain_of_frames():
    case = load_vectors("2.25-2.29")[0]
    chain = SerialChain.from_frames(
        np.tile(np.eye(3), (3, 1, 1)),
        [[0, 0, 0.7], [0.35, 0, 0], [0.9, 0, -0.05]],
        np.eye(3)[::-1],
    )
    q, qd, qdd = (jnp.array(case["inputs"][k]) for k in ("q", "dq", "ddq"))
    expected, tol = case["outputs"], case["tol"]
    pose = forward_kinematics(chain, q)
    assert_close(pose, expected["T03"], rtol=tol)
    assert_close(inverse_transform(pose), expected["T03_inv"], rtol=tol)
    velocity, acceleration = tool_motion(chain, q, qd, qdd)
    into = pose[:3, :3].T
    assert_close(velocity[3:], expected["omega_base"], rtol=tol)
    assert_close(into @ velocity[3:], expected["omega_body"], rtol=tol)
    assert_close(into @ velocity[:3], expected["v_body"], rtol=tol)
    assert_close(into @ acceleration[:3], expected["a_body"], rtol=tol)


@pytest.mark.parametrize("case", load_vectors("003 (3-45)-(3-97)"), ids="12")
def test_fanuc_poses(case):
    chain, q = fanuc(), jnp.array(case["inputs"]["theta"])
    tol = case["tol"]
    # printed digits of lengths in mm
    pose = forward_kinematics(chain, q)
    assert_close(pose, case["outputs"]["T06"], rtol=tol, atol=tol)
    poses = link_poses(chain, q)
    if "T03" in case["outputs"]:
        assert_close(poses[2], case["outputs"]["T03"], rtol=tol, atol=tol)
    assert_close(poses[5], pose, rtol=1e-14)


def test_fanuc_machine_zero():
    case = load_vectors("003 Tab 3-5")[0]
    pose = forward_kinematics(fanuc(), jnp.array(case["inputs"]["theta_DH"], float))
    assert_close(pose, case["outputs"]["T06"], rtol=1e-9, atol=1e-9)


def test_kuka_signs():
    case = load_vectors("A.6 / 3.53 sign convention")[0]
    inputs, expected = case["inputs"], case["outputs"]
    angles = np.deg2rad([inputs["A1_deg"], inputs["A2_deg"], inputs["A3_deg"]])
    chain = SerialChain.from_frames(
        np.tile(np.eye(3), (4, 1, 1)),
        [[0, 0, 0], [0, 0, 0], [inputs["l1"], 0, 0], [inputs["l2"], 0, 0]],
        [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0]],
    )
    pose = forward_kinematics(chain, jnp.array([*angles, 0.0]))
    names = "x_base", "y_base", "z"
    assert_close(pose[:3, 3], [expected[name] for name in names], rtol=case["tol"])


def test_planar_closed_form():
    q = jnp.array([0.4, -1.3, 0.9])
    lengths, sums = jnp.array([1.0, 0.7, 0.2]), jnp.cumsum(q)
    pose = forward_kinematics(planar(*lengths.tolist()), q)
    expected = [lengths @ jnp.cos(sums), lengths @ jnp.sin(sums), 0.0]
    assert_close(pose[:3, 3], jnp.stack([jnp.asarray(x) for x in expected]), rtol=1e-14)


def test_prismatic_closed_form():
    # an arm that turns about z, rises along z and reaches along x
    kinds = JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.PRISMATIC
    chain = SerialChain.from_frames(
        np.tile(np.eye(3), (3, 1, 1)),
        [[0, 0, 0.5], [0, 0, 0], [0.2, 0, 0]],
        [[0, 0, 1], [0, 0, 1], [1, 0, 0]],
        kinds=kinds,
    )
    turn, rise, reach = 0.6, 0.3, 0.4
    pose = forward_kinematics(chain, jnp.array([turn, rise, reach]))
    expected = [0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.8]
    assert_close(pose[:3, 3], expected, rtol=1e-14)
    columns = np.array([[-expected[1], expected[0], 0], [0, 0, 1], [0.0] * 3]).T
    columns[:2, 2] = np.cos(turn), np.sin(turn)
    expected = np.concatenate([columns, np.zeros((3, 3))])
    expected[5, 0] = 1.0
    assert_close(
        jacobian(chain, jnp.array([turn, rise, reach])),
        expected,
        rtol=1e-14,
        atol=1e-16,
    )


@pytest.mark.parametrize("chain", [mixed(), kuka()], ids=["mixed", "kuka"])
def test_pinocchio_agrees(chain):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    from benchmarks.peers.pinocchio import TOOL, chain_model

    model = chain_model(chain)
    frame = model.getFrameId(TOOL)
    data = model.createData()
    q, qd, qdd = np.random.default_rng(7).uniform(-1, 1, (3, chain.number))
    pin.forwardKinematics(model, data, q, qd, qdd)
    pin.updateFramePlacements(model, data)

    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    pose = data.oMf[frame].homogeneous
    matrix = pin.computeFrameJacobian(model, data, q, frame, world)
    velocity = pin.getFrameVelocity(model, data, frame, world).vector
    motion = pin.getFrameClassicalAcceleration(model, data, frame, world).vector
    q, qd, qdd = jnp.asarray(q), jnp.asarray(qd), jnp.asarray(qdd)
    assert_close(forward_kinematics(chain, q), pose, rtol=1e-12, atol=1e-13)
    assert_close(jacobian(chain, q), matrix, rtol=1e-12, atol=1e-13)
    ours = tool_motion(chain, q, qd, qdd)
    assert_close(ours, (velocity, motion), rtol=1e-11, atol=1e-12)


def test_jit_vmap_and_loop_agree():
    chain = mixed()
    batch = jnp.asarray(np.random.default_rng(0).uniform(-3, 3, (4, 5)))
    loop = jnp.stack([forward_kinematics(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(forward_kinematics, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
def test_gradient():
    q = jnp.array([0.3, -0.5, 0.7, 0.2, -0.9])
    assert_gradient(forward_kinematics, mixed(), q)
    assert_gradient(forward_kinematics, fanuc(1e-3), jnp.arange(6.0) / 3, order=2)


def test_whole_turns_and_zero():
    chain, q = kuka(), jnp.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    # the rounding of 1e5 turns is 1e-10
    turns = q + 2 * np.pi * 1e5
    pose = forward_kinematics(chain, q)
    assert_close(forward_kinematics(chain, turns), pose, rtol=0.0, atol=1e-9)
    tiny = forward_kinematics(chain, jnp.full(6, 1e-300))
    assert_close(tiny, forward_kinematics(chain, jnp.zeros(6)), rtol=0.0, atol=1e-15)
