"""Exact efficiency of a gear, whose law switches with the flow of power."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real


class AbstractSwitchingMesh(eqx.Module):
    """Lossy teeth whose torques jump where the motion turns."""

    @abc.abstractmethod
    def drive_torque(
        self,
        load: Float[Array, "..."],
        speed: Float[Array, "..."],
        direction: Float[Array, "..."],
    ) -> Float[Array, "..."]:
        """Torque [N m] that the motor side brings where the teeth hand on `load`.

        Args:
            load: torque handed on to the spring [N m].
            speed: of the motor side [rad/s]; at zero the limit from the side of
                `direction`.
            direction: +1 or -1, that of the motion.
        """


class ExactEfficiency(AbstractSwitchingMesh):
    r"""Efficiency by the direction of the power.

    $\tau_A = \tau_B/\eta_1$ where the motor drives, $\tau_B\omega > 0$, and
    $\tau_A = \eta_2\tau_B$ where the load does. At rest every torque in between keeps
    the teeth there.

    Attributes:
        driving: $\eta_1$, above zero and up to one.
        driven: $\eta_2$, the same.

    Raises:
        ValueError: an efficiency is outside (0, 1], or their shapes differ.

    References:
        [Reiner2010] (2.10).
    """

    driving: Float[Array, " *joints"] = eqx.field(converter=as_real)
    driven: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("driving", "driven"):
            value = getattr(self, name)
            check_values(
                f"efficiency `{name}` must be above zero and up to one",
                value,
                (value > 0) & (value <= 1),
            )

    def drive_torque(
        self,
        load: Float[Array, "..."],
        speed: Float[Array, "..."],
        direction: Float[Array, "..."],
    ) -> Float[Array, "..."]:
        forward = load * direction > 0
        return jnp.where(forward, load / self.driving, self.driven * load)
