"""Joints with structure: the same chain as with all numbers as parameters."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import (
    Axis,
    Body,
    ElasticJoint,
    Offset,
    assemble,
    inverse_dynamics,
)
from elastax.kinematics import (
    SAME,
    FrameJoints,
    JointKind,
    JointStructure,
    Placement,
    SerialChain,
    StructuredJoints,
    forward_kinematics,
    jacobian,
    placement,
    placements,
    structured,
)
from elastax.robots import kr210

from tests import systems
from tests.helpers import assert_close, assert_gradient


IDENTITY = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SKEW = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
Z, INCLINED = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.6, 0.8])


def three_joints() -> StructuredJoints:
    """One in the same place, one displaced and turned by numbers, one inclined."""
    place = Placement(SKEW, np.array([0.3, -0.2, 0.1]))
    return structured(
        [
            (Placement(QUARTER, None), (Z, True)),
            (place, (-Z, True)),
            (Placement(QUARTER.T, np.array([0.0, 0.4, 0.0])), (INCLINED, True)),
        ]
    )


def as_frames(joints) -> FrameJoints:
    frames = joints.frames()
    return FrameJoints(frames.before[:, :3, :3], frames.before[:, :3, 3], frames.axis)


def chain_of(joints) -> SerialChain:
    kinds = (JointKind.REVOLUTE,) * joints.number()
    return SerialChain(joints, jnp.eye(4), jnp.eye(4), kinds)


def test_right_angles_and_common_origins_are_structure():
    joints = three_joints()
    quarter = tuple(map(tuple, QUARTER.astype(int).tolist()))
    back = tuple(map(tuple, QUARTER.T.astype(int).tolist()))
    assert joints.structure == (
        JointStructure(quarter, (0, 0, 1), False),
        JointStructure(None, (0, 0, -1), True),
        JointStructure(back, None, True),
    )
    assert_close(joints.rotation, SKEW[None], rtol=0)
    assert_close(joints.position, [[0.3, -0.2, 0.1], [0.0, 0.4, 0.0]], rtol=0)
    assert_close(joints.axis, INCLINED[None], rtol=0)


def test_rounding_of_right_angles_is_cleaned():
    angle = np.pi / 2
    turn = np.array([[np.cos(angle), -1.0, 0], [1.0, np.cos(angle), 0], [0, 0, 1.0]])
    (known,) = structured([(Placement(turn, None), (Z, True))]).structure
    assert known.rotation == tuple(map(tuple, QUARTER.astype(int).tolist()))
    (known,) = structured([(Placement(turn + 1e-9, None), (Z, True))]).structure
    assert known.rotation is None


def test_frames_are_those_of_the_parameters():
    """Traced and not; what a parameter could have been is the same number."""
    joints = three_joints()
    traced = jax.jit(lambda j: j.frames())(joints)
    assert_close(traced, joints.frames(), rtol=0)
    q = jnp.array([0.3, -0.7, 1.1])
    one, other = chain_of(joints), chain_of(as_frames(joints))
    for function in (forward_kinematics, jacobian):
        assert_close(function(one, q), function(other, q), rtol=1e-14, atol=1e-15)


@pytest.mark.slow
def test_robot_is_that_of_the_parameters():
    """Inverse dynamics of the KR210 with all placements as parameters."""
    robot = kr210()
    chain = dataclasses.replace(robot.chain, joints=as_frames(robot.chain.joints))
    general = dataclasses.replace(robot, chain=chain)
    assert robot.chain.joints.rotation.shape == (0, 3, 3)
    assert robot.chain.joints.position.shape[0] < robot.chain.number
    q, eta, _, qd, etad, _, qdd, etadd, _ = systems.random_state(robot, 3, 2)
    torques = jax.jit(jax.vmap(inverse_dynamics, (None, *[0] * 6)))
    state = q, qd, qdd, eta, etad, etadd
    for a, b in zip(torques(robot, *state), torques(general, *state)):
        assert_close(a, b, rtol=0, atol=1e-12 * float(jnp.max(jnp.abs(b))))


def test_gradient_by_what_is_left():
    joints, q = three_joints(), jnp.array([0.3, -0.7, 1.1])

    def pose(position, rotation, axis):
        moved = dataclasses.replace(
            joints, position=position, rotation=rotation, axis=axis
        )
        return forward_kinematics(chain_of(moved), q)

    assert_gradient(pose, joints.position, joints.rotation, joints.axis)


def _robot(*parts):
    body = Body("link", 3.0, (0.1, 0.02, 0.0), 0.1 * np.eye(3))
    return assemble(
        "arm",
        [*parts, body],
        systems.drive_train(1),
        systems.limits(1),
        axis_signs=[1.0],
        axis_zeros=[0.0],
        poses={"zero": [0.0]},
    )


def test_offsets_tell_structure_from_parameters():
    hinge = ElasticJoint("hinge", (0.0, 1.0, 0.0), 1e4, 10.0)
    robot = _robot(Offset(rotation=QUARTER), Axis("A1"), Offset((0.0,) * 3), hinge)
    quarter = tuple(map(tuple, QUARTER.astype(int).tolist()))
    assert robot.chain.joints.structure == (
        JointStructure(quarter, (0, 0, 1), False),
        JointStructure(IDENTITY, (0, 1, 0), True),
    )
    inclined = dataclasses.replace(hinge, axis=tuple(INCLINED))
    robot = _robot(Axis("A1"), Offset((0.2, 0, 0), SKEW), inclined)
    assert robot.chain.joints.structure[1] == JointStructure(None, None, True)


@pytest.mark.parametrize("traced", [False, True])
def test_locked_joints_leave_structure(traced):
    """Without its hinges the KR210 stays one of right angles, its tool where it was."""
    robot = kr210()
    rigid = eqx.filter_jit(lambda r: r.rigid())(robot) if traced else robot.rigid()
    assert [k.rotation is None for k in rigid.chain.joints.structure] == [
        True,  # the base's pose is a parameter
        *[False] * 5,
    ]
    q = jnp.array([0.3, -0.7, 1.1, 0.2, 0.5, -0.4])
    joints = robot.joint_coordinates(q, jnp.zeros((robot.elastic,)))
    expected = forward_kinematics(robot.chain, joints)
    assert_close(forward_kinematics(rigid.chain, q), expected, rtol=1e-13, atol=1e-13)
    assert jax.tree.structure(rigid) == jax.tree.structure(robot.rigid())


def test_placements_follow_each_other():
    one = Placement(QUARTER, np.array([1.0, 0.0, 0.0]))
    other = Placement(SKEW, np.array([0.0, 2.0, 0.0]), False)
    both = one.then(other)
    expected = one.matrix(float) @ other.matrix(float)
    assert_close(both.matrix(float), expected, rtol=1e-15)
    assert not both.is_structure and one.then(SAME).is_structure
    assert_close(one.then(SAME).position, one.position, rtol=0)
    assert SAME.then(Placement(QUARTER, None)).position is None
    (found, (axis, known), after), *_ = placements(as_frames(three_joints()))
    assert not found.is_structure and not known and not after.is_structure
    assert_close(found.rotation, QUARTER, rtol=0)
    assert not placement(np.eye(4)).is_structure


def test_rows_that_do_not_fit_the_structure_are_refused():
    joints = three_joints()
    with pytest.raises(ValueError, match="`position` must have one row for each of"):
        dataclasses.replace(joints, position=jnp.zeros((3, 3)))
