"""The damping factor along a motion, with the derivatives that the correction needs."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Scalar
from .._taylor import Series, compose, from_derivatives
from ..kinematics import AbstractDamping
from ..signals import AbstractFilter, CriticallyDampedFilter


class AbstractDampingSignal(eqx.Module):
    """Damping factor over time from the smallest singular value over time."""

    @abc.abstractmethod
    def init(self, smallest: Scalar, dt: Scalar | float) -> Any:
        """State at rest at the first singular value."""

    @abc.abstractmethod
    def step(
        self, state: Any, smallest: Scalar, started: Float[Array, ""], order: int
    ) -> tuple[Series, Any]:
        """Damping factor with derivatives up to `order`, and the next state.

        Args:
            state: memory.
            smallest: singular value at this sample.
            started: 1, but 0 at the first sample, whose state is the initial one.
            order: highest derivative.
        """

    @abc.abstractmethod
    def along(
        self, smallest: Float[Array, " times"], dt: Scalar | float, order: int
    ) -> Float[Array, "times terms"]:
        """`step` over a whole motion: series coefficients at every sample."""


class FilteredDamping(AbstractDampingSignal):
    r"""$\lambda(\sigma^*)$ of the filtered singular value, differentiable in time.

    $\sigma^* = f_{krit}(\sigma_{min})$; its derivatives come from the filter's states.

    Attributes:
        law: damping over the singular value.
        filter: of an order not below the derivatives that are asked for.

    References:
        [Reiner2010] (3.68a), (3.32), (3.33).
    """

    law: AbstractDamping
    filter: AbstractFilter = CriticallyDampedFilter(4, 10.0)

    def init(self, smallest: Scalar, dt: Scalar | float) -> Any:
        start = smallest[None]
        return self.filter.init(start), start, self.filter.discretise(dt)

    def step(
        self, state: Any, smallest: Scalar, started: Float[Array, ""], order: int
    ) -> tuple[Series, Any]:
        memory, previous, hold = state
        now = smallest[None]
        memory = jnp.where(started > 0, hold(memory, previous, now), memory)
        smooth = self.filter.derivatives(memory, now, order)[:, 0]
        return compose(self.law, from_derivatives(smooth)), (memory, now, hold)

    def along(
        self, smallest: Float[Array, " times"], dt: Scalar | float, order: int
    ) -> Float[Array, "times terms"]:
        smooth = self.filter.apply(smallest[:, None], dt, order)[..., 0].T
        return jax.vmap(lambda d: compose(self.law, from_derivatives(d)).coefficients)(
            smooth
        )


class FrozenDamping(AbstractDampingSignal):
    """The damping at the present singular value, its derivatives taken as zero.

    Attributes:
        law: damping over the singular value.

    References:
        [Reiner2010] (3.69).
    """

    law: AbstractDamping

    def init(self, smallest: Scalar, dt: Scalar | float) -> Any:
        return None

    def step(
        self, state: Any, smallest: Scalar, started: Float[Array, ""], order: int
    ) -> tuple[Series, Any]:
        value = self.law(smallest)
        return Series(jnp.zeros((order + 1,), value.dtype).at[0].set(value)), None

    def along(
        self, smallest: Float[Array, " times"], dt: Scalar | float, order: int
    ) -> Float[Array, "times terms"]:
        value = self.law(smallest)[:, None]
        rest = jnp.zeros((value.shape[0], order), value.dtype)
        return jnp.concatenate([value, rest], axis=1)
