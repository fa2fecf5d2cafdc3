"""What the cylinder of a counterbalance weighs, and where it is mounted."""

import equinox as eqx

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


class CylinderBody(eqx.Module):
    r"""Mass of a cylinder, and its place beside the plane of motion.

    The mass is a point at a fixed share $\lambda$ of the way between the hinges. In a
    cylinder of housing and rod it would keep its distances from the hinges instead, so
    that $\lambda$ holds near one angle; the inertia of the cylinder's own rotation is
    left out.

    Attributes:
        mass: $m \ge 0$ [kg].
        mass_position: $0 \le \lambda \le 1$, zero at the hinge on the carrier, one at
            that on the rocker [-].
        lateral_offset: $e$, from the plane of motion to the cylinder, positive along
            the axis of rotation [m].

    Raises:
        ValueError: a parameter is outside its range.

    References:
        [Reiner2010] sec. 2.5 names the device without an equation; all of this is ours.
    """

    mass: Scalar = eqx.field(converter=as_real, default=0.0)
    mass_position: Scalar = eqx.field(converter=as_real, default=0.5)
    lateral_offset: Scalar = eqx.field(converter=as_real, default=0.0)

    def __check_init__(self):
        check_fields(self)
        check_values("`mass` must not be negative", self.mass, self.mass >= 0)
        check_values(
            "`mass_position` must be between 0 and 1",
            self.mass_position,
            (self.mass_position >= 0) & (self.mass_position <= 1),
        )
