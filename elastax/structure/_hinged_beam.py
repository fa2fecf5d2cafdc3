r"""Springs of the hinges that stand for a bending beam, and their statics.

`ClampHinges` has three coordinates: hinges at the clamp and dependent ones at the tip,
$\alpha_i = \gamma\varphi_i$. `GaussHinges` has five: two double hinges and one for the
torsion. Either can be had from the other, because both know the rigidities that they
stand for.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real
from ._beam import HINGE_POSITION, TIP_FORCE, LoadCase, UniformBeam


class ClampHinges(eqx.Module):
    r"""Three hinges at the clamp, about x, y and z.

    Under the load that `load` stands for, deflection and slope of the tip are exact.
    With `TIP_FORCE` the slope under a tip moment is 25 % low, $3/4$ of $M l/EI$. A
    load at the tip acts on the hinge through the slope factor as well,
    $c\,\varphi = l F + (1 + \gamma) M$, by virtual work: the moment turns the hinge and
    the dependent one.

    Attributes:
        stiffness: about x, y, z, shape (3,) [N m/rad].
        length: [m].
        load: static load for which the tip is exact.

    Raises:
        ValueError: a value is not positive.

    References:
        [Reiner2010] section 2.4.3, figures 2.11 and 2.12; the values are ours.
    """

    stiffness: Float[Array, "3"] = eqx.field(converter=as_real)
    length: Scalar = eqx.field(converter=as_real)
    load: LoadCase = eqx.field(static=True, default=TIP_FORCE)

    def __check_init__(self):
        _check(self)

    @classmethod
    def of(cls, beam: UniformBeam, load: LoadCase = TIP_FORCE) -> "ClampHinges":
        """Hinges of a uniform beam."""
        return cls(beam.clamp_stiffness(load), beam.length, load)

    def rigidity(self) -> Float[Array, "3"]:
        r"""Rigidities $(GI_t, EI_y, EI_z)$ for which the hinges stand [N m^2]."""
        factor = self.load.stiffness_factor
        return self.stiffness * self.length / np.array([1.0, factor, factor])

    def gauss_hinges(self) -> "GaussHinges":
        """Five hinges of the same rigidities."""
        return GaussHinges(
            self.rigidity() * np.array([1.0, 2.0, 2.0]) / self.length, self.length
        )

    def tip_compliance(self) -> Float[Array, "2 2 2"]:
        """Deflection and slope per tip force and moment, about y and about z.

        Laid out as `UniformBeam.tip_compliance`.
        """
        slope = (1.0 + self.load.slope_factor) * jnp.ones_like(self.length)
        lever = jnp.stack([self.length, slope])
        return jnp.outer(lever, lever)[None] / self.stiffness[1:, None, None]


class GaussHinges(eqx.Module):
    r"""Hinges about y and z at $k l$ and $(1 - k) l$, about x in the middle.

    With $2EI/l$ at each bending hinge and $GI_t/l$ all compliances of the tip are
    exact: the hinges stand at the abscissas of two-point Gauss quadrature.

    Attributes:
        stiffness: of the hinge about x and of each one about y and z, shape (3,)
            [N m/rad].
        length: [m].

    Raises:
        ValueError: a value is not positive.

    References:
        [Reiner2010] (2.23a), figure 2.10; the stiffnesses are ours.
    """

    stiffness: Float[Array, "3"] = eqx.field(converter=as_real)
    length: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        _check(self)

    @classmethod
    def of(cls, beam: UniformBeam) -> "GaussHinges":
        """Hinges of a uniform beam."""
        return cls(beam.hinge_stiffness(), beam.length)

    def rigidity(self) -> Float[Array, "3"]:
        r"""Rigidities $(GI_t, EI_y, EI_z)$ for which the hinges stand [N m^2]."""
        return self.stiffness * self.length / np.array([1.0, 2.0, 2.0])

    def clamp_hinges(self, load: LoadCase = TIP_FORCE) -> ClampHinges:
        """Three hinges of the same rigidities."""
        factor = load.stiffness_factor
        stiffness = self.rigidity() * np.array([1.0, factor, factor]) / self.length
        return ClampHinges(stiffness, self.length, load)

    def tip_compliance(self) -> Float[Array, "2 2 2"]:
        """Deflection and slope per tip force and moment, about y and about z."""
        arm = self.length * np.array([1.0 - HINGE_POSITION, HINGE_POSITION])
        lever = jnp.stack([arm, jnp.ones_like(arm)])
        return (lever @ lever.T)[None] / self.stiffness[1:, None, None]


def _check(hinges) -> None:
    check_fields(hinges)
    for name in ("stiffness", "length"):
        value = getattr(hinges, name)
        check_values(f"`{name}` must be positive", value, value > 0)
