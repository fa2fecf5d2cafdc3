"""What all friction laws have in common, and their inverse."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._checks import check_values
from ..._custom_types import as_real


_LARGEST_SPEED = {"float64": 1e100, "float32": 1e15}
_INTEGERS = {"float64": "int64", "float32": "int32"}


class AbstractFriction(eqx.Module):
    """Smooth map from speed to the friction torque that opposes it."""

    @abc.abstractmethod
    def torque(self, speed: Float[Array, "..."]) -> Float[Array, "..."]:
        """Friction torque [N m] at `speed` [rad/s], both on the same gear side."""

    @abc.abstractmethod
    def is_monotone(self) -> Bool[Array, "..."]:
        """Whether the torque is known to increase with the speed everywhere."""

    @abc.abstractmethod
    def scaled(self, factor: Float[Array, "..."] | float) -> "AbstractFriction":
        """The same law with its torque multiplied by `factor` > 0."""

    @abc.abstractmethod
    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "AbstractFriction":
        r"""The law on the output side of a gear, of one given on the motor side.

        The power that it takes stays the same: $\tau(v) = i\,\tau_{motor}(i\,v)$.

        Args:
            ratio: gear ratio $i$, motor / output; its sign is kept.
        """

    def speed(self, torque: Float[Array, "..."]) -> Float[Array, "..."]:
        """Speed [rad/s] at which the friction is `torque` [N m]: the inverse.

        Halves an interval of floating-point numbers until two neighbours are left, so
        that no start, scale or steepness matters; derivatives are implicit. Beyond the
        range of a bounded law the answer is an enormous speed, and its derivative zero.

        Raises:
            ValueError: the law is not known to be monotone (`is_monotone`).
        """
        check_values(
            "a friction law must be monotone to have an inverse, `is_monotone()`",
            self.is_monotone(),
            self.is_monotone(),
        )
        return _speed(self, torque)


@jax.custom_jvp
def _speed(law, torque):
    rest = law.torque(jnp.zeros_like(torque))
    sign = jnp.where(torque < rest, -1.0, 1.0).astype(rest.dtype)
    below = jnp.zeros_like(rest)
    above = jnp.full_like(rest, _LARGEST_SPEED[str(rest.dtype)])
    integer = _INTEGERS[str(rest.dtype)]

    # Positive floats are ordered as the integers of the same bits.
    to_bits = lambda x: jax.lax.bitcast_convert_type(x, integer)
    to_size = lambda bits: jax.lax.bitcast_convert_type(bits, rest.dtype)

    def halve(_, interval):
        below, above = interval
        middle = below + (above - below) // 2
        short = sign * (law.torque(sign * to_size(middle)) - torque) < 0
        return jnp.where(short, middle, below), jnp.where(short, above, middle)

    bits = jnp.finfo(rest.dtype).bits
    below, above = jax.lax.fori_loop(0, bits, halve, (to_bits(below), to_bits(above)))
    below, above = to_size(below), to_size(above)
    error = lambda size: jnp.abs(law.torque(sign * size) - torque)
    return sign * jnp.where(error(below) < error(above), below, above)


@_speed.defjvp
def _speed_jvp(primals, tangents):
    law, torque = primals
    law_change, torque_change = tangents
    speed = _speed(law, torque)
    _, held = jax.jvp(lambda f: f.torque(speed), (law,), (law_change,))
    _, slope = jax.jvp(law.torque, (speed,), (jnp.ones_like(speed),))
    flat = slope <= 0
    safe = jnp.where(flat, jnp.ones_like(slope), slope)
    return speed, jnp.where(flat, 0.0, (torque_change - held) / safe)


def ratio_size(ratio):
    """Magnitude of the gear ratio: for an odd law its sign makes no difference."""
    size = jnp.abs(as_real(ratio))
    check_values("`ratio` must not be zero", size, size != 0)
    return size
