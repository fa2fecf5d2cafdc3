"""Different spring laws on the coordinates of one robot."""

import dataclasses

import equinox as eqx
from jaxtyping import Array, Float

from .._axes import Axes, along_axes, check_axes, on_axes
from ._stiffness import AbstractStiffness


class AxisStiffness(AbstractStiffness):
    """Spring laws that each hold for some of the axes.

    Every law acts on the torsions of its own axes alone; its parameters are scalars or
    hold one value for each of these, in the order of `axes`.

    Attributes:
        laws: one or more.
        axes: for each law its axes, from 0; every axis once.

    Raises:
        ValueError: an axis has no law or more than one, or there are more or fewer
            groups of axes than laws.

    Examples:
        >>> main = LimitedStiffness(2e5, 4e4, 5e5, 2e-4)
        >>> stiffness = AxisStiffness((main, LinearStiffness(3e4)), ((0, 1, 2), (3,)))
    """

    laws: tuple[AbstractStiffness, ...]
    axes: Axes = eqx.field(static=True)

    def __check_init__(self):
        check_axes(self.laws, self.axes)

    def torque(
        self, torsion: Float[Array, "*batch axes"]
    ) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.torque for law in self.laws], torsion)

    def torsion(
        self, torque: Float[Array, "*batch axes"]
    ) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.torsion for law in self.laws], torque)

    def stiffness(
        self, torsion: Float[Array, "*batch axes"]
    ) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.stiffness for law in self.laws], torsion)

    def secant(
        self, torsion: Float[Array, "*batch axes"]
    ) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.secant for law in self.laws], torsion)

    def potential(
        self, torsion: Float[Array, "*batch axes"]
    ) -> Float[Array, "*batch axes"]:
        return along_axes(self.axes, [law.potential for law in self.laws], torsion)

    def scaled(self, factor: Float[Array, "..."] | float) -> "AxisStiffness":
        laws = [
            law.scaled(on_axes(factor, group))
            for law, group in zip(self.laws, self.axes, strict=True)
        ]
        return dataclasses.replace(self, laws=tuple(laws))
