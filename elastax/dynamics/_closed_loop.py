"""The elastic robot under a motor controller: rates of its state, and what it shows."""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from .._kernel import kernel
from ._block_form import forward_dynamics
from ._command import MotorSetpoint
from ._robot import ElasticRobot
from ._tool_state import tool_state


class AbstractMotorController(eqx.Module):
    """Turns a setpoint and the measured motor motion into motor torques."""

    @abc.abstractmethod
    def motors(
        self, setpoint: MotorSetpoint, theta: PerJoint, thetad: PerJoint
    ) -> tuple[PerJoint, PerJoint]:
        """Motor angles and speeds that act on the gears.

        The integrated ones, unless the controller is ideal and imposes its own.
        """

    @abc.abstractmethod
    def torque(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        inertia: PerJoint,
        load: PerJoint,
    ) -> PerJoint:
        """Motor torques on the output side [N m].

        Args:
            setpoint: what the feed-forward asks for now.
            theta, thetad: measured motor angles [rad] and speeds.
            inertia: motor inertias on the output side [kg m^2].
            load: what gear and friction ask of the motors, `h_m` [N m].
        """

    @abc.abstractmethod
    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        """Motor angles [rad] at which the loop rests under a static `load` [N m]."""


State = Float[Array, " states"]


def _driven(robot: ElasticRobot, controller, setpoint: MotorSetpoint, x: State):
    """State in parts, motor torques, torques of the gears on the motors."""
    n, m = robot.axes, robot.elastic
    q, eta, theta, qd, etad, thetad = jnp.split(x, np.cumsum([n, m, n, n, m]))
    theta, thetad = controller.motors(setpoint, theta, thetad)
    gear = robot.drives.gear_torque(q - theta, qd - thetad)
    load = robot.drives.motor_friction.torque(thetad) - gear
    inertia = robot.drives.reflected_inertia()
    tau_m = controller.torque(setpoint, theta, thetad, inertia, load)
    return (q, eta, theta, qd, etad, thetad), tau_m, gear


@kernel
def rates(
    robot: ElasticRobot,
    controller: AbstractMotorController,
    setpoint: MotorSetpoint,
    x: State,
) -> State:
    """Time derivative of the state x = (q, eta, theta, qd, etad, thetad).

    Args:
        robot: the robot, with elastic gears.
        controller: closes the loop at the motors.
        setpoint: what the feed-forward asks for now.
        x: state [rad, rad/s], shape (2 (2 axes + elastic),).
    """
    state, tau_m, _ = _driven(robot, controller, setpoint, x)
    accelerations = forward_dynamics(robot, *state, tau_m)
    return jnp.concatenate([*state[3:], *accelerations])


@kernel
def observe(
    robot: ElasticRobot,
    controller: AbstractMotorController,
    setpoint: MotorSetpoint,
    x: State,
):
    """What `SimulationResult` shows of a state, in the order of its fields."""
    state, tau_m, gear = _driven(robot, controller, setpoint, x)
    accelerations = forward_dynamics(robot, *state, tau_m)
    q, eta, _, qd, etad, _ = state
    qdd, etadd, _ = accelerations
    tool = tool_state(robot, q, eta, qd, etad, qdd, etadd)
    return *state, *accelerations, tau_m, -gear, *tool
