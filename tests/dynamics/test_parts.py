"""Assembly of robots from parts, their lower levels of detail, and refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import (
    Axis,
    AxisRole,
    Body,
    ElasticJoint,
    ElasticRole,
    EndSlope,
    Offset,
    RigidBodies,
    SlopeRole,
    WristCentre,
    dh_link,
    generalised_forces,
)
from elastax.kinematics import SerialChain, forward_kinematics, moving_frames

from tests import systems
from tests.helpers import assert_close


X, Y, Z = (tuple(row) for row in np.eye(3).tolist())
LUMP = Body("lump", 2.0, (0.1, 0.0, 0.0), np.eye(3))
HOP = Offset((0.5, 0.0, 0.0))


def assembled(parts, axes=1, **options):
    return systems.assembled("robot", parts, systems.drive_train(axes), **options)


def test_roles_and_names():
    robot = systems.elastic_2r()
    assert (robot.axes, robot.elastic, robot.has_elastic_gears) == (2, 2, True)
    assert robot.elastic_names == ("bend 1", "bend 2")
    assert robot.roles == (
        AxisRole(0),
        ElasticRole(0),
        SlopeRole(0, 0),
        AxisRole(1),
        ElasticRole(1),
    )
    joints = robot.joint_coordinates(jnp.array([1.0, 2.0]), jnp.array([0.1, 0.2]))
    assert_close(joints, [1.0, 0.1, 0.05, 2.0, 0.2], rtol=1e-15)


def test_makers_angles():
    robot = assembled([Axis("A1"), LUMP], axis_signs=[-1.0], axis_zeros=[0.3])
    assert_close(robot.from_maker(jnp.array([0.5])), [-0.2], rtol=1e-15)
    assert_close(robot.to_maker(jnp.array([-0.2])), [0.5], rtol=1e-15)


def test_wrist_centre_and_tool():
    tool = np.eye(4)
    tool[:3, 3] = (0.0, 0.0, 0.2)
    parts = [Axis("A1"), LUMP, HOP, WristCentre(), Axis("A2"), LUMP, HOP]
    robot = assembled(parts, 2, tool=tool)
    assert robot.wrist == 1
    pose = forward_kinematics(robot.chain, jnp.zeros((2,)))
    assert_close(pose[:3, 3], [1.0, 0.0, 0.2], rtol=1e-15)
    assert assembled(parts[:3]).wrist == 0
    assert robot.flexible_joint().wrist == 1


def test_denavit_hartenberg_rows():
    """Links with hinges and end slopes keep the kinematics of the table."""
    rows = np.array([[0.3, 0.4, 0.2, -np.pi / 2], [-0.2, 0.1, 0.6, 0.4]])
    parts = []
    for k, row in enumerate(rows):
        hinge = ElasticJoint(f"tilt {k}", X, 1e3, 1.0)
        parts += dh_link(
            f"A{k}", *row, LUMP, hinges=(hinge,), slopes=(EndSlope(hinge.name, 0.5),)
        )
    robot = assembled([*parts, LUMP], 2)
    table = SerialChain.from_dh(*rows.T)
    q = jnp.array([0.7, -1.1])
    stiff = robot.flexible_joint()
    for chain, joints in (
        (robot.chain, robot.joint_coordinates(q, jnp.zeros((2,)))),
        (stiff.chain, q),
    ):
        assert_close(
            forward_kinematics(chain, joints),
            forward_kinematics(table, q),
            rtol=0,
            atol=1e-15,
        )


@pytest.mark.slow
def test_rigid_structure_carries_the_same_bodies():
    """Forces of the flexible-joint robot are those of the undeformed elastic one."""
    robot = systems.random_robot(9, 3, 4, counterbalance=False)
    q, eta, _, qd, etad, _, qdd, etadd, _ = (
        x[0] for x in systems.random_state(robot, 2, 1)
    )
    none = jnp.zeros((0,))
    zero = jnp.zeros_like(eta)

    def both(robot, stiff):
        tool = forward_kinematics(robot.chain, robot.joint_coordinates(q, zero))
        return (
            generalised_forces(robot, q, zero, qd, zero, qdd, zero)[:3],
            generalised_forces(stiff, q, none, qd, none, qdd, none),
            tool,
            forward_kinematics(stiff.chain, q),
        )

    elastic, stiff, tool, same = systems.run(both, robot, robot.flexible_joint())
    assert_close(stiff, elastic, rtol=0, atol=1e-12 * np.abs(elastic).max())
    assert_close(same, tool, rtol=0, atol=1e-13)


def test_payload_at_the_flange():
    robot = assembled([Axis("A1"), LUMP, HOP])
    loaded = robot.with_payload(3.0, (0.0, 0.1, 0.2), np.diag([0.1, 0.2, 0.3]))
    assert_close(loaded.payload.com, [[0.5, 0.1, 0.2]], rtol=1e-15)
    assert_close(loaded.payload.inertia[0], np.diag([0.1, 0.2, 0.3]), rtol=1e-15)
    bare = loaded.with_payload(0.0, np.zeros(3), np.zeros((3, 3)))
    one = jnp.ones((1,))
    none = jnp.zeros((0,))
    forces = jax.jit(generalised_forces)
    without = forces(robot, one, none, one, none, one, none)
    assert_close(forces(bare, one, none, one, none, one, none), without, rtol=1e-14)


def test_bodies_in_front_of_the_first_axis_rest_on_the_ground():
    robot = assembled([LUMP, Axis("A1"), LUMP])
    assert robot.bodies.names == ("lump",)


def test_elastic_axis_in_line_without_inertia_is_named():
    """A hinge in line with the axis, no body between: the mass matrix is singular."""
    hinge = ElasticJoint("twist", Z, 1e4, 1.0)
    with pytest.raises(ValueError, match="A1, twist.*into its gear"):
        assembled([Axis("A1"), hinge, LUMP])
    with pytest.raises(ValueError, match="behind the joints A2"):
        assembled([Axis("A1"), LUMP, Axis("A2")], 2)
    # a body between them is enough
    assert assembled([Axis("A1"), LUMP, hinge, LUMP]).elastic == 1


REFUSALS = {
    "no driven axis": (lambda: assembled([LUMP]), "at least one `Axis`"),
    "unknown hinge": (
        lambda: assembled([Axis("A1"), LUMP, EndSlope("bend", 0.5)]),
        "follows `bend`",
    ),
    "wrong number of drives": (
        lambda: assembled([Axis("A1"), LUMP], 2, axis_signs=[1.0], axis_zeros=[0.0]),
        "one drive train per axis",
    ),
    "structural damping": (
        lambda: assembled([Axis("A1"), LUMP, ElasticJoint("h", Y, 1.0, -1.0)]),
        "`structure_damping` must not be negative",
    ),
    "stiffness": (
        lambda: assembled([Axis("A1"), LUMP, ElasticJoint("h", Y, -1.0, 1.0)]),
        "`linear` must be positive",
    ),
    "negative mass": (
        lambda: assembled([Axis("A1"), Body("hole", -1.0, np.zeros(3), np.eye(3))]),
        "`mass` must not be negative",
    ),
    "negative inertia": (
        lambda: assembled([Axis("A1"), Body("ghost", 1.0, np.zeros(3), -np.eye(3))]),
        "`ghost` must not have negative principal moments",
    ),
    "asymmetric inertia": (
        lambda: assembled(
            [Axis("A1"), Body("skew", 1.0, np.zeros(3), np.eye(3) + np.eye(3, k=1))]
        ),
        "`skew` must be symmetric",
    ),
    "payload without inertia": (
        lambda: assembled([Axis("A1"), LUMP]).with_payload(
            5.0, np.zeros(3), np.zeros((3, 3))
        ),
        "`payload` has a mass of 5 kg but no inertia",
    ),
    "negative payload": (
        lambda: assembled([Axis("A1"), LUMP]).with_payload(
            -5.0, np.zeros(3), np.eye(3)
        ),
        "`mass` must not be negative",
    ),
    "limits": (
        lambda: dataclasses.replace(systems.limits(2), upper=np.array([1.0, -9.0])),
        "`upper` limits",
    ),
    "speed limits": (
        lambda: dataclasses.replace(systems.limits(1), velocity=np.array([0.0])),
        "`velocity` limits must be positive",
    ),
    "number of joints": (
        lambda: RigidBodies([1.0], np.zeros((1, 3)), np.eye(3)[None], (0, 1), ("a",)),
        "`joint` must name",
    ),
    "shape": (
        lambda: RigidBodies([1.0], np.zeros((2, 3)), np.eye(3)[None], (0,), ("a",)),
        "shape",
    ),
}


@pytest.mark.parametrize(("build", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_moving_frames_of_a_prismatic_axis():
    slide = Axis("A1", systems.JointKind.PRISMATIC)
    robot = assembled([slide, LUMP, HOP])
    frames = moving_frames(robot.chain, jnp.array([0.7]))
    assert_close(frames.tool_position, [0.5, 0.0, 0.7], rtol=1e-15)
