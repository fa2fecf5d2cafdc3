"""Friction of clutches and brakes under a given normal force."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import Scalar, as_real


class FrictionContact(eqx.Module):
    r"""Dry contact of two shafts, or of a shaft and the ground, that a force closes.

    $\tau = c_{geo}\,\mu(|\omega_{rel}|)\,F_n$ while it slides, up to
    $p\,c_{geo}\,\mu(0)\,F_n$ while it sticks, nothing where $F_n \le 0$. A clutch joins
    two inertias, a brake an inertia and the ground.

    Attributes:
        speeds: of the table of $\mu$, increasing from zero [rad/s], shape (entries,).
        coefficients: $\mu \ge 0$ at these speeds [-], linear in between, and constant
            beyond the last.
        geometry: $c_{geo} > 0$, torque over $\mu F_n$ [m].
        peak: $p \ge 1$, of the torque that starts the sliding.

    Raises:
        ValueError: a parameter is outside its range, or the speeds do not increase.

    References:
        [Reiner2010] section 2.2, dry friction with switching, in words; normal force
        and table as in Clutch and Brake of the Modelica Standard Library.
    """

    speeds: Float[Array, " entries"] = eqx.field(converter=as_real)
    coefficients: Float[Array, " entries"] = eqx.field(converter=as_real)
    geometry: Scalar = eqx.field(converter=as_real, default=1.0)
    peak: Scalar = eqx.field(converter=as_real, default=1.0)

    def __check_init__(self):
        check_fields(self)
        if is_concrete(self.speeds):
            speeds = np.asarray(self.speeds)
            increasing = np.all(np.diff(speeds) > 0) & (speeds[0] == 0)
            check_values("`speeds` must increase from zero", speeds, increasing)
        check_values(
            "`coefficients` must not be negative",
            self.coefficients,
            self.coefficients >= 0,
        )
        check_values(
            "`geometry` must be positive [m]", self.geometry, self.geometry > 0
        )
        check_values("`peak` must be at least 1", self.peak, self.peak >= 1)

    def torque(self, slip: Scalar, direction: Scalar, normal_force: Scalar) -> Scalar:
        """Torque [N m] that opposes the sliding.

        Args:
            slip: relative speed [rad/s].
            direction: +1 or -1, its sign, also where it is still zero.
            normal_force: $F_n$ [N].
        """
        mu = jnp.interp(jnp.abs(slip), self.speeds, self.coefficients)
        return direction * self.geometry * mu * jnp.maximum(normal_force, 0.0)

    def breakaway(self, direction: Scalar, normal_force: Scalar) -> Scalar:
        """Torque [N m] that a sticking contact withstands in a direction, signed."""
        return self.peak * self.torque(
            jnp.zeros_like(direction), direction, normal_force
        )
