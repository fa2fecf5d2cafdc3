"""Lagrange, Newton-Euler, block form and a peer agree."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import from_derivatives
from elastax.dynamics import (
    equations_of_motion,
    generalised_forces,
    inverse_dynamics,
    lagrange_forces,
    multibody,
    potential_energy,
)
from elastax.dynamics._screws import forces_by_screws
from elastax.robots import kr210

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


SIZES = [(3, 2, False), pytest.param(6, 6, True, marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "elastic", "counterbalance"), SIZES)
def test_lagrange_recursion_and_blocks_agree(axes, elastic, counterbalance):
    robot = systems.random_robot(axes, axes, elastic, counterbalance=counterbalance)
    states = systems.random_state(robot, 7, 4)

    @jax.jit
    @functools.partial(jax.vmap, in_axes=(None, 0))
    def three_routes(robot, state):
        q, eta, theta, qd, etad, thetad, qdd, etadd, thetadd = state
        lagrange = lagrange_forces(robot, *state)
        eom = equations_of_motion(robot, q, eta, theta, qd, etad, thetad)
        blocks = (
            eom.M_aa @ qdd + eom.M_ae @ etadd + eom.h_a,
            eom.M_ae.T @ qdd + eom.M_ee @ etadd + eom.h_e,
            eom.Theta * thetadd + eom.h_m,
        )
        joint, structure = inverse_dynamics(robot, q, qd, qdd, eta, etad, etadd)
        gear = robot.drives.gear_torque(q - theta, qd - thetad)
        motor = robot.drives.reflected_inertia() * thetadd
        motor = motor + robot.drives.motor_friction.torque(thetad) - gear
        mass, _ = multibody(robot, q, eta, qd, etad)
        return lagrange, blocks, (joint + gear, structure, motor), mass

    lagrange, blocks, recursive, mass = three_routes(robot, states)
    for by_energy, by_blocks, by_recursion in zip(lagrange, blocks, recursive):
        scale = float(jnp.max(jnp.abs(by_energy)))
        assert_close(by_blocks, by_energy, rtol=0, atol=1e-10 * scale)
        assert_close(by_recursion, by_energy, rtol=0, atol=1e-10 * scale)
    flipped = jnp.swapaxes(mass, 1, 2)
    assert_close(mass, flipped, rtol=0, atol=1e-14 * float(jnp.max(mass)))
    assert np.linalg.eigvalsh(mass).min() > 0


@pytest.mark.slow
def test_rigid_gears_by_two_routes():
    robot = systems.random_robot(5, 3, 2, counterbalance=True).rigid()
    states = systems.random_state(robot, 8, 3)

    def two_routes(robot, state):
        q, eta, _, qd, etad, _, qdd, etadd, _ = state
        state = (q, eta, q, qd, etad, qd, qdd, etadd, qdd)
        eom = equations_of_motion(robot, q, eta, q, qd, etad, qd)
        return lagrange_forces(robot, *state)[0], eom.M_aa @ qdd + eom.h_a

    by_energy, by_blocks = systems.run(
        jax.vmap(two_routes, in_axes=(None, 0)), robot, states
    )
    assert_close(by_blocks, by_energy, rtol=0, atol=1e-10 * np.abs(by_energy).max())


def test_planar_arm_of_the_vectors():
    (vector,) = load_vectors("2.31 / 2.33-2.37")
    given = vector["inputs"]
    robot = systems.rigid_2r(
        mass=given["m"],
        length=given["l1"],
        com=given["lc"],
        inertia=given["J"],
        gravity=given["g"],
    )
    motion = (jnp.array(given[k]) for k in ("q", "dq", "ddq"))
    tau, _ = systems.run(inverse_dynamics, robot, *motion)
    assert_close(tau, vector["outputs"]["tau"], rtol=vector["tol"])


def test_potential_energy_of_the_vectors():
    (vector,) = load_vectors("2.34")
    given = vector["inputs"]
    body = systems.Body("mass", given["m"], given["r"], np.eye(3))
    robot = systems.assembled(
        "mass", [systems.Axis("A1"), body], systems.drive_train(1), gravity=given["g"]
    )
    zero = jnp.zeros((1,))
    energy = potential_energy(robot, zero, zero[:0], zero)
    assert_close(energy, vector["outputs"]["V"], rtol=vector["tol"])


def test_series_against_nested_jvp():
    """Two time derivatives of the torques along a motion, by both mechanisms."""
    robot = systems.elastic_2r(counterbalance=systems.spring_counterbalance(30.0))
    # coordinates (q, eta) as polynomials in time
    rows = jnp.asarray(np.random.default_rng(2).standard_normal((5, 4)))

    def forces(robot, t):
        x = lambda t: (
            rows[0] + t * (rows[1] + t * (rows[2] + t * (rows[3] + t * rows[4])))
        )
        rate = lambda f: lambda t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        s, sd, sdd = x(t), rate(x)(t), rate(rate(x))(t)
        return jnp.concatenate(
            inverse_dynamics(robot, s[:2], sd[:2], sdd[:2], s[2:], sd[2:], sdd[2:])
        )

    def nested(robot, t):
        value = lambda t: forces(robot, t)
        first = lambda t: jax.jvp(value, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack([value(t), *jax.jvp(first, (t,), (jnp.ones_like(t),))])

    def series(robot):
        factorials = jnp.array([1.0, 1.0, 2.0, 6.0, 24.0])
        s = from_derivatives(rows * factorials[:, None])
        sd, sdd = s.rate(), s.rate().rate()
        joint, structure = inverse_dynamics(
            robot, s[:2].truncated(2), sd[:2].truncated(2), sdd[:2],
            s[2:].truncated(2), sd[2:].truncated(2), sdd[2:],
        )  # fmt: skip
        parts = [joint.derivatives(), structure.derivatives()]
        return jnp.concatenate(parts, axis=1)

    desired = systems.run(nested, robot, jnp.zeros(()))
    scale = np.abs(desired).max(axis=1, keepdims=True)
    assert_close(
        systems.run(series, robot) / scale, desired / scale, rtol=0, atol=1e-12
    )


def test_gradient():
    robot = systems.elastic_2r(hinge_hardening=50.0)
    q, eta, _, qd, etad, _, qdd, etadd, _ = (
        x[0] for x in systems.random_state(robot, 3, 1)
    )
    assert_gradient(inverse_dynamics, robot, q, qd, qdd, eta, etad, etadd)


def test_speeds_near_zero_and_large():
    robot = systems.elastic_2r()
    one = jnp.ones((2,))

    @jax.jit
    def torque(robot, q, qd):
        return jnp.concatenate(inverse_dynamics(robot, q, qd, 0.0 * one))

    tau = functools.partial(torque, robot)
    rest = tau(0.3 * one, 0.0 * one)
    assert_close(tau(0.3 * one, 1e-300 * one), rest, rtol=1e-15)
    assert np.all(np.isfinite(tau(0.3 * one, 1e8 * one)))
    # the equations have the period of the joints, up to the rounding of the angle
    far = 0.3 * one + 2e6 * jnp.pi
    assert_close(tau(far, 0.0 * one), rest, rtol=0, atol=1e-8 * np.abs(rest).max())


@pytest.fixture(scope="module")
def peer():
    """The KR210 with all its joints in Pinocchio: library, robot, model, data."""
    pin = pytest.importorskip("pinocchio")
    from benchmarks.peers.pinocchio import robot_model

    robot = kr210()
    model = robot_model(robot)
    return pin, robot, model, model.createData()


def test_elastic_robot_against_pinocchio(peer):
    """14 coordinates move the 17 joints of the tree through the coupling matrix."""
    pin, robot, model, data = peer
    n, count = robot.axes, 5
    q, eta, _, qd, etad, _, qdd, etadd, _ = systems.random_state(robot, 4, count)

    @jax.jit
    @functools.partial(jax.vmap, in_axes=(None, 0, 0, 0, 0, 0, 0))
    def ours(robot, q, eta, qd, etad, qdd, etadd):
        tau = generalised_forces(robot, q, eta, qd, etad, qdd, etadd)
        return tau, *multibody(robot, q, eta, qd, etad)

    tau, mass, bias = jax.device_get(ours(robot, q, eta, qd, etad, qdd, etadd))
    coupling = np.asarray(robot.coupling())
    for k in range(count):
        x, xd, xdd = (
            coupling @ np.concatenate([a[k], b[k]])
            for a, b in ((q, eta), (qd, etad), (qdd, etadd))
        )
        theirs = coupling.T @ pin.rnea(model, data, x, xd, xdd)
        assert_close(tau[k], theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
        crba = pin.crba(model, data, x)
        full = np.triu(crba) + np.triu(crba, 1).T
        theirs = coupling.T @ full @ coupling
        assert_close(mass[k], theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
        theirs = coupling.T @ pin.nonLinearEffects(model, data, x, xd)
        assert_close(bias[k], theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
    assert n + robot.elastic == 14 and model.nv == 17


@pytest.mark.slow
def test_recursion_is_the_sum_of_screws():
    """With sliding axes among the turning ones."""
    robot = systems.random_robot(7, 4, 5, counterbalance=False)
    q, eta, _, qd, etad, _, qdd, etadd, _ = (
        x[0] for x in systems.random_state(robot, 5, 1)
    )
    motion = (q, eta, qd, etad, qdd, etadd)
    expected = systems.run(forces_by_screws, robot, *motion)
    scale = np.abs(expected).max()
    actual = systems.run(generalised_forces, robot, *motion)
    assert_close(actual, expected, rtol=0, atol=1e-12 * scale)
