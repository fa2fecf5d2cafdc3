"""What smooth plays share: outputs and rates from states."""

import abc

import equinox as eqx
from jaxtyping import Array, Float


class AbstractSmoothPlay(eqx.Module):
    """Several differentiable plays per joint, of different thresholds, in time.

    States are laid out as (states, joints), all those of the first play, then those of
    the second.
    """

    @property
    @abc.abstractmethod
    def states(self) -> int:
        """Number of states per joint."""

    @property
    @abc.abstractmethod
    def number(self) -> int:
        """Number of plays per joint."""

    @abc.abstractmethod
    def rest(self, x: Float[Array, " joints"]) -> Float[Array, "states joints"]:
        """States at rest at the input `x`, reached without turning from zero."""

    @abc.abstractmethod
    def outputs(
        self, x: Float[Array, " joints"], states: Float[Array, "states joints"]
    ) -> Float[Array, "plays joints"]:
        """Outputs of the plays, in the unit of the input."""

    @abc.abstractmethod
    def rates(
        self,
        x: Float[Array, " joints"],
        xd: Float[Array, " joints"],
        states: Float[Array, "states joints"],
    ) -> Float[Array, "states joints"]:
        """Time derivatives of the states, for an input `x` of the rate `xd`."""
