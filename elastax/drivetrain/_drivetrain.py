"""Drive trains of all axes: motor, gear and friction, referred to the output side."""

import equinox as eqx

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_real
from .._taylor import compose
from ..structure import AbstractStiffness
from ._friction import AbstractFriction


class DriveTrain(eqx.Module):
    r"""Motor, friction and elastic gear of every axis.

    Angles and torques are those of the output side: $\varphi = \varphi_m / i$,
    $\tau = i\,\tau_m$, $\Theta = i^2 J$. The gear transmits
    $\tau_g = k(q - \theta) + d\,(\dot q - \dot\theta)$, which acts on the motor and,
    with the opposite sign, on the link. The gyroscopic coupling of the rotors to the
    structure is neglected, as in the text.

    Attributes:
        ratio: gear ratios motor / output, shape (joints,); the sign is kept.
        motor_inertia: rotor inertias on the motor side [kg m^2].
        stiffness: gear stiffness laws [N m], or `None` for rigid gears.
        damping: gear damping [N m s/rad].
        motor_friction: friction of motor and gear input, as a function of the motor's
            speed on the output side.
        joint_friction: friction behind the gear, as a function of the joint's speed.

    References:
        [Reiner2010] (2.3), (2.7), (2.9), (2.38), section 2.3.1 for the referral.
    """

    ratio: PerJoint = eqx.field(converter=as_real)
    motor_inertia: PerJoint = eqx.field(converter=as_real)
    stiffness: AbstractStiffness | None
    damping: PerJoint = eqx.field(converter=as_real)
    motor_friction: AbstractFriction
    joint_friction: AbstractFriction

    def __check_init__(self):
        check_fields(self)
        check_values("`ratio` must not be zero", self.ratio, self.ratio != 0)
        check_values(
            "`motor_inertia` must be positive [kg m^2]",
            self.motor_inertia,
            self.motor_inertia > 0,
        )
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

    def reflected_inertia(self) -> PerJoint:
        r"""Rotor inertia on the output side, $\Theta = i^2 J$ [kg m^2]."""
        return self.ratio**2 * self.motor_inertia

    def gear_torque(self, torsion: PerJoint, torsion_rate: PerJoint) -> PerJoint:
        """Torque of spring and damper [N m] at `torsion` = q - theta [rad].

        References:
            [Reiner2010] (2.7), (2.9) and the linear damper of section 2.3.2.
        """
        if self.stiffness is None:
            raise ValueError("a rigid gear has no torque of its own: use elastic gears")
        return compose(self.stiffness.torque, torsion) + torsion_rate * self.damping

    def rigid(self) -> "DriveTrain":
        """The same drive trains with rigid gears."""
        return DriveTrain(
            self.ratio,
            self.motor_inertia,
            None,
            self.damping,
            self.motor_friction,
            self.joint_friction,
        )

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
