r"""A beam as four rigid segments with hinges between them.

Two double hinges, about y and z, at the abscissas of two-point Gauss quadrature and one
about x in the middle: five coordinates. Mass, centre of mass and inertia of the
undeformed beam stay what they are.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real
from ._beam import HINGE_POSITION


class SlenderBody(eqx.Module):
    r"""Mass of a slender body along x, whatever its distribution.

    Attributes:
        mass: $m$ [kg].
        length: $l$ [m].
        centre: $l_s$, distance of the centre of mass from the clamped end [m].
        inertia: principal moments $\Theta_{xx}, \Theta_{yy}, \Theta_{zz}$ about the
            centre of mass, shape (3,) [kg m^2].

    Raises:
        ValueError: a value is not positive.

    References:
        [Reiner2010] (2.24a).
    """

    mass: Scalar = eqx.field(converter=as_real)
    length: Scalar = eqx.field(converter=as_real)
    centre: Scalar = eqx.field(converter=as_real)
    inertia: Float[Array, "3"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("mass", "length", "centre", "inertia"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)


class BeamSegments(eqx.Module):
    r"""Masses, lengths and inertias of the four segments, from clamp to tip.

    $k = (1 - 1/\sqrt3)/2$, $l_1 = l_4 = k l$, $l_2 = l_3 = (1/2 - k) l$,
    $m_1 = k m + \Delta_m$, $m_4 = k m - \Delta_m$, $m_2 = m_3 = (1/2 - k) m$,
    $\Delta_m = \frac m2 \frac{2 l_s - l}{l (k - 1)}$; moments about y and z of a thin
    ring of the radius $r_{er}$ and the length of the segment. Centres of mass lie in
    the middle of the segments.

    Attributes:
        lengths: shape (4,) [m].
        masses: shape (4,) [kg].
        inertias: principal moments about the centres, shape (4, 3) [kg m^2].
        radii: $r_{er}$ for the moments about y and z, shape (2,) [m].

    References:
        [Reiner2010] (2.23), (2.24) corrected: the sign of the Steiner part in (2.24c)
        and the mass of both terms in (2.24e).
    """

    lengths: Float[Array, "4"] = eqx.field(converter=as_real)
    masses: Float[Array, "4"] = eqx.field(converter=as_real)
    inertias: Float[Array, "4 3"] = eqx.field(converter=as_real)
    radii: Float[Array, "2"] = eqx.field(converter=as_real)

    @classmethod
    def of(cls, body: SlenderBody, *, per_axis: bool = False) -> "BeamSegments":
        r"""Segments of a slender body.

        Args:
            body: the body.
            per_axis: whether the moments about y and about z are kept each, $r_y^2 =
                2(\Theta_{yy} + \Theta_{st})/m - l^2/6$, ours, or their mean, as in the
                text.

        Raises:
            ValueError: the centre of mass is further from the middle than l/6, which
                makes a mass negative, or the moments are smaller than those of a rod.
        """
        m, l = body.mass, body.length
        k = HINGE_POSITION
        share = jnp.array([k, 0.5 - k, 0.5 - k, k])
        lengths = share * l
        shift = 0.5 * m * (2.0 * body.centre - l) / (l * (k - 1.0))
        masses = share * m + shift * jnp.array([1.0, 0.0, 0.0, -1.0])
        check_values(
            "`centre` must lie within l/6 of the middle of the beam: the masses of the "
            "segments must be positive",
            masses,
            masses > 0,
        )
        steiner = (0.5 * l - body.centre) ** 2 * m
        moments = body.inertia[1:]
        if not per_axis:
            moments = jnp.mean(moments) * jnp.ones_like(moments)
        squares = 2.0 * (moments + steiner) / m - l**2 / 6.0
        check_values(
            "`inertia` about y and z must not be below that of a thin rod of this mass "
            "and length: the squared radii of the segments must not be negative",
            squares,
            squares >= 0,
        )
        # about y and z; a ring of radius r and length a has m (a^2 + 6 r^2)/12
        across = lengths[:, None] ** 2 + 6.0 * squares[None]
        bending = share[:, None] * m * across / 12.0
        torsion = share * body.inertia[0]
        inertias = jnp.concatenate([torsion[:, None], bending], axis=1)
        safe = jnp.where(squares > 0, squares, 1.0)
        radii = jnp.where(squares > 0, jnp.sqrt(safe), 0.0)
        return cls(lengths, masses, inertias, radii)

    def centres(self) -> Float[Array, "4"]:
        """Distances of the segments' centres from the clamp [m]."""
        return jnp.cumsum(self.lengths) - 0.5 * self.lengths

    def whole(self) -> SlenderBody:
        """The undeformed beam that the segments make up."""
        mass, places = jnp.sum(self.masses), self.centres()
        centre = jnp.sum(self.masses * places) / mass
        steiner = jnp.sum(self.masses * (places - centre) ** 2)
        inertia = jnp.sum(self.inertias, axis=0)
        inertia = inertia + steiner * jnp.array([0.0, 1.0, 1.0])
        return SlenderBody(mass, jnp.sum(self.lengths), centre, inertia)
