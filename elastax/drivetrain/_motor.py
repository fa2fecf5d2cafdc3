"""Motors: rotor, torque constant and first-order lag of the torque."""

import equinox as eqx

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_optional_real, as_real


class Motor(eqx.Module):
    r"""Motor of every axis as an inertia that a torque drives.

    $$\tau_m + T_m \dot\tau_m = k_T I_m$$

    The lag and the constant are linear, so that `torque_rate` and `command` hold for
    torques of either gear side; the inertia and the constant are those of the motor
    side. Cogging is left out, as in the text.

    Attributes:
        inertia: of rotor and shaft, motor side [kg m^2], shape (joints,).
        torque_constant: $k_T > 0$, motor side [N m/A], or `None` where torques are
            commanded.
        lag: $T_m > 0$ of the current loop [s], or `None` for a torque without a lag.

    Raises:
        ValueError: a parameter is not positive, or their shapes differ.

    References:
        [Reiner2010] (2.2).
    """

    inertia: PerJoint = eqx.field(converter=as_real)
    torque_constant: PerJoint | None = eqx.field(
        converter=as_optional_real, default=None
    )
    lag: PerJoint | None = eqx.field(converter=as_optional_real, default=None)

    def __check_init__(self):
        check_fields(self)
        for name, unit in (
            ("inertia", "kg m^2"),
            ("torque_constant", "N m/A"),
            ("lag", "s"),
        ):
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != self.inertia.shape:
                raise ValueError(
                    f"`{name}` must hold one value per joint, shape "
                    f"{self.inertia.shape}, but has {value.shape}"
                )
            check_values(f"motor `{name}` must be positive [{unit}]", value, value > 0)

    def torque_rate(self, torque: PerJoint, command: PerJoint) -> PerJoint:
        r"""Rate of the torque [N m/s] under a command, $(\tau_{cmd} - \tau_m)/T_m$.

        Args:
            torque: that acts now [N m].
            command: $\tau_{cmd} = k_T I_m$ [N m].

        Raises:
            ValueError: the motor has no lag.
        """
        if self.lag is None:
            raise ValueError("a motor without `lag` has no torque of its own to change")
        return (command - torque) / self.lag

    def command(self, torque: PerJoint, torque_rate: PerJoint) -> PerJoint:
        r"""Command [N m] for a wanted torque, $\tau_m + T_m\dot\tau_m$: the inverse.

        Args:
            torque: that shall act [N m].
            torque_rate: its rate [N m/s]; without effect for a motor without a lag.
        """
        if self.lag is None:
            return torque
        return torque + self.lag * torque_rate

    def current(self, command: PerJoint) -> PerJoint:
        """Current [A] of a commanded torque on the motor side [N m]."""
        return command / _constant(self)

    def commanded_torque(self, current: PerJoint) -> PerJoint:
        """Torque on the motor side [N m] that a current [A] commands."""
        return _constant(self) * current


def _constant(motor: Motor) -> PerJoint:
    if motor.torque_constant is None:
        raise ValueError("give the motor its `torque_constant` [N m/A] first")
    return motor.torque_constant
