"""The elastic robot under a motor controller: rates of its state, and what it shows."""

import abc
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from ._block_form import forward_dynamics
from ._command import MotorSetpoint
from ._gear_loads import gear_loads, gear_memory_rates
from ._robot import ElasticRobot
from ._tool_state import tool_state


State = Float[Array, " states"]
ControllerMemory = Float[Array, "states axes"]


class AbstractMotorController(eqx.Module):
    """Turns a setpoint and the measured motor motion into motor torques.

    A controller may have a memory of its own, such as an integrator or the currents of
    its electronics: an array of shape (states, axes).
    """

    @property
    @abc.abstractmethod
    def states(self) -> int:
        """Number of states per axis; zero for a controller without a memory."""

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
        memory: ControllerMemory,
    ) -> PerJoint:
        """Motor torques that are commanded, on the output side [N m].

        Args:
            setpoint: what the feed-forward asks for now.
            theta, thetad: measured motor angles [rad] and speeds.
            inertia: motor inertias on the output side [kg m^2].
            load: what gear and friction ask of the motors, `h_m` [N m].
            memory: the controller's own states, (states, axes).
        """

    @abc.abstractmethod
    def rates(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        memory: ControllerMemory,
    ) -> ControllerMemory:
        """Rates of the controller's own states, (states, axes)."""

    @abc.abstractmethod
    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        """Motor angles [rad] at which the loop rests under a static `load` [N m]."""

    @abc.abstractmethod
    def resting_memory(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> ControllerMemory:
        """The controller's own states while it rests under a static `load` [N m]."""


class LoopState(NamedTuple):
    """State of robot and loop in parts.

    Attributes:
        q, eta, theta: angles of joints, structure, motors [rad].
        qd, etad, thetad: their velocities [rad/s].
        gear: memory of the gears' branch, (states, axes); empty without one.
        tau_m: motor torques on the output side [N m], (axes,); empty for motors without
            a lag, whose torque is the commanded one.
        controller: memory of the controller, (states, axes).
    """

    q: PerJoint
    eta: PerElastic
    theta: PerJoint
    qd: PerJoint
    etad: PerElastic
    thetad: PerJoint
    gear: Float[Array, "states axes"]
    tau_m: Float[Array, " motors"]
    controller: ControllerMemory

    def vector(self) -> State:
        """All parts one after the other."""
        return jnp.concatenate([jnp.ravel(part) for part in self])


def state_shapes(robot: ElasticRobot, controller: AbstractMotorController):
    """Shapes of the parts of `LoopState`, in their order."""
    n, m = robot.axes, robot.elastic
    motors = 0 if robot.drives.motor.lag is None else n
    gear = (robot.drives.memory_states, n)
    return (n,), (m,), (n,), (n,), (m,), (n,), gear, (motors,), (controller.states, n)


def state_parts(
    robot: ElasticRobot, controller: AbstractMotorController, x: State
) -> LoopState:
    """The state x in parts."""
    shapes = state_shapes(robot, controller)
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
    parts = jnp.split(x, ends[:-1])
    return LoopState(*(part.reshape(shape) for part, shape in zip(parts, shapes)))


def driven(robot: ElasticRobot, controller, setpoint: MotorSetpoint, x: State, mode):
    """State with the motors' motion, torques of motors, gears and of the command."""
    state = state_parts(robot, controller, x)
    theta, thetad = controller.motors(setpoint, state.theta, state.thetad)
    state = state._replace(theta=theta, thetad=thetad)
    q, qd = state.q, state.qd
    gear, load = gear_loads(robot, q, theta, qd, thetad, state.gear, mode)
    inertia = robot.drives.reflected_inertia()
    loop = (setpoint, theta, thetad, inertia, load)
    command = controller.torque(*loop, state.controller)
    tau_m = command if robot.drives.motor.lag is None else state.tau_m
    return state, tau_m, gear, command


@kernel
def loop_rates(
    robot: ElasticRobot,
    controller: AbstractMotorController,
    setpoint: MotorSetpoint,
    x: State,
    mode: PerJoint | None = None,
) -> State:
    """Time derivative of the state of `LoopState`, x = (q, eta, theta, qd, ...).

    Args:
        robot: the robot, with elastic gears.
        controller: closes the loop at the motors.
        setpoint: what the feed-forward asks for now.
        x: state [rad, rad/s], shape (2 (2 axes + elastic) + memories,).
        mode: of the motors where their drive trains switch, see `forward_dynamics`.

    References:
        [Reiner2010] (2.2), (2.38).
    """
    state, tau_m, _, command = driven(robot, controller, setpoint, x, mode)
    accelerations = forward_dynamics(robot, *state[:6], tau_m, state.gear, mode)
    q, _, theta, qd, etad, thetad, gear, torque, memory = state
    if robot.drives.motor.lag is not None:
        torque = robot.drives.motor.torque_rate(torque, command)
    return LoopState(
        qd,
        etad,
        thetad,
        *accelerations,
        gear_memory_rates(robot, q, theta, qd, thetad, gear),
        torque,
        controller.rates(setpoint, theta, thetad, memory),
    ).vector()


@kernel
def observe(
    robot: ElasticRobot,
    controller: AbstractMotorController,
    setpoint: MotorSetpoint,
    x: State,
    mode: PerJoint | None = None,
):
    """What `SimulationResult` shows of a state, in the order of its fields."""
    state, tau_m, gear, _ = driven(robot, controller, setpoint, x, mode)
    accelerations = forward_dynamics(robot, *state[:6], tau_m, state.gear, mode)
    q, eta, _, qd, etad, _ = state[:6]
    qdd, etadd, _ = accelerations
    tool = tool_state(robot, q, eta, qd, etad, qdd, etadd)
    return *state[:6], *accelerations, tau_m, -gear, *tool
