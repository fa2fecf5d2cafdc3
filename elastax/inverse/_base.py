"""What all inverse models share: one protocol, offline and sample by sample."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Scalar, require_float64
from ..dynamics import ElasticRobot, MotorCommand, MotorSample
from ..signals import Reference


Derivatives = Float[Array, "terms axes"]


class AbstractInverse(eqx.Module):
    """Feed-forward: from a reference of the joints to motor angles and torques."""

    @abc.abstractmethod
    def order(self, model: ElasticRobot) -> int:
        """Highest derivative of the reference that the inverse of `model` uses."""

    @abc.abstractmethod
    def init(self, model: ElasticRobot, sample: Derivatives, dt: Scalar | float) -> Any:
        """State at rest in the first sample.

        Args:
            model: the robot as the inverse knows it.
            sample: reference and derivatives at the first sample, shape
                (order + 1, axes).
            dt: time between samples [s].
        """

    @abc.abstractmethod
    def step(
        self, model: ElasticRobot, state: Any, sample: Derivatives
    ) -> tuple[MotorSample, Any]:
        """Motor angles and torques for the next sample, at a fixed cost.

        The first call takes the first sample again.
        """

    @abc.abstractmethod
    def feedforward(self, model: ElasticRobot, reference: Reference) -> MotorCommand:
        """Motor angles and torques over a whole reference.

        Args:
            model: the robot as the inverse knows it; parts that the inverse neglects
                are left out.
            reference: filtered joint angles with derivatives up to `order()`.

        Raises:
            ValueError: the reference brings too few derivatives, or JAX runs in single
                precision.
        """


def check_model(inverse: AbstractInverse, model: ElasticRobot) -> None:
    """Refuse a model with exact parts that have no inverse."""
    if not model.drives.invertible:
        raise ValueError(
            f"{type(inverse).__name__} needs drive trains whose parts have an inverse: "
            "leave exact parts that switch to the plant and give the model their "
            "smooth counterparts"
        )


def check_reference(inverse: AbstractInverse, model: ElasticRobot, reference) -> None:
    """Refuse a reference that does not fit the inverse or the model."""
    require_float64(type(inverse).__name__)
    check_model(inverse, model)
    reference.require_order(inverse.order(model))
    axes = reference.derivatives.shape[2]
    if axes != model.axes:
        raise ValueError(
            f"the reference must have one column per axis: `{model.name}` has "
            f"{model.axes} axes, but the reference {axes}"
        )


def samples_of(inverse: AbstractInverse, model: ElasticRobot, reference: Reference):
    """Samples of the reference along the leading axis, (times, order + 1, axes)."""
    return jnp.swapaxes(reference.derivatives[: inverse.order(model) + 1], 0, 1)


def feedforward_by_steps(
    inverse: AbstractInverse, model: ElasticRobot, reference: Reference
) -> MotorCommand:
    """`feedforward` by calling `step` sample by sample, as a controller would."""
    samples = samples_of(inverse, model, reference)
    state = inverse.init(model, samples[0], reference.dt)

    def advance(state, sample):
        output, state = inverse.step(model, state, sample)
        return state, output

    _, outputs = jax.lax.scan(advance, state, samples)
    return MotorCommand.from_samples(reference.times, outputs)
