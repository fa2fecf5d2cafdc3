"""What smooth plays share: outputs and rates from states."""

import abc
from collections.abc import Callable

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

    @abc.abstractmethod
    def path(self) -> Callable | None:
        """How the states follow the input alone, or `None` where they take time.

        The function takes the input and the states at the start of a monotone piece of
        the input and the input at its end, and returns the states there.
        """
