"""What a feed-forward tells the motors, over time and between samples."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import PerJoint, Scalar, Times, as_real
from ..signals import UniformHermite


class MotorSample(eqx.Module):
    """What an inverse model computes for one time, on the output side.

    Attributes:
        theta, thetad, thetadd: motor angles [rad], speeds, accelerations, (axes,).
        tau_m: motor torques [N m].
        tau_a: torques behind the gears [N m].
        q: joint angles behind the gears [rad].
        eta: elastic coordinates [rad], (elastic,); empty if the inverse has none.
    """

    theta: PerJoint
    thetad: PerJoint
    thetadd: PerJoint
    tau_m: PerJoint
    tau_a: PerJoint
    q: PerJoint
    eta: Float[Array, " elastic"]


class MotorCommand(eqx.Module):
    r"""Motor angles, their derivatives and torques, referred to the output side.

    The elastic coordinates and joint angles that the inverse predicts travel along, for
    plots and comparison with a plant.

    Attributes:
        times: [s], shape (times,), uniform.
        theta, thetad, thetadd: motor angles [rad], speeds, accelerations,
            (times, axes).
        tau_m: motor torques on the output side [N m], (times, axes).
        tau_a: torques behind the gears [N m], (times, axes).
        q: joint angles behind the gears [rad], (times, axes).
        eta: elastic coordinates [rad], (times, elastic); empty if the inverse has none.
    """

    times: Times = eqx.field(converter=as_real)
    theta: Float[Array, "times axes"] = eqx.field(converter=as_real)
    thetad: Float[Array, "times axes"] = eqx.field(converter=as_real)
    thetadd: Float[Array, "times axes"] = eqx.field(converter=as_real)
    tau_m: Float[Array, "times axes"] = eqx.field(converter=as_real)
    tau_a: Float[Array, "times axes"] = eqx.field(converter=as_real)
    q: Float[Array, "times axes"] = eqx.field(converter=as_real)
    eta: Float[Array, "times elastic"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)

    @staticmethod
    def from_samples(times: Times, samples: MotorSample) -> "MotorCommand":
        """Command from samples whose fields have time as their leading axis."""
        return MotorCommand(
            times,
            samples.theta,
            samples.thetad,
            samples.thetadd,
            samples.tau_m,
            samples.tau_a,
            samples.q,
            samples.eta,
        )


class MotorSetpoint(eqx.Module):
    """A motor command at one time, all on the output side.

    Attributes:
        theta, thetad, thetadd: angle [rad], speed, acceleration, shape (axes,).
        tau_m: feed-forward torque [N m].
    """

    theta: PerJoint
    thetad: PerJoint
    thetadd: PerJoint
    tau_m: PerJoint


class CommandInterpolant(eqx.Module):
    """A motor command at any time; the last sample holds on after the end.

    Cubic Hermite interpolation of angles and speeds, from the slopes that the command
    brings along; accelerations and torques are interpolated with central slopes.
    """

    angle: UniformHermite
    speed: UniformHermite
    acceleration: UniformHermite
    torque: UniformHermite

    def __init__(self, command: MotorCommand):
        start = command.times[0]
        step = command.times[1] - command.times[0]

        def slopes(values):
            return jnp.asarray(jnp.gradient(values, axis=0)) / step

        self.angle = UniformHermite(start, step, command.theta, command.thetad)
        self.speed = UniformHermite(start, step, command.thetad, command.thetadd)
        self.acceleration = UniformHermite(
            start, step, command.thetadd, slopes(command.thetadd)
        )
        self.torque = UniformHermite(start, step, command.tau_m, slopes(command.tau_m))

    def __call__(self, t: Scalar) -> MotorSetpoint:
        return MotorSetpoint(
            self.angle(t), self.speed(t), self.acceleration(t), self.torque(t)
        )
