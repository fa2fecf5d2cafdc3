"""ASIM: its steps, two routes to its derivatives, streaming, bounds, the plant."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import written_out
from elastax._taylor import Series, from_derivatives
from elastax.dynamics import inverse_dynamics
from elastax.inverse import (
    ASIM,
    FilteredDamping,
    FrozenDamping,
    PoseCorrection,
    PositionCorrection,
    default_damping,
    feedforward_by_steps,
    response,
    structure_torque,
)
from elastax.inverse._asim import deformations_along
from elastax.kinematics import (
    ConstantDamping,
    CorrectionLimiter,
    SigmoidDamping,
    damped_least_squares,
    forward_kinematics,
    jacobian,
)
from elastax.signals import CriticallyDampedFilter

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


PLANE = PositionCorrection(axes=(0, 1))
BENT, CHANGE = [0.3, -0.9], [0.4, 0.5]


def _rest_slow(names, fast: str):
    """Parameters of which all but one are marked slow: each compiles for long."""
    slow = pytest.mark.slow
    return [pytest.param(n, marks=() if n == fast else slow) for n in names]


@eqx.filter_jit
def feedforward(inverse, model, reference):
    return inverse.feedforward(model, reference)


@eqx.filter_jit
def tool_paths(model, reference, command):
    """Tool of the ideal robot, of the deformed one on the reference, and corrected."""

    def at(q, eta):
        return forward_kinematics(model.chain, model.joint_coordinates(q, eta))[:3, 3]

    ideal = jax.vmap(lambda q: at(q, jnp.zeros((model.elastic,))))
    q, eta = reference.positions, command.eta
    return ideal(q), jax.vmap(at)(q, eta), jax.vmap(at)(command.q, eta)


def errors(model, reference, command):
    """Distance from the ideal tool, as deformed and as corrected, (times,) each."""
    ideal, deformed, corrected = tool_paths(model, reference, command)
    distance = lambda path: np.linalg.norm(path - ideal, axis=1)
    return distance(deformed), distance(corrected)


@pytest.fixture(scope="module")
def model():
    return systems.elastic_2r(hinge_hardening=300.0)


@pytest.fixture(scope="module")
def reference():
    return systems.smooth_reference(BENT, CHANGE, 0.4, settle=0.1)


def test_parallel_model_of_the_vectors():
    """The deformation step of the two-link example, and (3.36) row 1 behind it."""
    (vector,) = load_vectors("Reiner 3.41")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    length, share = given["l"], given["xi"]
    robot = systems.two_link(
        length=length,
        share=share,
        mass=given["m"],
        stiffness=given["c"],
        damping=given["d"],
        inertia=given["Jz"],
        beyond=given["x_l"],
    )
    reach = length + given["x_l"]
    lift = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
    sizes = [(lift.deriv(k) if k else lift) for k in range(5)]

    def lateral(t):
        """Tool position across and its derivatives, (5,)."""
        s = t / given["T"]
        powers = jnp.stack([s**k for k in range(8)])
        rows = [
            jnp.dot(jnp.asarray(np.pad(p.coef, (0, 8 - len(p.coef)))), powers)
            for p in sizes
        ]
        scale = given["Y"] / given["T"] ** jnp.arange(5.0)
        return scale * jnp.stack(rows)

    def rigid(t):
        """Joint angle of the rigid robot and four derivatives, (5, 1)."""
        y = from_derivatives(lateral(t) / reach)
        terms = [jnp.arcsin(y.coefficients[0])]
        # y = sin(phi): phi' = y' / cos(phi), term by term
        f, angle = jnp.arcsin, y.coefficients[0]
        increment = lambda e: sum(y.coefficients[k] * e**k for k in range(1, 5))
        g = lambda e: f(angle + increment(e))
        for _ in range(4):
            g = (lambda h: lambda e: jax.jvp(h, (e,), (jnp.ones_like(e),))[1])(g)
            terms.append(g(jnp.zeros(())))
        return jnp.stack(terms)[:, None]

    def parallel_model():
        count = 400
        times = jnp.linspace(0.0, given["t"], count + 1)
        samples = jax.vmap(rigid)(times)
        forcing = jax.vmap(lambda s: structure_torque(robot, s).coefficients)(samples)
        eta = deformations_along(robot, forcing, given["t"] / count)[-1]
        last = Series(forcing[-1])
        spring = robot.structure_stiffness.torque
        series = response(spring, robot.structure_damping, eta, last)
        return samples[-1], last, series.derivatives()[:, 0]

    sample, forcing, eta = systems.run(parallel_model)
    names = ("phi_e_hat", "dphi_e_hat", "ddphi_e_hat")
    check = lambda value, name: assert_close(value, desired[name], rtol=tol, atol=tol)
    check(sample[0, 0], "phi_a_r")
    check(sample[2, 0], "ddphi_a_r")
    check(-forcing.coefficients[0, 0], "tau_e_hat_as_in_3_41a")
    for value, name in zip(eta, names):
        check(value, name)

    def corrected(t):
        """(3.37): the joint angle that puts the bent robot's tool at y."""
        bend = eta[0] + eta[1] * t + eta[2] * t**2 / 2
        y = lateral(given["t"] + t)[0]
        outer = given["x_l"] + length * (1 - share)
        a, b = outer * jnp.cos(bend) + length * share, outer * jnp.sin(bend)
        return jnp.arcsin(y / jnp.hypot(a, b)) - jnp.arctan2(b, a)

    def torque():
        rate = lambda f: lambda t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        now = jnp.zeros(())
        q = jnp.stack(
            [corrected(now), rate(corrected)(now), rate(rate(corrected))(now)]
        )
        motion = [x[None] for x in q] + [jnp.asarray(eta[k : k + 1]) for k in range(3)]
        return q, inverse_dynamics(robot, *motion)[0]

    q, tau = systems.run(torque)
    for value, name in zip(q, ("phi_a_e", "dphi_a_e", "ddphi_a_e")):
        check(value, name)
    check(tau[0], "tau_a")


