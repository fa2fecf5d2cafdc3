"""Joint conventions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DHJoints,
    FrameJoints,
    JointKind,
    RPYJoints,
    SerialChain,
    forward_kinematics,
    rotation_from_rpy,
)

from tests.helpers import assert_close, load_vectors


def test_dh_matrix():
    case = load_vectors("003 Tab 3-2/3-3/3-4")[0]
    theta, d, a, alpha = (
        np.array([case["inputs"][k]]) for k in ("Theta", "d", "a", "alpha")
    )
    chain = SerialChain.from_dh(0 * theta, d, a, alpha)
    pose = forward_kinematics(chain, jnp.asarray(theta))
    assert_close(pose, case["outputs"]["DH"], rtol=case["tol"], atol=1e-11)
    # an offset and the coordinate add up; so do they for a prismatic joint
    offset = SerialChain.from_dh(theta - 0.2, d, a, alpha)
    assert_close(forward_kinematics(offset, jnp.array([0.2])), pose, rtol=1e-12)
    slide = SerialChain.from_dh(theta, d - 0.5, a, alpha, kinds=[JointKind.PRISMATIC])
    assert_close(forward_kinematics(slide, jnp.array([0.5])), pose, rtol=1e-12)


def test_roll_pitch_yaw_and_frames_agree():
    rng = np.random.default_rng(0)
    position, rpy = rng.standard_normal((2, 4, 3))
    axis = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0.8, 0]])
    joints = RPYJoints(position, rpy, axis)
    rotation = jax.vmap(rotation_from_rpy)(jnp.asarray(rpy))
    assert_close(
        joints.frames(), FrameJoints(rotation, position, axis).frames(), rtol=1e-15
    )
    assert joints.number() == 4


def test_refusals():
    zero = np.zeros(3)
    with pytest.raises(ValueError, match="agreeing"):
        DHJoints(zero, zero, np.zeros(2), zero)
    axis = np.array([[0.0, 0, 2]])
    identity, origin = np.eye(3)[None], np.zeros((1, 3))
    with pytest.raises(ValueError, match="unit vectors"):
        FrameJoints(identity, origin, axis)
    with pytest.raises(ValueError, match="unit vectors"):
        RPYJoints(origin, origin, axis)
    with pytest.raises(ValueError, match="orthogonal"):
        FrameJoints(2 * identity, origin, axis / 2)
    with pytest.raises(ValueError, match="one kind per joint"):
        SerialChain.from_dh(zero, zero, zero, zero, kinds=[JointKind.REVOLUTE])
