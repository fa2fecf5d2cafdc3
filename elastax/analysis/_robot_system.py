"""Robots as nonlinear systems of states, for Lie derivatives and zero dynamics."""

import jax.numpy as jnp
import numpy as np

from .._custom_types import PerElastic, PerJoint
from ..dynamics import ElasticRobot, forward_dynamics
from ._channels import MotorTorques
from ._control_system import ControlSystem
from ._linear_model import SignalNames
from ._robot_model import RobotChannel, with_linear_friction


def robot_system(
    robot: ElasticRobot,
    channel: RobotChannel = RobotChannel(),
    rest: PerJoint | None = None,
) -> ControlSystem:
    r"""A robot as a system that is affine in its motor torques.

    States $(q, \eta, \theta, \dot q, \dot\eta, \dot\theta)$, with rigid gears
    $(q, \eta, \dot q, \dot\eta)$. Inputs are the torques of the driven axes; the
    motors of the others take the torque `rest`. `linearise` gives its linear model at
    any state, along a motion too.

    Args:
        robot: the robot; without motor lag and without branches in its gears.
        channel: driven axes and outputs; friction counts as in `linear_robot`.
        rest: torques of the axes that are not driven [N m], shape (axes,); zero unless
            given.

    Raises:
        ValueError: angles as inputs, a controller for the other axes, or drive trains
            with memories of their own.

    References:
        [Reiner2010] (3.4), (3.14), (3.23) to (3.25).
    """
    if not isinstance(channel.inputs, MotorTorques) or channel.inputs.hold is not None:
        raise ValueError(
            "a nonlinear system of a robot takes motor torques, the other axes without "
            "a controller: give `MotorTorques(axes)`"
        )
    channel.inputs.held(robot)
    drives = robot.drives
    if drives.switches or drives.memory_states or drives.motor.lag is not None:
        raise ValueError(
            "a nonlinear system of a robot needs smooth drive trains without memory: "
            "leave out exact parts, branches and motor lags"
        )
    robot = with_linear_friction(robot, channel.speed)
    n, m = robot.axes, robot.elastic
    driven = np.array(channel.inputs.axes, int)
    others = jnp.zeros((n,)) if rest is None else jnp.asarray(rest)
    elastic_gears = robot.has_elastic_gears
    sizes = [n, m, n] if elastic_gears else [n, m]
    ends = np.cumsum([*sizes, *sizes])[:-1]

    def parts(
        x,
    ) -> tuple[PerJoint, PerElastic, PerJoint, PerJoint, PerElastic, PerJoint]:
        if elastic_gears:
            q, eta, theta, qd, etad, thetad = jnp.split(x, ends)
            return q, eta, theta, qd, etad, thetad
        q, eta, qd, etad = jnp.split(x, ends)
        return q, eta, q, qd, etad, qd

    def rate(x, u):
        q, eta, theta, qd, etad, thetad = parts(x)
        torque = others.at[driven].set(u)
        qdd, etadd, thetadd = forward_dynamics(
            robot, q, eta, theta, qd, etad, thetad, torque
        )
        if elastic_gears:
            return jnp.concatenate([qd, etad, thetad, qdd, etadd, thetadd])
        return jnp.concatenate([qd, etad, qdd, etadd])

    def output(x):
        return channel.outputs.measure(robot, *parts(x)[:3])

    names = [f"q {a}" for a in robot.axis_names] + list(robot.elastic_names)
    if elastic_gears:
        names += [f"theta {a}" for a in robot.axis_names]
    names += [f"{name}'" for name in names]
    inputs = tuple(f"motor torque {robot.axis_names[k]} [N m]" for k in driven)
    labels = SignalNames(tuple(names), inputs, channel.outputs.names(robot))
    return ControlSystem(rate, output, labels)