@pytest.mark.slow
def test_derivatives_against_nested_jvp(model):
    """One sample of ASIM against the total time derivatives of its equations."""
    factor = 0.05
    asim = ASIM(PLANE, FrozenDamping(ConstantDamping(factor)))
    dt = 1e-3
    rows = jnp.asarray(systems.smooth_motion(BENT, CHANGE, 0.4, [0.17], 4)[:, 0])
    # any state will do: deformations and torsions that are not at rest
    eta, torsion = jnp.array([0.004, -0.003]), jnp.array([-0.002, 0.001])

    def by_series(model):
        state = asim.init(model, rows, dt)
        state = eqx.tree_at(
            lambda s: (s.eta, s.drive.gear.torsion), state, (eta, torsion)
        )
        return asim.step(model, state, rows)[0]

    def by_jvp(model):
        factorials = jnp.array([1.0, 1.0, 2.0, 6.0, 24.0])
        spring, damping = model.structure_stiffness.torque, model.structure_damping
        gear, slip = model.drives.stiffness.torque, model.drives.damping

        def rate(f):
            """Time derivative in the reference's motion."""
            return lambda t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]

        def reference(t):
            return sum(rows[k] / factorials[k] * t**k for k in range(5))

        def forcing(t):
            q = reference(t), rate(reference)(t), rate(rate(reference))(t)
            return -inverse_dynamics(model, *q)[1]

        def bending(t, x):
            return (forcing(t) - spring(x)) / damping

        def along(f):
            """Total time derivative of f(t, x) along the deformation."""
            return lambda t, x: jax.jvp(f, (t, x), (jnp.ones_like(t), bending(t, x)))[1]

        def tool(q, x):
            joints = model.joint_coordinates(q, x)
            return forward_kinematics(model.chain, joints)[:3, 3]

        def corrected(t, x):
            q = reference(t)
            here = jacobian(model.chain, model.joint_coordinates(q, x))[:3]
            # axes 0 and 3 of the chain are the driven ones
            matrix = here[:, np.array([0, 3])]
            error = tool(q, jnp.zeros_like(x)) - tool(q, x)
            return q + damped_least_squares(matrix, error, jnp.array(factor))

        def load(t, x):
            motion = (corrected, along(corrected), along(along(corrected)))
            bend = (lambda t, x: x, bending, along(bending))
            values = [f(t, x) for f in (*motion, *bend)]
            return inverse_dynamics(model, *values)[0]

        def motor(t, x, z):
            return corrected(t, x) - z

        def whole(f):
            """Total time derivative of f(t, x, z), with the torsions z."""

            def derivative(t, x, z):
                torsion_rate = (-load(t, x) - gear(z)) / slip
                tangents = (jnp.ones_like(t), bending(t, x), torsion_rate)
                return jax.jvp(f, (t, x, z), tangents)[1]

            return derivative

        point = (jnp.zeros(()), eta, torsion)
        theta, thetad = motor(*point), whole(motor)(*point)
        thetadd = whole(whole(motor))(*point)
        tau_a = load(*point[:2])
        friction = model.drives.motor_friction.torque(thetad)
        tau_m = model.drives.reflected_inertia() * thetadd + tau_a + friction
        return theta, thetad, thetadd, tau_m, tau_a, corrected(*point[:2])

    sample = systems.run(by_series, model)
    with written_out():  # kernels of so many nested derivatives take long to compile
        desired = systems.run(by_jvp, model)
    names = ("theta", "thetad", "thetadd", "tau_m", "tau_a", "q")
    actual = tuple(getattr(sample, name) for name in names)
    assert_close(actual, desired, rtol=1e-9)
    assert_close(sample.eta, eta, rtol=0)


LAW = SigmoidDamping.from_limits(1e-3, 0.1, 0.02, 0.2)
# the inverse and the share of the tool's error that it may leave: one damped step
# leaves terms of second order, a pose trades place for direction
VARIANTS = {
    "text": (ASIM(PLANE), 0.05),
    "frozen": (ASIM(PLANE, FrozenDamping(LAW)), 0.05),
    "twice": (ASIM(PLANE, FrozenDamping(ConstantDamping(2e-3)), iterations=2), 1e-3),
    "limited": (ASIM(PLANE, limiter=CorrectionLimiter(-0.02, 0.02, 1e5)), 0.05),
    "pose": (ASIM(PoseCorrection(0.5, rank=2)), 0.9),
}
ASIM_OF_THE_TEXT = VARIANTS["text"][0]


