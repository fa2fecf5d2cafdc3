"""Static equilibria against hand calculations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import holding_torque, resting_state, static_equilibrium
from elastax.kinematics import forward_kinematics

from tests import systems
from tests.helpers import assert_close, assert_gradient


GEAR, TILT, EI = 3e6, 5e6, 8e5
REACH, LENGTH = 0.4, 1.2


def cantilever(payload: float, gravity):
    """Vertical axis, tilt about y, a beam along x whose tip carries the payload."""
    y = (0.0, 1.0, 0.0)
    parts = [
        systems.Axis("A1"),
        systems.ElasticJoint("tilt", y, TILT, 100.0),
        systems.Body("carousel", 5.0, (0.0, 0.0, 0.0), np.eye(3)),
        systems.Offset((REACH, 0.0, 0.0)),
        systems.ElasticJoint("beam", y, 3.0 * EI / LENGTH, 100.0),
        systems.Offset((LENGTH, 0.0, 0.0)),
        systems.EndSlope("beam", 0.5),
    ]
    # the end slope needs a link behind it: the tool flange
    robot = systems.assembled(
        "cantilever",
        [*parts, systems.Body("flange", 1e-3, (0.0, 0.0, 0.0), 1e-3 * np.eye(3))],
        systems.drive_train(1, stiffness=GEAR),
        gravity=gravity,
        counterbalanced_axis=0,
    )
    return robot.with_payload(payload, np.zeros(3), 0.1 * np.eye(3))


def test_deflection_of_a_cantilever_by_hand():
    """Tilt, gear and beam under a small tip force, downward and sideways."""
    mass, down, side = 2.0, 9.81, 4.0
    robot = cantilever(mass, (0.0, side, -down))

    def deflect(robot):
        q, eta = static_equilibrium(robot, jnp.zeros((1,)))
        pose = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))
        return q, eta, pose

    q, eta, pose = systems.run(deflect, robot)
    force, arm = (mass + 1e-3) * down, REACH + LENGTH
    # second-order terms are of the size of the angles, 1e-5
    near = 1e-4
    assert_close(q, [(mass + 1e-3) * side * arm / GEAR], rtol=near)
    tilt, bend = force * arm / TILT, force * LENGTH**2 / (3.0 * EI)
    assert_close(eta, [tilt, bend], rtol=near)
    sag = force * arm**2 / TILT + force * LENGTH**3 / (3.0 * EI)
    assert_close(pose[2, 3], -sag, rtol=near)
    slope = tilt + force * LENGTH**2 / (2.0 * EI)
    assert_close(-pose[2, 0], slope, rtol=near)
    # stiffness against load: twice the payload, twice the sag
    heavy = systems.run(deflect, robot.with_payload(2 * mass, np.zeros(3), np.eye(3)))
    ratio = (2 * mass + 1e-3) / (mass + 1e-3)
    assert_close(heavy[2][2, 3], ratio * pose[2, 3], rtol=near)


def test_equilibrium_balances_the_forces():
    robot = systems.elastic_2r(
        hinge_hardening=200.0, counterbalance=systems.spring_counterbalance(5.0)
    )
    theta = jnp.array([0.3, -0.6])

    def balance(robot, theta):
        q, eta = static_equilibrium(robot, theta)
        zero = jnp.zeros_like(q)
        return (
            holding_torque(robot, q, eta) + robot.drives.gear_torque(q - theta, zero),
            jnp.max(jnp.abs(eta)),
        )

    rest, largest = systems.run(balance, robot, theta)
    assert_close(rest, [0.0, 0.0], rtol=0, atol=1e-10)
    assert largest > 1e-4


@pytest.mark.slow
def test_gradient():
    robot = systems.elastic_2r(hinge_hardening=200.0)
    assert_gradient(static_equilibrium, robot, jnp.array([0.3, -0.6]))


def test_loop_rests_with_its_robot():
    """A torque loop leaves the motors where they are told, whatever the load."""
    robot = systems.elastic_2r()
    theta = jnp.array([0.2, -0.4])
    command = systems.constant_command(np.array([0.0, 1.0]), theta, jnp.zeros((2,)))

    @jax.jit
    def both(robot):
        setpoint = systems.setpoint(command, 0.0)
        rest = resting_state(robot, setpoint, systems.TorqueControl())
        return rest, static_equilibrium(robot, theta)

    (q, eta, motors), desired = both(robot)
    assert_close(motors, theta, rtol=0)
    assert_close((q, eta), desired, rtol=1e-12)
