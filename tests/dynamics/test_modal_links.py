"""Flexible bodies in a chain: Lagrange, Newton-Euler, energy, free fall, refusals."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import written_out
from elastax._taylor import Series, from_derivatives
from elastax.dynamics import (
    Axis,
    Body,
    ElasticJoint,
    FlexibleLink,
    NodeRole,
    Offset,
    dissipated_power,
    equations_of_motion,
    forward_dynamics,
    generalised_forces,
    inverse_dynamics,
    kinetic_energy,
    lagrange_forces,
    potential_energy,
)
from elastax.dynamics._screws import forces_by_screws
from elastax.kinematics import forward_kinematics
from elastax.structure import (
    NOMINAL,
    VARIANT_1,
    VARIANT_4,
    VARIANT_5,
    BodyNodes,
    point_mass_body,
)

from tests.helpers import assert_close, assert_gradient
from tests.systems import assembled, drive_train


TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def bending_body(modes, seed, damping=0.3):
    """Six masses along x that move with the square of their distance from the clamp."""
    draw = np.random.default_rng(seed).standard_normal
    c = np.linspace(0.0, 1.0, 6)[:, None] * np.array([1.0, 0.0, 0.0])
    x = c[:, :1, None]
    phi, psi = draw((6, 3, modes)) * x**2, draw((6, 3, modes)) * x
    curved = draw((6, 3, modes, modes)) * x[..., None] ** 2
    ends = [0, 5]
    nodes = BodyNodes(
        c[ends], phi[ends], psi[ends], np.zeros((2, 3, modes, modes)), ("base", "tip")
    )
    return point_mass_body(
        np.full(6, 2.0),
        c,
        phi,
        np.diag(400.0 * (1.0 + np.arange(modes))),
        damping=damping * np.eye(modes),
        curvatures=curved + np.swapaxes(curved, 2, 3),
        discs=np.tile(0.01 * np.eye(3), (6, 1, 1)),
        rotations=psi,
        nodes=nodes,
        mode_names=tuple(f"m{k + 1}" for k in range(modes)),
    )


def arm(detail=NOMINAL, damping=0.3, **options):
    """Two axes, two flexible links, a tilt joint and rigid bodies."""
    parts = [
        Offset((0.0, 0.0, 0.3)),
        Axis("A1"),
        Offset((0.1, 0.0, 0.2), TURN),
        FlexibleLink("one", bending_body(2, 0, damping).with_detail(detail), "tip"),
        Offset((0.1, 0.0, 0.0)),
        Axis("A2"),
        ElasticJoint("tilt", (1.0, 0.0, 0.0), 1e4, 10.0),
        Body("hub", 3.0, (0.1, 0.2, 0.0), np.diag([0.1, 0.2, 0.25])),
        FlexibleLink("two", bending_body(3, 1, damping).with_detail(detail), "tip"),
        Body("tool", 1.0, (0.1, 0.0, 0.0), np.diag([0.1, 0.2, 0.25])),
    ]
    options = {"damping": 20.0, "joint_friction": 2.0} | options
    return assembled("flexible", parts, drive_train(2, **options))


ROBOT = arm()
N, M = ROBOT.axes, ROBOT.elastic
generator = np.random.default_rng(5)
SHAPES = (N, M, N, N, M, N, N, M, N)
MOTION = tuple(jnp.asarray(0.3 * generator.standard_normal(n)) for n in SHAPES)
Q, ETA, THETA, QD, ETAD, THETAD, QDD, ETADD, THETADD = MOTION
STATE = MOTION[:6]
blocks_of = jax.jit(equations_of_motion)


def by_blocks(robot, q, eta, theta, qd, etad, thetad, qdd, etadd):
    blocks = blocks_of(robot, q, eta, theta, qd, etad, thetad)
    joint = blocks.M_aa @ qdd + blocks.M_ae @ etadd + blocks.h_a
    return joint, blocks.M_ae.T @ qdd + blocks.M_ee @ etadd + blocks.h_e


def test_coordinates_and_joints():
    assert (N, M) == (2, 6)
    assert ROBOT.elastic_names[:3] == ("one: m1", "one: m2", "tilt")
    assert sum(isinstance(role, NodeRole) for role in ROBOT.roles) == 12
    assert [link.first for link in ROBOT.modal_links] == [0, 3]


@pytest.mark.slow
def test_forces_are_those_of_lagrange():
    expected = lagrange_forces(ROBOT, *MOTION)
    ours = by_blocks(ROBOT, *MOTION[:8])
    for force, other in zip(ours, expected[:2], strict=True):
        assert_close(force, other, rtol=1e-12, atol=1e-11)


def test_recursion_and_screws_agree():
    recursion = generalised_forces(ROBOT, Q, ETA, QD, ETAD, QDD, ETADD)
    screws = forces_by_screws(ROBOT, Q, ETA, QD, ETAD, QDD, ETADD)
    assert_close(recursion, screws, rtol=1e-12, atol=1e-11)


@pytest.mark.slow
def test_forward_undoes_inverse_dynamics():
    tau = jnp.array([3.0, -2.0])
    qdd, etadd, _ = forward_dynamics(ROBOT, *STATE, tau)
    joint, structure = by_blocks(ROBOT, *STATE, qdd, etadd)
    # forces of 1e4 N m turned into accelerations of 1e3 by masses down to 0.7
    assert_close(joint, jnp.zeros(N), rtol=0.0, atol=1e-8)
    assert_close(structure, jnp.zeros(M), rtol=0.0, atol=1e-8)


def test_mass_matrix_is_positive_at_random_states():
    for seed in range(5):
        draw = np.random.default_rng(seed).standard_normal
        eta = jnp.asarray(0.1 * draw(M))
        state = (jnp.asarray(3.0 * draw(N)), eta, *STATE[2:])
        blocks = blocks_of(ROBOT, *state)
        mass = jnp.block([[blocks.M_aa, blocks.M_ae], [blocks.M_ae.T, blocks.M_ee]])
        assert jnp.min(jnp.linalg.eigvalsh(mass)) > 0.1


def test_tip_follows_the_node():
    # displacement and small rotations of the tip of the first body
    link = ROBOT.modal_links[0]
    eta = 1e-6 * jnp.arange(1.0, M + 1)
    q = jnp.zeros(N)
    pose = lambda eta: forward_kinematics(ROBOT.chain, ROBOT.joint_coordinates(q, eta))
    first = jax.jacfwd(pose)(0.0 * eta)[:3, 3, :2]
    body = link.body
    lever = np.asarray(pose(0.0 * eta))[:3, 3] - [0.1, 0.0, 0.5]
    # frames of the joint that carries it stand straight at q = 0, but for the height
    lever = lever - np.asarray(body.nodes.position)[1] + [0.1, 0.0, 0.2]
    psi = np.asarray(body.nodes.psi)[1]
    expected = np.asarray(body.nodes.phi)[1] + np.cross(psi.T, lever).T
    assert_close(first, expected, rtol=1e-10, atol=1e-12)


def test_free_fall_leaves_the_modes_at_rest():
    # accelerations of the base are weights: falling freely, nothing is left to bend
    zero = jnp.zeros
    still = Q, zero(M), zero(N), zero(M), zero(N), zero(M)
    falling = dataclasses.replace(ROBOT, gravity=jnp.zeros(3))
    assert_close(generalised_forces(falling, *still), zero(N + M), rtol=0.0, atol=0.0)
    # the weight of the robot bends it: C_t times it, and that of the payload by phi
    lone = link_with(BODY, node=None, tool=False)
    weight = generalised_forces(
        lone, zero(1), zero(2), zero(1), zero(2), zero(1), zero(2)
    )
    expected = BODY.C_t0 @ jnp.array([0.0, 0.0, 9.81])
    assert_close(weight[1:], expected, rtol=1e-13)


@pytest.mark.slow
def test_energy_is_kept():
    robot = arm(damping=0.0, joint_friction=0.0)
    robot = eqx.tree_at(
        lambda r: (r.structure_damping, r.drives.damping),
        robot,
        replace_fn=jnp.zeros_like,
    )

    def energy(x):
        q, eta, theta, qd, etad, thetad = x
        kinetic = kinetic_energy(robot, q, eta, qd, etad, thetad)
        return kinetic + potential_energy(robot, q, eta, theta)

    def rates(x):
        accelerations = forward_dynamics(robot, *x, jnp.zeros(N))
        return (*x[3:], *accelerations)

    def advance(x, _):
        h = 1e-4
        plus = lambda k, factor: jax.tree.map(lambda a, b: a + factor * b, x, k)
        k1 = rates(x)
        k2 = rates(plus(k1, 0.5 * h))
        k3 = rates(plus(k2, 0.5 * h))
        k4 = rates(plus(k3, h))
        step = lambda a, b, c, d, e: a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e)
        new = jax.tree.map(step, x, k1, k2, k3, k4)
        return new, energy(new)

    eta = 0.02 * ETA
    start = (Q, eta, Q, 3.0 * QD, 0.0 * ETAD, 3.0 * QD)
    _, energies = jax.jit(lambda x: jax.lax.scan(advance, x, None, length=20000))(start)
    kinetic = kinetic_energy(robot, Q, eta, 3.0 * QD, 0.0 * ETAD, 3.0 * QD)
    # two seconds of large motion; the integrator's own error at h w = 0.02
    assert jnp.max(jnp.abs(energies - energy(start))) < 1e-6 * kinetic


@pytest.mark.slow
def test_lost_power_balances_the_energy():
    tau = jnp.array([30.0, -20.0])
    q, eta, theta, qd, etad, thetad = STATE
    accelerations = forward_dynamics(ROBOT, *STATE, tau)

    def energy(q, eta, theta, qd, etad, thetad):
        kinetic = kinetic_energy(ROBOT, q, eta, qd, etad, thetad)
        return kinetic + potential_energy(ROBOT, q, eta, theta)

    _, rate = jax.jvp(energy, STATE, (qd, etad, thetad, *accelerations))
    lost = dissipated_power(ROBOT, q, theta, qd, etad, thetad)
    assert_close(rate, tau @ thetad - lost, rtol=1e-9)


@pytest.mark.slow
def test_series_are_time_derivatives():
    def along(t):
        power = jnp.array([1.0, t, t**2 / 2.0, t**3 / 6.0])
        q = jnp.einsum("k,kn->n", power, jnp.stack([Q, QD, QDD, QDD]))
        eta = jnp.einsum("k,kn->n", power, jnp.stack([ETA, ETAD, ETADD, ETADD]))
        return q, eta

    def forces(t):
        one = jnp.ones_like(t)
        rate = lambda t: jax.jvp(along, (t,), (one,))[1]
        second = lambda t: jax.jvp(rate, (t,), (one,))[1]
        (q, eta), (qd, etad), (qdd, etadd) = along(t), rate(t), second(t)
        return jnp.concatenate(inverse_dynamics(ROBOT, q, qd, qdd, eta, etad, etadd))

    series = lambda x: from_derivatives(jnp.stack(x))
    rows = (Q, QD, QDD, QDD), (ETA, ETAD, ETADD, ETADD)
    q, eta = map(series, rows)
    qd, etad = map(Series.rate, (q, eta))
    qdd, etadd = map(Series.rate, (qd, etad))
    q, eta, qd, etad = (x.truncated(1) for x in (q, eta, qd, etad))
    joint, structure = inverse_dynamics(ROBOT, q, qd, qdd, eta, etad, etadd)
    value, slope = jax.jvp(forces, (jnp.zeros(()),), (jnp.ones(()),))
    ours = jnp.concatenate([joint.coefficients, structure.coefficients], axis=1)
    assert_close(ours, jnp.stack([value, slope]), rtol=1e-10, atol=1e-9)


@pytest.mark.slow
def test_gradient_of_accelerations():
    law = lambda q, eta, qd, etad, tau: jnp.concatenate(
        forward_dynamics(ROBOT, q, eta, THETA, qd, etad, THETAD, tau)
    )
    assert_gradient(law, Q, ETA, QD, ETAD, jnp.array([3.0, -2.0]))


@pytest.mark.slow
def test_gradient_by_the_parameters_of_a_body():
    body = ROBOT.modal_links[1].body

    def law(factor, C_t0, phi):  # of an inertia that stays symmetric
        changed = eqx.tree_at(
            lambda r: (r.modal_links[1].body.J_2, r.modal_links[1].body.C_t0, r.slopes),
            ROBOT,
            (factor * body.J_2, C_t0, phi),
        )
        return forward_dynamics(changed, *STATE, jnp.ones(N))[1]

    assert_gradient(law, jnp.ones(()), body.C_t0, ROBOT.slopes)


@pytest.mark.slow
def test_kernel_jit_and_batches_agree():
    law = lambda *state: forward_dynamics(ROBOT, *state, jnp.ones(N))
    with written_out():
        plain = law(*STATE)
    batch = tuple(jnp.stack([x, -0.5 * x]) for x in STATE)
    many = jax.jit(jax.vmap(law))(*batch)
    for ours, loop in zip(many, plain, strict=True):
        assert_close(ours[0], loop, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("detail", [VARIANT_1, VARIANT_4, VARIANT_5])
def test_variants_agree_on_both_routes(detail):
    robot = arm(detail)
    recursion = generalised_forces(robot, Q, ETA, QD, ETAD, QDD, ETADD)
    screws = forces_by_screws(robot, Q, ETA, QD, ETAD, QDD, ETADD)
    assert_close(recursion, screws, rtol=1e-12, atol=1e-11)
    joint, structure = by_blocks(robot, *MOTION[:8])
    springs = lambda r: by_blocks(r, *MOTION[:8])
    nominal = generalised_forces(ROBOT, Q, ETA, QD, ETAD, QDD, ETADD)
    change = jnp.concatenate([joint, structure]) - jnp.concatenate(springs(ROBOT))
    assert_close(change, recursion - nominal, rtol=1e-9, atol=1e-9)
    assert jnp.max(jnp.abs(change)) > 0.1


def test_without_structure_the_modes_are_held():
    rigid = ROBOT.flexible_joint()
    assert rigid.elastic == 0 and rigid.modal_links == ()
    zero = jnp.zeros(M)
    held, _ = inverse_dynamics(ROBOT, Q, QD, QDD, zero, zero, zero)
    joint, _ = inverse_dynamics(rigid, Q, QD, QDD)
    assert_close(joint, held, rtol=1e-12, atol=1e-11)


def test_a_moved_body_is_the_same_body():
    # the frame of the first link is turned and shifted against that of its joint
    body = bending_body(2, 0)
    there = body.moved(TURN, [0.1, 0.0, 0.2])
    back = there.moved(TURN.T, -TURN.T @ np.array([0.1, 0.0, 0.2]))
    assert_close(back, body, rtol=1e-12, atol=1e-12)
    eta, z = jnp.array([0.1, -0.2]), jnp.asarray(generator.standard_normal(8))
    v, w, rate = z[:3], z[3:6], z[6:]
    turned = lambda x: jnp.asarray(TURN) @ x
    velocity = turned(v) - jnp.cross(turned(w), jnp.array([0.1, 0.0, 0.2]))
    moved = jnp.concatenate([velocity, turned(w), rate])
    energy = moved @ there.mass_matrix(eta) @ moved
    assert_close(energy, z @ body.mass_matrix(eta) @ z, rtol=1e-12)


def link_with(body, node="tip", base=None, front=True, tool=True):
    parts = [Axis("A1")] if front else []
    parts.append(FlexibleLink("one", body, node, base))
    if tool:
        box = np.diag([0.1, 0.2, 0.25])
        parts += [Axis("A2"), Body("tool", 1.0, (0.1, 0.0, 0.0), box)]
    return assembled(
        "one link", parts, drive_train(front + tool), counterbalanced_axis=0
    )


BODY = bending_body(2, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: link_with(BODY, front=False), "must have a joint in front of it"),
        (lambda: link_with(BODY, node="middle"), "there is no node `middle`"),
        (
            lambda: link_with(BODY, node="base", base="tip"),
            "move the node `tip` at which it is attached",
        ),
        (
            lambda: link_with(dataclasses.replace(BODY, K_e=np.ones((2, 2)))),
            "`K_e` of `one` must be diagonal in a robot",
        ),
        (
            lambda: link_with(dataclasses.replace(BODY, K_e=np.diag([1.0, 0.0]))),
            "must have a positive stiffness",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
