"""Drive trains of all axes, assembled from parts and referred to the output side."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_real
from .._taylor import compose
from ..structure import AbstractStiffness
from ._backlash import Backlash
from ._branch import AbstractGearBranch, AbstractSwitchingBranch
from ._friction import AbstractFriction
from ._mesh import AbstractMesh
from ._motor import Motor
from ._switching_friction import AbstractSwitchingFriction
from ._switching_mesh import AbstractSwitchingMesh
from ._transmission_error import TransmissionError


GearMemory = Float[Array, "states joints"]


class DriveTrain(eqx.Module):
    r"""Motor, friction, teeth and elastic gear of every axis.

    Angles and torques are those of the output side: $\varphi = \varphi_m / i$,
    $\tau = i\,\tau_m$, $\Theta = i^2 J$. From the motor to the link:

    | part | law |
    |---|---|
    | `motor` | $\Theta\ddot\theta = \tau_m - \tau_r(\dot\theta) - \tau_A$, with a lag $T_m\dot\tau_m = \tau_{cmd} - \tau_m$ if it has one |
    | `motor_friction` | $\tau_r(\dot\theta)$ |
    | `mesh` | $\tau_A$ for the torque that the teeth hand on; without one they are equal |
    | `transmission_error` | $\varphi_B(\theta)$, the angle behind the teeth; $\theta$ itself without one |
    | `stiffness`, `damping`, `branch` | $\tau_g = k(x) + d\,\dot x + b(x, z)$ with the torsion $x = q - \varphi_B$ and the memory z of the branch |
    | `joint_friction` | $\tau_{ra}(\dot q)$ |

    $\tau_g$ acts on the motor and, with the opposite sign, on the link. The gyroscopic
    coupling of the rotors to the structure is neglected, as in the text. Parts are
    swapped by `dataclasses.replace`, or for a robot by `robot.with_drives`. Exact parts
    whose equations switch are for plants: `simulate` takes them, the inverses do not.

    Attributes:
        ratio: gear ratios motor / output, shape (joints,); the sign is kept.
        motor: rotor, torque constant and lag of the motors, on the motor side.
        stiffness: gear stiffness laws [N m], or `None` for rigid gears.
        damping: gear damping [N m s/rad].
        motor_friction: friction of motor and gear input, as a function of the motor's
            speed on the output side.
        joint_friction: friction behind the gear, as a function of the joint's speed.
        branch: element with a memory in parallel to the gear's spring, or `None`.
        mesh: losses in the teeth that depend on their load, or `None`.
        transmission_error: of the teeth, or `None` for an ideal ratio.

    References:
        [Reiner2010] (2.2) to (2.19), (2.38), section 2.3.1 for the referral.
    """  # noqa: E501

    ratio: PerJoint = eqx.field(converter=as_real)
    motor: Motor
    stiffness: AbstractStiffness | Backlash | None
    damping: PerJoint = eqx.field(converter=as_real)
    motor_friction: AbstractFriction | AbstractSwitchingFriction
    joint_friction: AbstractFriction
    branch: AbstractGearBranch | AbstractSwitchingBranch | None = None
    mesh: AbstractMesh | AbstractSwitchingMesh | None = None
    transmission_error: TransmissionError | None = None

    def __check_init__(self):
        check_fields(self)
        check_values("`ratio` must not be zero", self.ratio, self.ratio != 0)
        check_values(
            "gear `damping` must be positive [N m s/rad]: the inverse drive train "
            "divides by it",
            self.damping,
            self.damping > 0,
        )

    @property
    def number(self) -> int:
        """Number of axes."""
        return self.ratio.shape[0]

    @property
    def memory_states(self) -> int:
        """Number of states per axis that the gear's branch remembers."""
        return 0 if self.branch is None else self.branch.states

    @property
    def sticks(self) -> bool:
        """Whether the motors can stick: dry friction or teeth with a jump at rest."""
        dry = isinstance(self.motor_friction, AbstractSwitchingFriction)
        return dry or isinstance(self.mesh, AbstractSwitchingMesh)

    @property
    def switches(self) -> bool:
        """Whether a part is exact and switches, so that only plants may have it."""
        return self.sticks or isinstance(self.branch, AbstractSwitchingBranch)

    @property
    def invertible(self) -> bool:
        """Whether every part has an inverse, as feed-forwards need it."""
        return not self.switches and not isinstance(self.stiffness, Backlash)

    @property
    def extra_order(self) -> int:
        """Derivatives that the exact inverse needs beyond those of an ideal motor."""
        return 0 if self.motor.lag is None else 1

    def reflected_inertia(self) -> PerJoint:
        r"""Rotor inertia on the output side, $\Theta = i^2 J$ [kg m^2]."""
        return self.ratio**2 * self.motor.inertia

    def gear_torque(
        self,
        torsion: PerJoint,
        torsion_rate: PerJoint,
        memory: GearMemory | None = None,
    ) -> PerJoint:
        """Torque of spring, damper and branch [N m].

        Args:
            torsion: joint angle minus the angle behind the teeth [rad].
            torsion_rate: its rate [rad/s].
            memory: of the branch, shape (states, joints); only with a branch.

        References:
            [Reiner2010] (2.7), (2.9), (2.19), the linear damper of section 2.3.2.
        """
        match self.stiffness:
            case Backlash() as gap:
                spring = gap.contact
                torque = gap.torque(torsion, torsion_rate, self.damping)
            case _:
                spring = _spring(self)
                torque = compose(spring.torque, torsion) + torsion_rate * self.damping
        if self.branch is None:
            return torque
        return torque + self.branch.torque(spring, torsion, _given(memory))

    def memory_rates(
        self, torsion: PerJoint, torsion_rate: PerJoint, memory: GearMemory
    ) -> GearMemory:
        """Rates of the branch's memory; empty without a branch."""
        match self.branch:
            case None:
                return memory
            case AbstractSwitchingBranch():
                return jnp.zeros_like(memory)  # renewed after every step
            case branch:
                return branch.rates(torsion, torsion_rate, memory)

    def resting_memory(self, torsion: PerJoint) -> GearMemory:
        """Memory of a gear that was never loaded beyond `torsion` and rests there."""
        if self.branch is None:
            return jnp.zeros((0, self.number), torsion.dtype)
        return self.branch.rest(torsion)

    def resting_torque(self, torsion: PerJoint) -> PerJoint:
        """Torque of the gear [N m] at rest, loaded once up to `torsion` [rad]."""
        match self.stiffness:
            case Backlash() as gap:
                spring, torque = gap.contact, gap.resting_torque(torsion)
            case _:
                spring = _spring(self)
                torque = spring.torque(torsion)
        if self.branch is None:
            return torque
        return torque + self.branch.torque(spring, torsion, self.branch.rest(torsion))

    def behind_teeth(self, theta: Any) -> Any:
        """Angle behind the teeth [rad] at the motor angle `theta`, array or series."""
        if self.transmission_error is None:
            return theta
        return compose(self.transmission_error.output_angle, theta)

    def before_teeth(self, angle: Any) -> Any:
        """Motor angle [rad] at the angle behind the teeth, array or series."""
        if self.transmission_error is None:
            return angle
        return compose(self.transmission_error.motor_angle, angle)

    def motion_behind_teeth(
        self, theta: PerJoint, thetad: PerJoint
    ) -> tuple[PerJoint, PerJoint]:
        """Angle [rad] and speed [rad/s] behind the teeth."""
        if self.transmission_error is None:
            return theta, thetad
        angle = self.transmission_error.output_angle(theta)
        return angle, thetad / _speed_ratio(self.transmission_error, angle)

    def motor_load(
        self,
        gear: PerJoint,
        angle: PerJoint,
        thetad: PerJoint,
        direction: PerJoint | None = None,
    ) -> PerJoint:
        """What gear and friction ask of the motor: `h_m` [N m].

        Args:
            gear: torque of the gear, `gear_torque` [N m].
            angle: behind the teeth [rad].
            thetad: motor speed [rad/s].
            direction: of the motion, +1 or -1, for parts that switch. Without it their
                friction is left out: at rest it is whatever keeps the motor there.

        References:
            [Reiner2010] (2.3), (2.6c), (2.10), (2.11), (2.38).
        """
        drive = self._drive(-gear, angle, thetad, direction)
        match self.motor_friction:
            case AbstractSwitchingFriction() as dry:
                if direction is None:
                    return drive
                return dry.torque(thetad, direction) + drive
            case friction:
                return friction.torque(thetad) + drive

    def breakaway(
        self, gear: PerJoint, angle: PerJoint, direction: PerJoint
    ) -> PerJoint:
        """Motor torque [N m] at which a sticking motor starts in a direction.

        Args:
            gear: torque of the gear [N m].
            angle: behind the teeth [rad].
            direction: +1 or -1.
        """
        drive = self._drive(-gear, angle, 0.0 * angle, direction)
        match self.motor_friction:
            case AbstractSwitchingFriction() as dry:
                return dry.breakaway(direction) + drive
            case friction:
                return friction.torque(0.0 * angle) + drive

    def _drive(self, load, angle, thetad, direction):
        """Torque that drives the teeth when they hand on `load`."""
        if self.transmission_error is not None:
            # no loss: equal powers
            load = load / _speed_ratio(self.transmission_error, angle)
        match self.mesh:
            case None:
                return load
            case AbstractSwitchingMesh() as exact:
                if direction is None:
                    return load
                return exact.drive_torque(load, thetad, direction)
            case mesh:
                return mesh.drive_torque(load, thetad)

    def rigid(self) -> "DriveTrain":
        """The same drive trains with rigid gears."""
        return dataclasses.replace(self, stiffness=None, branch=None)

    def to_motor_torque(self, torque: PerJoint) -> PerJoint:
        """Motor-side torque [N m] of an output-side one."""
        return torque / self.ratio

    def to_motor_angle(self, angle: PerJoint) -> PerJoint:
        """Motor-side angle [rad] (or speed) of an output-side one."""
        return angle * self.ratio

    def to_output_torque(self, torque: PerJoint) -> PerJoint:
        """Output-side torque [N m] of a motor-side one."""
        return torque * self.ratio

    def to_output_angle(self, angle: PerJoint) -> PerJoint:
        """Output-side angle [rad] (or speed) of a motor-side one."""
        return angle / self.ratio


def _speed_ratio(error: TransmissionError, angle):
    """Motor speed over the speed behind the teeth, one for an ideal ratio."""
    # not `error.ratio`: its derivatives are those of the angle, in any order
    return jax.jvp(error.motor_angle, (angle,), (jnp.ones_like(angle),))[1]


def _spring(drives: DriveTrain) -> AbstractStiffness:
    if not isinstance(drives.stiffness, AbstractStiffness):
        raise ValueError("a rigid gear has no torque of its own: use elastic gears")
    return drives.stiffness


def _given(memory: GearMemory | None) -> GearMemory:
    if memory is None:
        raise ValueError(
            "the gear has a branch with a memory: hand its states over as `memory`"
        )
    return memory
