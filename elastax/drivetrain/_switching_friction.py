"""Exact dry friction, whose state switches between sticking and sliding."""

import abc

import equinox as eqx
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real


class AbstractSwitchingFriction(eqx.Module):
    """Friction with a jump at rest: torques of each direction by themselves.

    At rest the torque is what keeps the shaft there, as long as that stays below the
    torque at which it breaks away.
    """

    @abc.abstractmethod
    def torque(
        self, speed: Float[Array, "..."], direction: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        """Friction torque [N m] while sliding.

        Args:
            speed: [rad/s]; at zero the limit from the side of `direction`.
            direction: +1 or -1, that of the motion.
        """

    @abc.abstractmethod
    def breakaway(self, direction: Float[Array, "..."]) -> Float[Array, "..."]:
        """Torque [N m] that a shaft at rest withstands in a direction, signed."""


class StickSlipFriction(AbstractSwitchingFriction):
    r"""Coulomb and viscous friction with sticking.

    Sliding $\tau_r = \tau_v v + \tau_h\,\mathrm{sgn}\,v$, at rest up to $p\,\tau_h$.

    Attributes:
        viscous: $\tau_v \ge 0$ [N m s/rad].
        coulomb: $\tau_h \ge 0$ [N m].
        peak: $p \ge 1$, torque that starts a motion over the one that keeps it.

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] section 2.2, the state switching after (2.4), in words.
    """

    viscous: Float[Array, " *joints"] = eqx.field(converter=as_real)
    coulomb: Float[Array, " *joints"] = eqx.field(converter=as_real)
    peak: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`viscous` must not be negative", self.viscous, self.viscous >= 0)
        check_values("`coulomb` must not be negative", self.coulomb, self.coulomb >= 0)
        check_values("`peak` must be at least 1", self.peak, self.peak >= 1)

    def torque(
        self, speed: Float[Array, "..."], direction: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        return self.viscous * speed + self.coulomb * direction

    def breakaway(self, direction: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.peak * self.coulomb * direction
