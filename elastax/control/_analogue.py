"""Cascade of position and speed over an analogue current loop, with its electronics."""

import equinox as eqx
import jax.numpy as jnp

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, as_real
from ..dynamics import AbstractMotorController, ControllerMemory, MotorSetpoint


class AnalogueCascade(AbstractMotorController):
    r"""P-PI cascade at the motor, whose current an operational amplifier controls.

    On the motor side, with $\varphi_m = i\,\theta$, the speed error $u = k_p\,i\,
    (\theta_{ref} - \theta) + i\,(\dot\theta_{ref} - \dot\theta)$ and the states x of
    the integrator, v of the capacitor and I of the current,

    $$T_s\dot x = u,\quad I_{ref} = k_s\,(x + u),\quad R_i C\,\dot v = I - I_{ref},\quad
      L\,\dot I = -G v - R I - k\,\dot\varphi_m,\quad \tau_m = i\,k\,I.$$

    Attributes:
        ratio: $i$, motor over output; the sign is kept.
        position_gain: $k_p$ [1/s].
        speed_gain: $k_s$ [A s/rad].
        reset_time: $T_s$ of the integrator [s].
        torque_constant: $k$ [N m/A], also that of the induced voltage [V s/rad].
        resistance: $R$ of the armature [ohm].
        inductance: $L$ of the armature [H].
        integration: $R_i C$ of the current controller [s].
        amplification: $G$ of the power stage [-].

    Raises:
        ValueError: a parameter is not positive, the ratio is zero, or shapes differ.

    References:
        Modelica Standard Library 4.1.0, RobotR3.Utilities: Controller and Motor, whose
        circuit of three amplifiers these equations are.
    """

    ratio: PerJoint = eqx.field(converter=as_real)
    position_gain: PerJoint = eqx.field(converter=as_real)
    speed_gain: PerJoint = eqx.field(converter=as_real)
    reset_time: PerJoint = eqx.field(converter=as_real)
    torque_constant: PerJoint = eqx.field(converter=as_real)
    resistance: Scalar = eqx.field(converter=as_real)
    inductance: PerJoint = eqx.field(converter=as_real)
    integration: PerJoint = eqx.field(converter=as_real)
    amplification: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`ratio` must not be zero", self.ratio, self.ratio != 0)
        for name in (
            "position_gain",
            "speed_gain",
            "reset_time",
            "torque_constant",
            "resistance",
            "inductance",
            "integration",
            "amplification",
        ):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    @property
    def states(self) -> int:
        return 3

    def motors(
        self, setpoint: MotorSetpoint, theta: PerJoint, thetad: PerJoint
    ) -> tuple[PerJoint, PerJoint]:
        return theta, thetad

    def torque(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        inertia: PerJoint,
        load: PerJoint,
        memory: ControllerMemory,
    ) -> PerJoint:
        return self.ratio * self.torque_constant * memory[2]

    def rates(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        memory: ControllerMemory,
    ) -> ControllerMemory:
        integral, voltage, current = memory
        u = self._speed_error(setpoint, theta, thetad)
        wanted = self.speed_gain * (integral + u)
        induced = self.torque_constant * self.ratio * thetad
        drop = self.amplification * voltage + self.resistance * current + induced
        return jnp.stack(
            [
                u / self.reset_time,
                (current - wanted) / self.integration,
                -drop / self.inductance,
            ]
        )

    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        return setpoint.theta

    def resting_memory(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> ControllerMemory:
        return self.steady_memory(setpoint, setpoint.theta, load)

    def steady_memory(
        self, setpoint: MotorSetpoint, theta: PerJoint, load: PerJoint
    ) -> ControllerMemory:
        """States in which the current is steady and carries a load [N m].

        Args:
            setpoint: what is asked for.
            theta: motor angles at rest [rad]; away from the setpoint the integrator
                holds against it, but does not rest.
            load: torque on the output side [N m].
        """
        current = load / (self.ratio * self.torque_constant)
        u = self._speed_error(setpoint, theta, jnp.zeros_like(theta))
        integral = current / self.speed_gain - u
        voltage = -self.resistance * current / self.amplification
        return jnp.stack([integral, voltage, current])

    def _speed_error(self, setpoint, theta, thetad):
        angle = self.ratio * (setpoint.theta - theta)
        return self.position_gain * angle + self.ratio * (setpoint.thetad - thetad)
