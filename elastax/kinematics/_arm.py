"""An arm: a chain with the limits of its axes and the angles of its maker."""

import equinox as eqx

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_real
from ._chain import SerialChain


class Arm(eqx.Module):
    """Kinematics of an industrial arm.

    Attributes:
        chain: one joint per axis, without elastic joints.
        lower, upper: limits of the chain's own coordinates [rad] or [m], shape
            (joints,).
        velocity: limits [rad/s] or [m/s].
        signs: +1 or -1: q = sign * maker's coordinate + zero.
        zeros: coordinates of the chain at the maker's zero [rad] or [m].
        poses: named poses in the maker's coordinates.
        name, axis_names: for tables and messages.
        sources: where the numbers come from.
        assumptions: what was assumed, where no source gives a number.
    """

    chain: SerialChain
    lower: PerJoint = eqx.field(converter=as_real)
    upper: PerJoint = eqx.field(converter=as_real)
    velocity: PerJoint = eqx.field(converter=as_real)
    signs: PerJoint = eqx.field(converter=as_real)
    zeros: PerJoint = eqx.field(converter=as_real)
    poses: dict[str, PerJoint]
    name: str = eqx.field(static=True)
    axis_names: tuple[str, ...] = eqx.field(static=True)
    sources: tuple[str, ...] = eqx.field(static=True, default=())
    assumptions: tuple[str, ...] = eqx.field(static=True, default=())

    def __check_init__(self):
        check_fields(self)
        if self.lower.shape != (self.chain.number,):
            raise ValueError(
                f"`lower` must hold one limit per joint of {self.chain.number}, but "
                f"has the shape {self.lower.shape}"
            )
        check_values(
            "`upper` limits must lie above `lower`", self.upper, self.upper > self.lower
        )
        check_values("`velocity` must be positive", self.velocity, self.velocity > 0)
        check_values("`signs` must be +1 or -1", self.signs, self.signs**2 == 1)

    def from_maker(self, coordinates: PerJoint) -> PerJoint:
        """Coordinates of the chain from those on the controller."""
        return self.signs * coordinates + self.zeros

    def to_maker(self, q: PerJoint) -> PerJoint:
        """Coordinates as the controller shows them."""
        return self.signs * (q - self.zeros)
