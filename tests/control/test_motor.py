"""Controllers at the motors."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.control import CascadeMotorControl, IdealMotorControl
from elastax.dynamics import MotorSetpoint, resting_state, simulate

from tests import systems
from tests.helpers import assert_close


SETPOINT = MotorSetpoint(
    *(jnp.array(x) for x in ([0.3, 0.1], [1.0, -2.0], [5.0, 6.0], [70.0, 80.0]))
)
THETA, SPEED = jnp.array([0.29, 0.12]), jnp.array([0.8, -1.9])
INERTIA, LOAD = jnp.array([2.0, 3.0]), jnp.array([40.0, -20.0])


# the memory of controllers without one
NONE = jnp.zeros((0, 2))


def test_cascade_law():
    controller = CascadeMotorControl(50.0, 12.0)
    tau = controller.torque(SETPOINT, THETA, SPEED, INERTIA, LOAD, NONE)
    speed = np.array([0.2, -0.1]) + 12.0 * np.array([0.01, -0.02])
    assert_close(tau, [70.0, 80.0] + np.array([2.0, 3.0]) * 50.0 * speed, rtol=1e-13)
    assert_close(controller.motors(SETPOINT, THETA, SPEED), (THETA, SPEED), rtol=0)
    # at rest the loop carries what the feed-forward leaves
    rest = controller.resting_motors(SETPOINT, LOAD, INERTIA)
    still = MotorSetpoint(SETPOINT.theta, 0 * SPEED, 0 * SPEED, SETPOINT.tau_m)
    held = controller.torque(still, rest, 0 * SPEED, INERTIA, LOAD, NONE)
    assert_close(held, LOAD, rtol=1e-12)


def test_ideal_law():
    controller = IdealMotorControl()
    tau = controller.torque(SETPOINT, THETA, SPEED, INERTIA, LOAD, NONE)
    assert_close(tau, INERTIA * SETPOINT.thetadd + LOAD, rtol=0)
    assert_close(
        controller.motors(SETPOINT, THETA, SPEED),
        (SETPOINT.theta, SETPOINT.thetad),
        rtol=0,
    )
    assert_close(
        controller.resting_motors(SETPOINT, LOAD, INERTIA), SETPOINT.theta, rtol=0
    )


def test_plant_stays_in_its_equilibrium():
    """Without feed-forward torque the loop rests where its stiffness meets gravity."""
    robot = systems.pendulum(
        mass=5.0, length=0.4, inertia=0.2, drives=systems.drive_train(1)
    )
    times = np.linspace(0.0, 0.2, 21)
    theta = jnp.array([0.3])
    command = systems.constant_command(times, theta, jnp.zeros((1,)))
    controller = CascadeMotorControl()

    @eqx.filter_jit
    def rest(robot):
        start = resting_state(robot, systems.setpoint(command, 0.0), controller)
        return start, simulate(robot, command, controller, rtol=1e-8, atol=1e-10)

    (q, eta, motors), motion = rest(robot)
    sag = jnp.abs(motors - theta)
    assert np.all(sag > 1e-4)
    assert eta.shape == (0,)
    for value, start in ((motion.q, q), (motion.theta, motors)):
        still = np.tile(np.asarray(start), (21, 1))
        assert_close(value, still, rtol=0, atol=1e-8)
    assert_close(motion.qdd, np.zeros((21, 1)), rtol=0, atol=1e-4)


@pytest.mark.parametrize("name", ["speed_bandwidth", "position_gain"])
def test_refusals(name):
    with pytest.raises(ValueError, match=f"`{name}` must be positive"):
        CascadeMotorControl(**{name: 0.0})


def test_damping_of_a_free_rotor():
    """The loop's poles: s^2 + w s + w k for a rotor without load."""
    controller = CascadeMotorControl(60.0, 15.0)

    def acceleration(theta, thetad):
        zero = MotorSetpoint(*(jnp.zeros((1,)) for _ in range(4)))
        one = jnp.ones((1,))
        return controller.torque(zero, theta, thetad, one, one, NONE[:, :1])[0]

    zero = jnp.zeros((1,))
    position, speed = jax.grad(acceleration, argnums=(0, 1))(zero, zero)
    assert_close((position, speed), ([-900.0], [-60.0]), rtol=1e-15)
