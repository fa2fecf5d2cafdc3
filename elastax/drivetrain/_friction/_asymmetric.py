"""Friction that differs between the two directions of motion."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._checks import check_fields, check_values
from ..._custom_types import as_real
from ._base import AbstractFriction
from ._tanh import tanh


class AsymmetricFriction(AbstractFriction):
    r"""One law for each direction of motion, blended smoothly at rest.

    $$\tau_r(v) = w\,\tau_+(v) + (1 - w)\,\tau_-(v),\qquad
      w = \tfrac12\bigl(1 + \tanh(s v / 2)\bigr)$$

    Two odd laws give no torque at rest. The blend costs monotonicity where the levels
    differ much: two laws (2.3) with the steepness of the blend and without viscous part
    rise everywhere only if the larger level is below three times the smaller one.

    Attributes:
        forward: law $\tau_+$ at positive speed.
        backward: law $\tau_-$ at negative speed; odd laws are given as for positive
            speed, their torque has the sign of the speed.
        steepness: $s \ne 0$ of the blend [s/rad]. A negative one swaps the directions,
            as a gear with a negative ratio does.

    Raises:
        ValueError: `steepness` is zero.

    References:
        The text has odd laws only; this blend is a choice.
    """

    forward: AbstractFriction
    backward: AbstractFriction
    steepness: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`steepness` must not be zero", self.steepness, self.steepness != 0
        )

    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        ahead, back = self.forward.torque(speed), self.backward.torque(speed)
        blend = tanh(0.5 * self.steepness * speed)
        return 0.5 * ((1.0 + blend) * ahead + (1.0 - blend) * back)

    def is_monotone(self) -> Bool[Array, "..."]:
        """Whether both laws are, and 401 slopes within the blend are positive."""
        sizes = np.geomspace(1e-6, 80.0, 200)
        grid = np.concatenate([-sizes[::-1], [0.0], sizes])
        one = jnp.ones_like(self.steepness)

        def slope(place):
            speed = place / jnp.abs(self.steepness)
            return jax.jvp(self.torque, (speed,), (one,))[1]

        slopes = jax.vmap(slope)(jnp.asarray(grid, one.dtype))
        parts = self.forward.is_monotone() & self.backward.is_monotone()
        return parts & jnp.all(slopes > 0, axis=0)

    def scaled(self, factor: Float[Array, "..."] | float) -> "AsymmetricFriction":
        return dataclasses.replace(
            self,
            forward=self.forward.scaled(factor),
            backward=self.backward.scaled(factor),
        )

    def to_output_side(
        self, ratio: Float[Array, "..."] | float
    ) -> "AsymmetricFriction":
        return dataclasses.replace(
            self,
            forward=self.forward.to_output_side(ratio),
            backward=self.backward.to_output_side(ratio),
            steepness=as_real(ratio) * self.steepness,
        )
