"""What goes into a robot and what comes out: drives and sensors of its linear model."""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import is_concrete
from .._custom_types import PerElastic, PerJoint, Vector3, as_real
from .._taylor import leading
from ..dynamics import AbstractMotorController, ElasticRobot
from ..kinematics import forward_kinematics, moving_frames


class AbstractDrive(eqx.Module):
    """Which motor quantity is the input, and of which axes; the others are held.

    Attributes:
        axes: indices of the driven axes.
        hold: controller of the other axes; locked motors without one.
    """

    axes: eqx.AbstractVar[tuple[int, ...]]
    hold: eqx.AbstractVar[AbstractMotorController | None]

    @property
    @abc.abstractmethod
    def unit(self) -> str:
        """Of the inputs, for tables."""

    def held(self, robot: ElasticRobot) -> tuple[int, ...]:
        """The axes that are not driven.

        Raises:
            ValueError: an axis that the robot does not have, or the same twice.
        """
        axes = self.axes
        if any(not 0 <= k < robot.axes for k in axes) or len(set(axes)) != len(axes):
            raise ValueError(
                f"the driven axes must be different ones of 0 to {robot.axes - 1}, but "
                f"are {axes}"
            )
        return tuple(k for k in range(robot.axes) if k not in axes)


class MotorTorques(AbstractDrive):
    """Motor torques on the output side [N m].

    Attributes:
        axes: indices of the driven axes.
        hold: controller of the other axes; locked motors without one.
    """

    axes: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))
    hold: AbstractMotorController | None = None

    @property
    def unit(self) -> str:
        return "N m"


class MotorAngles(AbstractDrive):
    """Motor angles on the output side [rad], as a stiff position loop imposes them.

    With rigid gears they are the angles of the joints.

    Attributes:
        axes: indices of the driven axes.
        hold: controller of the other axes; locked motors without one.
    """

    axes: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))
    hold: AbstractMotorController | None = None

    @property
    def unit(self) -> str:
        return "rad"


class AbstractSensor(eqx.Module):
    """A quantity of the robot's position that is an output."""

    @abc.abstractmethod
    def measure(
        self, robot: ElasticRobot, q: PerJoint, eta: PerElastic, theta: PerJoint
    ) -> Float[Array, " outputs"]:
        """The outputs at a position of joints, structure and motors."""

    @abc.abstractmethod
    def names(self, robot: ElasticRobot) -> tuple[str, ...]:
        """Of the outputs, with their units."""


_LETTERS = ("x", "y", "z")


def _check_directions(directions: tuple[int, ...]) -> None:
    if not directions or any(k not in (0, 1, 2) for k in directions):
        raise ValueError(
            f"`directions` must be some of 0, 1, 2 for x, y, z, but are {directions}"
        )


class ToolPosition(AbstractSensor):
    """Position of the tool in the base frame [m].

    Attributes:
        directions: 0, 1, 2 for x, y, z.

    Raises:
        ValueError: another direction.
    """

    directions: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def __check_init__(self):
        _check_directions(self.directions)

    def measure(self, robot, q, eta, theta):
        pose = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))
        return pose[np.array(self.directions), 3]

    def names(self, robot):
        return tuple(f"tool {_LETTERS[k]} [m]" for k in self.directions)


class BodyPoint(AbstractSensor):
    """Position of a point that moves with a joint of the chain [m].

    Attributes:
        point: in the frame behind the joint's motion [m].
        joint: index among the joints of the chain; `robot.axis_joint` gives an axis'.
        directions: 0, 1, 2 for x, y, z of the base frame.
    """

    point: Vector3 = eqx.field(converter=as_real)
    joint: int = eqx.field(static=True)
    directions: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def __check_init__(self):
        _check_directions(self.directions)

    def measure(self, robot, q, eta, theta):
        rotation, position = _frame(robot, self.joint, q, eta)
        return (position + rotation @ self.point)[np.array(self.directions)]

    def names(self, robot):
        _check_index("joint", self.joint, robot.chain.number)
        label = f"point behind joint {self.joint}"
        return tuple(f"{label} {_LETTERS[k]} [m]" for k in self.directions)


class NodePoint(AbstractSensor):
    """Position of a node of a flexible link [m], its displacement of second order too.

    Attributes:
        node: index of the node; an array, so that a program takes any.
        link: index among the flexible links.
        directions: 0, 1, 2 for x, y, z of the base frame.

    References:
        [Reiner2010] (2.20), (2.21); section 3.5.1 for outputs along a beam.
    """

    node: Any = eqx.field(converter=jnp.asarray)
    link: int = eqx.field(static=True, default=0)
    directions: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def __check_init__(self):
        _check_directions(self.directions)

    def measure(self, robot, q, eta, theta):
        link = robot.modal_links[self.link]
        rotation, position = _frame(robot, link.joint, q, eta)
        nodes, shape = link.body.nodes, link.of(eta)
        at = nodes.position[self.node] + nodes.displacement(self.node, shape)
        return (position + rotation @ at)[np.array(self.directions)]

    def names(self, robot):
        _check_index("flexible link", self.link, len(robot.modal_links))
        name = robot.modal_links[self.link].body.name
        if is_concrete(self.node):
            nodes = robot.modal_links[self.link].body.nodes
            _check_index("node", int(self.node), nodes.number)
        return tuple(f"node of {name} {_LETTERS[k]} [m]" for k in self.directions)


class MotorEncoder(AbstractSensor):
    """Motor angles on the output side [rad]: the collocated sensor."""

    axes: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def measure(self, robot, q, eta, theta):
        return theta[np.array(self.axes)]

    def names(self, robot):
        return _angle_names("motor", robot, self.axes)


class JointEncoder(AbstractSensor):
    """Joint angles behind the gears [rad]."""

    axes: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def measure(self, robot, q, eta, theta):
        return q[np.array(self.axes)]

    def names(self, robot):
        return _angle_names("joint", robot, self.axes)


class SensorGroup(AbstractSensor):
    """Several sensors, one after the other."""

    sensors: tuple[AbstractSensor, ...]

    def measure(self, robot, q, eta, theta):
        parts = [sensor.measure(robot, q, eta, theta) for sensor in self.sensors]
        return jnp.concatenate(parts)

    def names(self, robot):
        return tuple(name for sensor in self.sensors for name in sensor.names(robot))


def _check_index(what: str, index: int, number: int) -> None:
    if not 0 <= index < number:
        raise ValueError(
            f"the sensor's {what} must be one of 0 to {number - 1}, but is {index}"
        )


def _angle_names(what: str, robot: ElasticRobot, axes: tuple[int, ...]):
    for axis in axes:
        _check_index("axis", axis, robot.axes)
    return tuple(f"{what} {robot.axis_names[k]} [rad]" for k in axes)


def _frame(robot: ElasticRobot, joint: int, q, eta):
    """Rotation and position [m] of the frame behind a joint's motion."""
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    return leading(frames.rotation)[joint], leading(frames.position)[joint]