@pytest.mark.parametrize("name", _rest_slow(VARIANTS, "text"))
def test_streaming_is_offline(name, model, reference):
    """Sample by sample and all at once; the correction puts the tool in place."""
    inverse, share = VARIANTS[name]
    command = feedforward(inverse, model, reference)
    steps = eqx.filter_jit(feedforward_by_steps)(inverse, model, reference)
    assert_close(steps, command, rtol=1e-9, atol=1e-9)
    deformed, corrected = errors(model, reference, command)
    assert deformed.max() > 5e-3
    assert corrected.max() < share * deformed.max(), corrected.max() / deformed.max()


@pytest.mark.slow
def test_explicit_loop_is_offline(model, reference):
    """The protocol as a controller calls it, with one compiled step."""
    inverse = ASIM_OF_THE_TEXT
    command = feedforward(inverse, model, reference)
    samples = jnp.swapaxes(reference.derivatives[:5], 0, 1)
    state = eqx.filter_jit(inverse.init)(model, samples[0], reference.dt)
    step = eqx.filter_jit(inverse.step)
    for k in range(40):
        output, state = step(model, state, samples[k])
        for name in ("theta", "thetad", "thetadd", "tau_m", "q", "eta"):
            desired = getattr(command, name)[k]
            assert_close(getattr(output, name), desired, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_limiter_bounds_the_correction(model, reference):
    tight = ASIM(PLANE, limiter=CorrectionLimiter(-0.002, 0.003, 1e6))
    command = feedforward(tight, model, reference)
    correction = np.asarray(command.q - reference.positions)
    assert correction.max() < 0.003 and correction.min() > -0.002
    free = feedforward(ASIM_OF_THE_TEXT, model, reference)
    assert np.abs(np.asarray(free.q - reference.positions)).max() > 0.003


def test_deformation_is_that_of_the_statics(model):
    """At rest ASIM's deformation balances the reference pose's gravity."""
    still = systems.smooth_reference(BENT, [0.0, 0.0], 0.4, settle=0.1)
    command = feedforward(ASIM_OF_THE_TEXT, model, still)
    zero = jnp.zeros((2,))
    _, load = jax.jit(inverse_dynamics)(model, jnp.array(BENT), zero, zero)
    eta = np.asarray(command.eta)
    assert_close(model.structure_stiffness.torque(command.eta[-1]), -load, rtol=1e-10)
    assert_close(eta, np.tile(eta[:1], (len(eta), 1)), rtol=1e-12)
    for name in ("thetad", "thetadd"):
        rest = np.asarray(getattr(command, name))
        assert_close(rest, np.zeros_like(rest), rtol=0, atol=1e-7)


POSES = {"stretched": [0.3, 0.0], "upright": [np.pi / 2, 0.0], "folded": [0.4, np.pi]}


@pytest.mark.parametrize("pose", POSES)
def test_bounded_at_singular_poses(pose, model):
    """Finite, and no correction beyond the error over twice the damping.

    The deformed arm has fallen out of the stretched one's reach: its tool cannot get
    back to the target by the joints.
    """
    inverse = ASIM(PLANE, FilteredDamping(LAW, CriticallyDampedFilter(4, 10.0)))
    reference = systems.smooth_reference(POSES[pose], [0.25, 0.3], 0.4, settle=0.1)
    command = feedforward(inverse, model, reference)
    for leaf in jax.tree.leaves(command):
        assert np.all(np.isfinite(leaf))
    deformed, corrected = errors(model, reference, command)
    correction = np.linalg.norm(command.q - reference.positions, axis=1)
    # the smallest damping that the law gives, anywhere
    assert np.all(correction <= deformed / (2 * 1e-3))
    # at the singular pose itself it gives nearly the largest
    assert correction[0] <= deformed[0] / (2 * 0.9 * 0.1)
    # no correction makes the error worse than it was
    assert corrected.max() < 1.01 * deformed.max()
    # the torques stay of the size of those of the robot without correction
    assert np.abs(command.tau_m).max() < 5e3


def test_default_damping_is_bounded_by_its_limits():
    law = default_damping().law
    assert_close(law(jnp.array([0.0, 3.0])), [0.3, 1e-3], rtol=0.04)


@pytest.mark.slow
def test_gradient(model):
    short = systems.smooth_reference(BENT, CHANGE, 0.4, dt=0.08)

    def torques(stiffness, damping, derivatives):
        moved = dataclasses.replace(
            model, structure_stiffness=stiffness, structure_damping=damping
        )
        reference = dataclasses.replace(short, derivatives=derivatives)
        command = ASIM_OF_THE_TEXT.feedforward(moved, reference)
        return command.theta, command.tau_m

    assert_gradient(
        torques, model.structure_stiffness, model.structure_damping, short.derivatives
    )
