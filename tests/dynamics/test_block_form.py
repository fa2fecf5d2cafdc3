"""Blocks of the equations of motion and accelerations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import equations_of_motion, forward_dynamics, tool_state

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


def test_one_elastic_axis_of_the_vectors():
    (vector,) = load_vectors("2.38 (n_a=1,n_e=0)")
    given, tol = vector["inputs"], vector["tol"]
    length = 0.25
    mass = given["m_g_l"] / (9.81 * length)
    one = np.ones(1)
    drives = systems.DriveTrain(
        ratio=given["i"] * one,
        motor=systems.Motor(given["J_m"] * one),
        stiffness=systems.CubicStiffness(given["c0"] * one, given["gamma"] * one),
        damping=given["d"] * one,
        motor_friction=systems.friction(
            given["tau_v_out"] * one, given["tau_h_out"], given["s_out"]
        ),
        joint_friction=systems.friction(0.0 * one),
    )
    robot = systems.pendulum(
        mass=mass,
        length=length,
        inertia=given["Theta_a"] - mass * length**2,
        drives=drives,
    )
    q, theta = jnp.array([given["phi_a"]]), jnp.array([given["phi_m"]])
    qd, thetad = jnp.array([given["dphi_a"]]), jnp.array([given["dphi_m"]])
    empty = jnp.zeros((0,))
    tau_m = robot.drives.to_output_torque(jnp.array([given["tau_motor"]]))
    qdd, _, thetadd = jax.jit(forward_dynamics)(
        robot, q, empty, theta, qd, empty, thetad, tau_m
    )
    gear = robot.drives.gear_torque(q - theta, qd - thetad)
    desired = vector["outputs"]
    assert_close(gear, [desired["tau_getr"]], rtol=tol)
    assert_close(qdd, [desired["ddphi_a"]], rtol=tol)
    assert_close(thetadd, [desired["ddphi_m"]], rtol=tol)
    assert_close(robot.drives.reflected_inertia(), [desired["Theta"]], rtol=tol)


def test_two_link_example_of_the_vectors():
    (vector,) = load_vectors("Reiner 3.36")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    robot = systems.two_link(
        length=given["l"],
        share=given["xi"],
        mass=given["m"],
        stiffness=given["c"],
        damping=given["d"],
        inertia=given["Jz"],
    )
    value = lambda name: jnp.array([given[name]])
    q, qd = value("phi_a"), value("dphi_a")
    # motor and joint move together: the gear gives no torque
    eom = jax.jit(equations_of_motion)(
        robot, q, value("phi_e"), q, qd, value("dphi_e"), qd
    )
    mass = np.block([[eom.M_aa, eom.M_ae], [eom.M_ae.T, eom.M_ee]])
    h = np.concatenate([eom.h_a, eom.h_e])
    assert_close(mass, desired["M"], rtol=tol)
    assert_close(h, desired["h"], rtol=tol)
    tau = np.array([given["tau_a"], 0.0])
    assert_close(np.linalg.solve(mass, tau - h), desired["ddphi"], rtol=tol)


def test_free_fall():
    """A released robot: the gear carries nothing and gravity alone acts."""
    g = 9.81
    slider = systems.assembled(
        "slider",
        [
            systems.Axis("A1", systems.JointKind.PRISMATIC),
            systems.Body("weight", 3.0, (0.1, 0.2, 0.3), np.eye(3)),
        ],
        systems.drive_train(1),
        gravity=(0.0, 0.0, -g),
    )
    zero, empty = jnp.zeros((1,)), jnp.zeros((0,))

    def fall(robot, q):
        qdd, _, thetadd = forward_dynamics(
            robot, q, empty, q, zero, empty, zero, jnp.zeros((1,))
        )
        tool = tool_state(robot, q, empty, zero, empty, qdd, empty)
        return qdd, thetadd, tool[2]

    qdd, thetadd, tool = systems.run(fall, slider, zero + 0.4)
    assert_close(qdd, [-g], rtol=1e-14)
    assert_close(thetadd, [0.0], rtol=0)
    assert_close(tool, [0.0, 0.0, -g, 0.0, 0.0, 0.0], rtol=1e-14, atol=1e-14)
    # a uniform rod of the length 2 l, let go when it is horizontal: 3 g / (4 l)
    length = 0.6
    rod = systems.pendulum(
        mass=2.0,
        length=length,
        inertia=2.0 * length**2 / 3.0,
        drives=systems.drive_train(1),
    )
    qdd, _, tool = systems.run(fall, rod, zero)
    assert_close(qdd, [-0.75 * g / length], rtol=1e-14)
    assert_close(tool[1], -0.75 * g, rtol=1e-14)


def test_infinite_stiffness_is_the_rigid_robot():
    """Joint and motor that accelerate alike move like the robot with rigid gears."""
    robot = systems.random_robot(11, 3, 0, counterbalance=True)
    rigid = robot.rigid()
    q, eta, _, qd, etad, _, tau_m, _, _ = (
        x[0] for x in systems.random_state(robot, 12, 1)
    )
    assert rigid.axes == 3 and rigid.elastic == 0 and not rigid.has_elastic_gears

    def stiff(robot, torque):
        """Accelerations with a gear that transmits `torque` at no torsion."""
        eom = equations_of_motion(robot, q, eta, q, qd, etad, qd)
        qdd = jnp.linalg.solve(eom.M_aa, -eom.h_a - torque)
        return qdd, (tau_m - eom.h_m + torque) / eom.Theta

    def both(robot, rigid):
        def difference(torque):
            qdd, thetadd = stiff(robot, torque)
            return qdd - thetadd

        zero = jnp.zeros_like(tau_m)
        slope = jax.jacfwd(difference)(zero)
        torque = -jnp.linalg.solve(slope, difference(zero))
        elastic = stiff(robot, torque)[0]
        return elastic, forward_dynamics(rigid, q, eta, q, qd, etad, qd, tau_m)

    elastic, (qdd, _, thetadd) = systems.run(both, robot, rigid)
    assert_close(elastic, qdd, rtol=1e-10)
    assert_close(thetadd, qdd, rtol=0)


def test_blocks_of_rigid_gears():
    robot = systems.elastic_2r()
    rigid = robot.rigid()
    q, qd = jnp.array([0.3, -0.8]), jnp.array([0.5, 0.7])
    empty = jnp.zeros((0,))
    flexible = robot.flexible_joint()
    blocks = jax.jit(equations_of_motion)
    stiff = blocks(rigid, q, empty, q, qd, empty, qd)
    soft = blocks(flexible, q, empty, q, qd, empty, qd)
    assert_close(stiff.M_aa, soft.M_aa + jnp.diag(soft.Theta), rtol=1e-14)
    assert_close(stiff.h_a, soft.h_a + soft.h_m, rtol=1e-14)
    assert stiff.Theta.shape == stiff.h_m.shape == (0,)
    assert stiff.M_ee.shape == (0, 0)


@pytest.mark.slow
def test_gradient():
    robot = systems.elastic_2r(counterbalance=systems.spring_counterbalance(20.0))
    q, eta, theta, qd, etad, thetad, tau_m, _, _ = (
        x[0] for x in systems.random_state(robot, 3, 1)
    )
    state = (q, 0.01 * eta, q + 0.01 * theta, qd, etad, thetad)
    assert_gradient(forward_dynamics, robot, *state, 100.0 * tau_m)


def test_vmap_is_a_loop():
    robot = systems.elastic_2r()
    *state, tau_m, _, _ = systems.random_state(robot, 3, 3)
    once = jax.jit(forward_dynamics)
    many = jax.jit(jax.vmap(forward_dynamics, in_axes=(None,) + 7 * (0,)))
    together = many(robot, *state, tau_m)
    for k in range(3):
        alone = once(robot, *(x[k] for x in state), tau_m[k])
        picked = tuple(x[k] for x in together)
        assert_close(picked, alone, rtol=1e-10)
