"""Exact backlash: teeth that part, touch and never pull."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import as_real
from ..structure import AbstractStiffness


class Backlash(eqx.Module):
    r"""Spring and damper behind a gap, without sticking, for plants.

    With $\delta = \varphi_{rel} - \varphi_0$ the teeth touch where $|\delta| > b/2$.
    There the spring gives $\tau_c = k(\delta \mp b/2)$ and the damper $\tau_d =
    d\,\dot\varphi_{rel}$, which is limited: it pushes by no more than the spring does,
    so that the torque starts from zero, and the sum never pulls. The text tests
    $\varphi_{rel}$ itself, which makes the torque jump by $k(\varphi_0)$ where the gap
    is not centred, and lets the damper pull. In contact the stiffness belongs to the
    contact's depth and not to the torsion.

    The torque is zero throughout the gap: the law has no inverse. Feed-forwards take
    `BacklashStiffness` in its place.

    Attributes:
        contact: spring law of the teeth in contact.
        width: total play $b \ge 0$ [rad].
        centre: $\varphi_0$, torsion in the middle of the gap [rad].

    Raises:
        ValueError: the width is negative, or shapes differ.

    References:
        [Reiner2010] (2.12), corrected; limits of the damper as in ElastoBacklash of the
        Modelica Standard Library.
    """

    contact: AbstractStiffness
    width: Float[Array, " *joints"] = eqx.field(converter=as_real)
    centre: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`width` must not be negative", self.width, self.width >= 0)

    def torque(
        self,
        torsion: Float[Array, "..."],
        rate: Float[Array, "..."],
        damping: Float[Array, "..."],
    ) -> Float[Array, "..."]:
        """Torque [N m] of spring and limited damper.

        Args:
            torsion: output minus motor angle [rad].
            rate: its rate [rad/s].
            damping: $d$ in contact [N m s/rad].
        """
        side = jnp.sign(self._depth(torsion))
        spring = side * self.contact.torque(self._depth(torsion))
        damper = side * damping * rate
        pushing = jnp.maximum(spring + jnp.minimum(spring, damper), 0.0)
        return side * pushing

    def resting_torque(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        r"""Torque [N m] at rest, strictly increasing, to find a state of rest by.

        Up to $|\delta| = \tfrac34 b$ a straight line of a third of the contact's
        stiffness stands in for the gap, as in the source of this law: a robot starts in
        contact where its load is large enough, and else somewhere in the gap.
        """
        delta, end = torsion - self.centre, 0.25 * self.width
        reach = jnp.where(self.width > 0, 0.75 * self.width, jnp.ones_like(end))
        line = self.contact.torque(end) / reach
        inside = jnp.abs(delta) < 0.75 * self.width
        contact = self.contact.torque(self._depth(torsion))
        return jnp.where(inside, line * delta, contact)

    def potential(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Energy [J] in the teeth in contact."""
        return self.contact.potential(self._depth(torsion))

    def stiffness(self, torsion: Float[Array, "..."]) -> Float[Array, "..."]:
        """Tangent stiffness [N m/rad]: that of the contact, or zero in the gap."""
        depth = self._depth(torsion)
        return jnp.where(depth == 0, 0.0, self.contact.stiffness(depth))

    def scaled(self, factor: Float[Array, "..."] | float) -> "Backlash":
        """The same gap with the torque of the contact multiplied by `factor` > 0."""
        return dataclasses.replace(self, contact=self.contact.scaled(factor))

    def torsion(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        """Torsion [rad] at rest in contact under a torque other than zero."""
        half = 0.5 * self.width * jnp.sign(torque)
        return self.centre + half + self.contact.torsion(torque)

    def _depth(self, torsion):
        """Depth of the contact with its sign, zero in the gap."""
        delta, half = torsion - self.centre, 0.5 * self.width
        return jnp.maximum(delta - half, 0.0) + jnp.minimum(delta + half, 0.0)
