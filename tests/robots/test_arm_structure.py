"""The KR210 at every detail of its structure, manipulators of beams, refusals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import locked_frequencies
from elastax.dynamics import (
    Body,
    NodeRole,
    cut_forces,
    equations_of_motion,
    inverse_dynamics,
    lagrange_forces,
    static_equilibrium,
)
from elastax.inverse import ASIM, FlexibleJointInverse
from elastax.io import load_sid, save_sid
from elastax.kinematics import forward_kinematics
from elastax.robots import (
    BodiesArm,
    HingedArm,
    LumpedArm,
    ModalArm,
    TiltedArm,
    beam_on_joint,
    kr210,
    named_robot,
    one_link_arm,
    quanser_2dsfl,
    three_axis_arm,
    two_beams,
)
from elastax.robots._arm_structure import Member
from elastax.structure import ClampedFree, ModeCounts

from tests.helpers import assert_close
from tests.systems import smooth_reference


Q = jnp.array([0.3, -0.4, 0.5, 0.2, 0.7, 0.1])
DETAILS = {
    "tilted": (TiltedArm(), 4),
    "hinged": (HingedArm(), 8),
    "lumped": (LumpedArm(), 14),
    "modal": (ModalArm(), 10),
}


@pytest.fixture(scope="module")
def robots():
    return {name: kr210(structure) for name, (structure, _) in DETAILS.items()}


@jax.jit
def rigid_blocks(robot):
    none = jnp.zeros(0)
    blocks = equations_of_motion(robot.rigid(), Q, none, Q, Q, none, Q)
    return blocks.M_aa, blocks.h_a


@pytest.mark.slow
def test_undeformed_all_are_one_robot(robots):
    expected = rigid_blocks(robots["hinged"])
    pose = forward_kinematics(robots["hinged"].rigid().chain, Q)
    for name, (_, elastic) in DETAILS.items():
        robot = robots[name]
        assert robot.elastic == elastic == len(robot.elastic_names)
        assert_close(
            forward_kinematics(robot.rigid().chain, Q), pose, atol=1e-14, rtol=0
        )
        for ours, other in zip(rigid_blocks(robot), expected, strict=True):
            size = float(jnp.max(jnp.abs(other)))
            assert_close(ours, other, rtol=0.0, atol=1e-13 * size)


@pytest.mark.slow
def test_eigenfrequencies_of_the_details(robots):
    hertz = {}
    for name, robot in robots.items():
        theta = robot.from_maker(robot.poses["stretched"])
        hertz[name] = np.asarray(jax.jit(locked_frequencies)(robot, theta))[:4]
    # tilting bearings alone are stiffest; members of the same tubes differ by how
    # their mass and the place of bending are modelled: 8 % at most
    assert np.all(hertz["tilted"] > hertz["lumped"])
    for name in ("hinged", "modal"):
        assert_close(hertz[name], hertz["lumped"], rtol=0.08)
    # one mode of each kind is stiffer than segments with the exact tip compliance
    assert np.all(hertz["modal"] >= hertz["lumped"])


@pytest.mark.slow
def test_forces_are_those_of_lagrange(robots):
    robot = robots["modal"]
    n, m = robot.axes, robot.elastic
    draw = np.random.default_rng(1).standard_normal
    size = 1e-3
    shapes = ((n, 1.0), (m, size), (n, 1.0)) * 3
    motion = [jnp.asarray(scale * draw(k)) for k, scale in shapes]
    expected = lagrange_forces(robot, *motion)
    blocks = equations_of_motion(robot, *motion[:6])
    qdd, etadd = motion[6], motion[7]
    joint = blocks.M_aa @ qdd + blocks.M_ae @ etadd + blocks.h_a
    structure = blocks.M_ae.T @ qdd + blocks.M_ee @ etadd + blocks.h_e
    for ours, other in zip((joint, structure), expected[:2], strict=True):
        assert_close(ours, other, rtol=1e-10, atol=1e-10 * float(jnp.abs(other).max()))


@pytest.mark.slow
def test_bodies_from_sid_files(robots, tmp_path):
    source = robots["modal"]
    bodies = []
    for link in source.modal_links:
        position = np.asarray(link.body.nodes.position)
        path = tmp_path / "member.SID_FEM"
        save_sid(path, link.body.moved(np.eye(3), -position[0]))
        body = load_sid(path).modal_body()
        reach = position[-1] - position[0]
        # the arm's frame is that of its joint: its tube runs along -y
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        bodies.append(body if reach[0] > 0.5 else body.moved(turn, np.zeros(3)))
    robot = kr210(BodiesArm(*bodies, base="1", tip="2"))
    theta = source.from_maker(source.poses["stretched"])
    frequencies = jax.jit(locked_frequencies)
    # the files have twelve digits
    assert_close(frequencies(robot, theta), frequencies(source, theta), rtol=1e-9)
    with pytest.raises(ValueError, match="must reach from `1` to `2`"):
        kr210(BodiesArm(bodies[0], bodies[0], base="1", tip="2"))


def test_names_of_the_details():
    assert named_robot("kr210_tilted").elastic == 4
    assert named_robot("kr210_lumped").elastic == 14


def test_cut_forces_are_the_torques_of_the_axes():
    robot = three_axis_arm(ModeCounts(1, 1, 1))
    n, m = robot.axes, robot.elastic
    draw = np.random.default_rng(2).standard_normal
    q, qd, qdd = (jnp.asarray(draw(n)) for _ in range(3))
    eta, etad, etadd = (jnp.asarray(1e-2 * draw(m)) for _ in range(3))
    torque, _ = inverse_dynamics(robot, q, qd, qdd, eta, etad, etadd)
    for axis in range(n):
        joint = robot.axis_joint(axis)
        _, moment = cut_forces(robot, joint, q, eta, qd, etad, qdd, etadd)
        assert_close(moment[2], torque[axis], rtol=1e-10, atol=1e-9)
    still = jnp.zeros(n)
    force, _ = cut_forces(
        robot, robot.axis_joint(0), q, eta, still, 0.0 * eta, still, 0.0 * eta
    )
    bodies = np.asarray(robot.all_bodies().mass)
    mass = bodies.sum() + float(robot.modal_links[0].body.mass)
    assert_close(force, [0.0, 0.0, 9.81 * mass], rtol=1e-12, atol=1e-10)


@jax.jit
def mass_and_stiffness(robot):
    """At zero, of axes and structure."""
    n, m = robot.axes, robot.elastic
    zero, rest = jnp.zeros(n), jnp.zeros(m)

    def forces(x):
        blocks = equations_of_motion(robot, x[:n], x[n:], zero, zero, rest, zero)
        return jnp.concatenate([blocks.h_a, blocks.h_e])

    blocks = equations_of_motion(robot, zero, rest, zero, zero, rest, zero)
    mass = jnp.block([[blocks.M_aa, blocks.M_ae], [blocks.M_ae.T, blocks.M_ee]])
    return mass, jax.jacfwd(forces)(jnp.zeros(n + m))


def planar_frequencies(robot):
    """Of the mass and stiffness at zero, with the axes free."""
    mass, stiffness = map(np.asarray, mass_and_stiffness(robot))
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    return np.sqrt(np.sort(np.maximum(squares, 0.0)))


@pytest.mark.slow
def test_beam_on_a_joint_is_a_pinned_beam():
    # clamped modes and a turning frame, or pinned modes and their root: one beam
    pinned = beam_on_joint(3, tip_mass=0.0)
    assert any(isinstance(role, NodeRole) for role in pinned.roles[:2])
    beta = np.array([3.926602312047919, 7.068582745628732, 10.210176122813031])
    beam_mass = 7850.0 * np.pi * 0.01**2
    exact = beta**2 * np.sqrt(2.1e11 * np.pi * 0.02**4 / 64.0 / beam_mass)
    found = planar_frequencies(pinned)
    # the motor's 1e-6 kg m^2 lower them, the third by 4e-5
    assert_close(found[1:], exact, rtol=1e-4)
    assert np.all(found[1:] < exact)
    many = planar_frequencies(beam_on_joint(8, tip_mass=0.0, support=ClampedFree()))
    assert_close(many[1:3], exact[:2], rtol=2e-3)


def test_manipulators_of_beams():
    pair = two_beams(1)
    assert (pair.axes, pair.elastic) == (2, 2)
    arm = one_link_arm(2, payload=2.0)
    assert arm.has_elastic_gears and arm.elastic == 2
    link = arm.modal_links[0].body
    assert_close(link.mass, 4.0 * 0.7 + 2.0, rtol=1e-12)
    # stiffness of the tip, 3 EI / l^3, from two modes
    stiffness = np.diag(np.asarray(link.K_e))
    tip = np.asarray(link.nodes.phi)[-1, 1]
    assert_close(np.sum(tip**2 / stiffness), 0.7**3 / (3.0 * 0.6), rtol=2e-3)


def test_quanser_inertias_and_springs():
    robot = quanser_2dsfl()
    zero = jnp.zeros(2)
    blocks = equations_of_motion(robot, zero, zero, zero, zero, zero, zero)
    # hub and link of both stages; the second turns with the first
    second = 0.00301955 + 0.0064387
    link = 0.170434272
    assert_close(blocks.M_aa[0, 0], 0.06353616 + link, rtol=1e-12)
    assert_close(blocks.M_aa[1, 1], second, rtol=1e-12)
    assert_close(blocks.M_ee, [[link, 0.0064387], [0.0064387, 0.0064387]], rtol=1e-12)
    spring = robot.structure_stiffness
    assert_close(spring.stiffness(zero), [39.957, 6.858], rtol=1e-14)


@pytest.mark.slow
def test_asim_of_modal_members(robots):
    robot = robots["modal"]
    start = np.asarray(robot.from_maker(robot.poses["stretched"]))
    reference = smooth_reference(start, np.full(6, 0.05), 0.4, dt=2e-3, settle=0.1)
    command = eqx.filter_jit(ASIM().feedforward)(robot, reference)
    aim = forward_kinematics(robot.rigid().chain, reference.derivatives[0, -1])[:3, 3]

    def miss(command):
        q, eta = static_equilibrium(robot, command.theta[-1])
        pose = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))
        return jnp.linalg.norm(pose[:3, 3] - aim)

    sagging = robot.flexible_joint()
    plain = eqx.filter_jit(FlexibleJointInverse().feedforward)(sagging, reference)
    # what is left lies along the stretched arm, where damping holds the correction back
    assert miss(plain) > 3e-3
    assert miss(command) < 0.15 * miss(plain)
    still = lambda r: r.structure_damping
    undamped = eqx.tree_at(still, robot, replace_fn=jnp.zeros_like)
    with pytest.raises(ValueError, match="`structure_damping` of `kr210` must be"):
        ASIM().feedforward(undamped, reference)


def test_members_heavier_than_their_link_are_refused():
    member = Member([], 10.0, np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match="the member in `link` has 10 kg"):
        member.taken_off(Body("link", 5.0, (0.0, 0.0, 0.0), np.eye(3)))
