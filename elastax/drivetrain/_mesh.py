"""Losses in the teeth of a gear that depend on their load."""

import abc

import equinox as eqx
from jaxtyping import Array, Float


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
