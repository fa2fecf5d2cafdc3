"""Losses in the teeth of a gear that depend on their load."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real
from ._efficiency import AbstractEfficiency
from ._friction import AbstractFriction
from ._friction._tanh import tanh


_HALVINGS = 32
_NEWTON_STEPS = 4


class AbstractMesh(eqx.Module):
    """Lossy teeth between the motor and the gear's spring, all on the output side."""

    @abc.abstractmethod
    def drive_torque(
        self, load: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Torque [N m] that the motor side brings where the teeth hand on `load`.

        Args:
            load: torque handed on to the spring [N m]; power flows to the link where
                load times speed is positive.
            speed: of the motor side [rad/s].
        """

    @abc.abstractmethod
    def load_torque(
        self, drive: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Torque handed on [N m] where the motor side brings `drive`: the inverse."""


class DirectionalEfficiency(AbstractMesh):
    r"""Efficiency that depends smoothly on the direction of the power.

    $$\tau_B = \tau_A - \xi\,[(1 - \eta_1)\,\tau_A + \tau_{r1}] - (1 - \xi)\,[(1 -
      1/\eta_2)\,\tau_A + \tau_{r2}],\quad
      \xi = \tfrac1\pi\arctan(s\,\tau_A\omega_A) + \tfrac12$$

    with $\tau_B$ the load that is handed on and the frictions $\tau_r(\omega_A)$ of the
    two directions. As long as the friction of driving is not above that of being
    driven, $\tau_B$ rises with $\tau_A$, by $\eta_1$ at least, and the inverse is
    unique; with more friction while driving there would be torques that drive and are
    driven at once. At standstill half of both directions acts and the teeth keep
    $(2 - \eta_1 - 1/\eta_2)\,\tau_A/2$; with small positive power they even gain some,
    until $\xi/(1 - \xi) > (1/\eta_2 - 1)/(1 - \eta_1)$, which friction hides. Friction
    here is not to be counted again in the motor's.

    Attributes:
        driving: $\eta_1$ while the motor drives.
        driven: $\eta_2$ while the load drives.
        steepness: $s > 0$ [1/W].
        driving_friction: $\tau_{r1}$, or `None`.
        driven_friction: $\tau_{r2}$, or `None`.

    Raises:
        ValueError: the steepness is not positive.

    References:
        [Reiner2010] (2.11) with i = 1, the smooth form of (2.10).
    """

    driving: AbstractEfficiency
    driven: AbstractEfficiency
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    driving_friction: AbstractFriction | None = None
    driven_friction: AbstractFriction | None = None

    def __check_init__(self):
        check_fields(self)
        check_values("`steepness` must be positive", self.steepness, self.steepness > 0)

    def load_torque(
        self, drive: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        forward = self._share(drive, speed)
        driving, driven, friction_1, friction_2 = self._ends(speed)
        return forward * (driving * drive - friction_1) + (1.0 - forward) * (
            drive / driven - friction_2
        )

    def drive_torque(
        self, load: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        return _drive_torque(self, load, speed)

    def share_driving(
        self, drive: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        r"""$\xi$ between 0, driven by the load, and 1, driven by the motor."""
        return self._share(drive, speed)

    def _share(self, drive, speed):
        return jnp.arctan(self.steepness * speed * drive) / jnp.pi + 0.5

    def _ends(self, speed):
        none = jnp.zeros_like(speed)
        frictions = (self.driving_friction, self.driven_friction)
        return (
            self.driving.value(speed),
            self.driven.value(speed),
            *(none if law is None else law.torque(speed) for law in frictions),
        )


@jax.custom_jvp
def _drive_torque(mesh, load, speed):
    """The share by halving an interval, then Newton's method for the torque.

    For a given share the torque is a quotient of linear functions of it, which lies
    between those of either direction alone.
    """
    driving, driven, friction_1, friction_2 = mesh._ends(speed)

    def drive_at(share):
        held = load + share * friction_1 + (1.0 - share) * friction_2
        return held / (share * driving + (1.0 - share) / driven)

    share, width = 0.5 * jnp.ones_like(load * speed), 0.25
    for _ in range(_HALVINGS):
        more = mesh._share(drive_at(share), speed) > share
        share, width = share + jnp.where(more, width, -width), 0.5 * width
    drive = drive_at(share)
    for _ in range(_NEWTON_STEPS):
        value, slope = jax.jvp(
            lambda d: mesh.load_torque(d, speed), (drive,), (jnp.ones_like(drive),)
        )
        drive = drive - (value - load) / slope
    return drive


@_drive_torque.defjvp
def _drive_torque_jvp(primals, tangents):
    mesh, load, speed = primals
    mesh_change, load_change, speed_change = tangents
    drive = _drive_torque(mesh, load, speed)
    _, slope = jax.jvp(
        lambda d: mesh.load_torque(d, speed), (drive,), (jnp.ones_like(drive),)
    )
    _, held = jax.jvp(
        lambda m, w: m.load_torque(drive, w),
        (mesh, speed),
        (mesh_change, speed_change),
    )
    return drive, (load_change - held) / slope


class LoadFriction(AbstractMesh):
    r"""Dry friction that grows with the load.

    $$\tau_A = \tau_B + \tanh(s\omega/2)\,\bigl[\mu + \mu_s e^{-(\omega/\omega_s)^2}
      \bigr]\,|\tau_B|_\varepsilon$$

    with $|\tau|_\varepsilon = \sqrt{\tau^2 + \varepsilon^2} - \varepsilon$. The text
    names the dependence on the load as the fourth part of friction and leaves it out,
    as small; this form is the one measured on an industrial arm.

    Attributes:
        coulomb: $\mu \ge 0$, share of the load [-].
        stribeck: $\mu_s \ge 0$, share that falls off with the speed [-]; both together
            must stay below one.
        stribeck_speed: $\omega_s > 0$ [rad/s].
        steepness: $s > 0$ [s/rad].
        rounding: $\varepsilon > 0$ of the load's magnitude [N m].

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Bittencourt2012] for the terms; [Reiner2010] section 2.2, component 4.
    """

    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    stribeck: Float[Array, " *joints"] = eqx.field(converter=as_real)
    stribeck_speed: Float[Array, " *joints"] = eqx.field(converter=as_real)
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)
    rounding: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("coulomb", "stribeck"):
            value = getattr(self, name)
            check_values(f"`{name}` must not be negative", value, value >= 0)
        whole = self.coulomb + self.stribeck
        check_values("`coulomb` and `stribeck` must stay below 1", whole, whole < 1)
        for name in ("stribeck_speed", "steepness", "rounding"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    def drive_torque(
        self, load: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        root = _root(load, self.rounding)
        return load + self._share(speed) * (load * (load / (root + self.rounding)))

    def load_torque(
        self, drive: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        # a quadratic equation: (D - L)^2 = a^2 (L^2 + e^2) with D = drive + a e
        share = self._share(speed)
        whole = drive + share * self.rounding
        rest = 1.0 - share**2
        root = _root(whole, jnp.sqrt(rest) * self.rounding)
        # of the two forms of the root of the equation the one that does not cancel
        alike = share * whole >= 0
        below = jnp.where(alike, whole + share * root, jnp.ones_like(whole))
        product = drive * (whole + share * self.rounding)
        safe = jnp.where(below == 0, jnp.ones_like(below), below)
        return jnp.where(alike, product / safe, (whole - share * root) / rest)

    def _share(self, speed):
        # bounded, so that its square does not overflow
        ratio = jnp.clip(speed / self.stribeck_speed, -1e3, 1e3)
        falling = self.stribeck * jnp.exp(-(ratio**2))
        return tanh(0.5 * self.steepness * speed) * (self.coulomb + falling)


def _root(x, y):
    """Square root of x^2 + y^2 for y > 0, without overflow."""
    ratio = jnp.clip(x / y, -1e8, 1e8)
    return jnp.where(jnp.abs(x) < 1e8 * y, y * jnp.sqrt(1.0 + ratio**2), jnp.abs(x))
