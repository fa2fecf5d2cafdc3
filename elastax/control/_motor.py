"""Controllers at the motors."""

import equinox as eqx
import jax.numpy as jnp

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, as_real
from ..dynamics import AbstractMotorController, ControllerMemory, MotorSetpoint


class IdealMotorControl(AbstractMotorController):
    """The motors follow the commanded angles exactly, whatever torque it takes.

    A lag of the motors has no effect on such motors, but on the torque that is shown.

    References:
        [Reiner2010] section 3.8.3, figures 3.23 and 3.24.
    """

    def motors(
        self, setpoint: MotorSetpoint, theta: PerJoint, thetad: PerJoint
    ) -> tuple[PerJoint, PerJoint]:
        return setpoint.theta, setpoint.thetad

    def torque(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        inertia: PerJoint,
        load: PerJoint,
        memory: ControllerMemory,
    ) -> PerJoint:
        return inertia * setpoint.thetadd + load

    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        return setpoint.theta

    @property
    def states(self) -> int:
        return 0

    def rates(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        memory: ControllerMemory,
    ) -> ControllerMemory:
        return memory

    def resting_memory(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> ControllerMemory:
        return jnp.zeros((0, load.shape[0]), load.dtype)


class CascadeMotorControl(AbstractMotorController):
    r"""Position and speed loop at the motor, with feed-forward, without integrator.

    $\tau = \tau_{ff} + \Theta w_v (\dot\theta_{ref} - \dot\theta) +
    \Theta w_v k_p (\theta_{ref} - \theta)$.

    Attributes:
        speed_bandwidth: $w_v$ [1/s].
        position_gain: $k_p$ [1/s].

    References:
        [Reiner2010] section 5.1 for the structure; the gains are ours.
    """

    speed_bandwidth: Scalar = eqx.field(converter=as_real, default=60.0)
    position_gain: Scalar = eqx.field(converter=as_real, default=15.0)

    def __check_init__(self):
        check_fields(self)
        for name in ("speed_bandwidth", "position_gain"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive [1/s]", value, value > 0)

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
        speed = setpoint.thetad - thetad
        angle = setpoint.theta - theta
        gain = inertia * self.speed_bandwidth
        return setpoint.tau_m + gain * (speed + self.position_gain * angle)

    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        stiffness = inertia * self.speed_bandwidth * self.position_gain
        return setpoint.theta + (setpoint.tau_m - load) / stiffness

    @property
    def states(self) -> int:
        return 0

    def rates(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        memory: ControllerMemory,
    ) -> ControllerMemory:
        return memory

    def resting_memory(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> ControllerMemory:
        return jnp.zeros((0, load.shape[0]), load.dtype)
