"""Different friction laws on the axes of one robot."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._axes import Axes, along_axes, check_axes, on_axes
from ._base import AbstractFriction


class AxisFriction(AbstractFriction):
    """Friction laws that each hold for some of the axes.

    Every law acts on the speeds of its own axes alone; its parameters are scalars or
    hold one value for each of these, in the order of `axes`.

    Attributes:
        laws: one or more.
        axes: for each law its axes, from 0; every axis once.

    Raises:
        ValueError: an axis has no law or more than one, or there are more or fewer
            groups of axes than laws.

    Examples:
        >>> main = CoulombViscousFriction(12.5, 38.0, 45.0)
        >>> wrist = StribeckFriction(1.3, 4.0, 90.0, 8.0, 0.1)
        >>> friction = AxisFriction((main, wrist), ((0, 1, 2), (3, 4, 5)))
    """

    laws: tuple[AbstractFriction, ...]
    axes: Axes = eqx.field(static=True)

    def __check_init__(self):
        check_axes(self.laws, self.axes)

    def torque(self, speed: Float[Array, "*batch axes"]) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.torque for law in self.laws], speed)

    def is_monotone(self) -> Bool[Array, " axes"]:
        ahead = [lambda one, law=law: one & law.is_monotone() for law in self.laws]
        number = sum(len(group) for group in self.axes)
        return along_axes(self.axes, ahead, jnp.ones((number,), bool))

    def scaled(self, factor: Float[Array, "..."] | float) -> "AxisFriction":
        laws = [
            law.scaled(on_axes(factor, group))
            for law, group in zip(self.laws, self.axes, strict=True)
        ]
        return dataclasses.replace(self, laws=tuple(laws))

    def to_output_side(self, ratio: Float[Array, "..."] | float) -> "AxisFriction":
        laws = [
            law.to_output_side(on_axes(ratio, group))
            for law, group in zip(self.laws, self.axes, strict=True)
        ]
        return dataclasses.replace(self, laws=tuple(laws))
