r"""Uniform beams and the hinges that replace them.

A slender member of the arm is replaced by rigid segments and hinges with springs. The
local x axis runs along the beam from its clamped end; y and z are the principal axes of
the cross section; rotation about y bends in the x-z plane and is resisted by `EI_y`.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


class LoadCase(NamedTuple):
    r"""Static load for which a hinge at the clamp reproduces the tip exactly.

    A moment at the tip turns the dependent hinge as well: by virtual work it counts
    $1 + \gamma_\varphi$ times at the hinge.

    Attributes:
        stiffness_factor: hinge stiffness over $EI/l$, from the tip deflection.
        slope_factor: $\gamma_\varphi$, the angle of the dependent hinge at the tip over
            that of the hinge at the clamp, from the tip slope.
    """

    stiffness_factor: float
    slope_factor: float


TIP_FORCE = LoadCase(3.0, 1.0 / 2.0)
TIP_MOMENT = LoadCase(4.0, 1.0)
UNIFORM_LOAD = LoadCase(4.0, 1.0 / 3.0)

# [Reiner2010] (2.23a): position of the outer hinges over the length. It is the abscissa
# of two-point Gauss quadrature, hence the exact tip compliances.
HINGE_POSITION = 0.5 * (1.0 - 1.0 / math.sqrt(3.0))


class Material(eqx.Module):
    """Isotropic linear elastic material.

    Attributes:
        young: Young's modulus [Pa].
        shear: shear modulus [Pa].
        density: density [kg/m^3].

    Raises:
        ValueError: a value is not positive.
    """

    young: Scalar = eqx.field(converter=as_real)
    shear: Scalar = eqx.field(converter=as_real)
    density: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`young` must be positive", self.young, self.young > 0)
        check_values("`shear` must be positive", self.shear, self.shear > 0)
        check_values("`density` must be positive", self.density, self.density > 0)


class BeamSection(eqx.Module):
    r"""Cross section of a beam, about its principal axes through the centroid.

    Attributes:
        area: cross-sectional area [m^2].
        second_moment_y: $I_y = \int z^2\,dA$ [m^4].
        second_moment_z: $I_z = \int y^2\,dA$ [m^4].
        torsion_constant: $I_t$ [m^4].

    Raises:
        ValueError: a value is not positive.
    """

    area: Scalar = eqx.field(converter=as_real)
    second_moment_y: Scalar = eqx.field(converter=as_real)
    second_moment_z: Scalar = eqx.field(converter=as_real)
    torsion_constant: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in (
            "area",
            "second_moment_y",
            "second_moment_z",
            "torsion_constant",
        ):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)

    @classmethod
    def rectangular_tube(cls, height, width, wall) -> "BeamSection":
        r"""Rectangular tube, `height` along z and `width` along y.

        The torsion constant is Bredt's second formula for thin closed walls,
        $I_t = 4 A_m^2 t / U_m$ with the area $A_m$ and the length $U_m$ of the
        mid-line. It is an approximation: the flexibility of the wall itself and the
        corners are left out. Area and second moments are exact for sharp corners.

        Args:
            height: outer height [m].
            width: outer width [m].
            wall: wall thickness [m], below half of the smaller side.

        Raises:
            ValueError: `wall` is not positive or too large.

        References:
            [Bredt1896]; [Timoshenko1970] sec. 116.
        """
        check_values(
            "`wall` must be positive and below half of `height` and `width`",
            wall,
            (wall > 0) & (2 * wall < height) & (2 * wall < width),
        )
        inner_height, inner_width = height - 2 * wall, width - 2 * wall
        mid_height, mid_width = height - wall, width - wall
        return cls(
            area=height * width - inner_height * inner_width,
            second_moment_y=(width * height**3 - inner_width * inner_height**3) / 12.0,
            second_moment_z=(height * width**3 - inner_height * inner_width**3) / 12.0,
            torsion_constant=2.0
            * wall
            * (mid_height * mid_width) ** 2
            / (mid_height + mid_width),
        )

    @classmethod
    def circular_tube(cls, diameter, wall) -> "BeamSection":
        r"""Circular tube; `wall = diameter / 2` gives a solid shaft.

        The torsion constant is the polar second moment, which is exact.

        Args:
            diameter: outer diameter [m].
            wall: wall thickness [m], at most the radius.

        Raises:
            ValueError: `wall` is not positive or above the radius.
        """
        check_values(
            "`wall` must be positive and at most half of `diameter`",
            wall,
            (wall > 0) & (2 * wall <= diameter),
        )
        inner = diameter - 2 * wall
        second_moment = math.pi * (diameter**4 - inner**4) / 64.0
        return cls(
            area=math.pi * (diameter**2 - inner**2) / 4.0,
            second_moment_y=second_moment,
            second_moment_z=second_moment,
            torsion_constant=2.0 * second_moment,
        )


class UniformBeam(eqx.Module):
    """Straight beam of constant cross section, clamped at x = 0.

    Euler-Bernoulli: shear deformation is left out, as in the texts.

    Attributes:
        material: moduli and density.
        section: cross section.
        length: length [m].

    Raises:
        ValueError: `length` is not positive.
    """

    material: Material
    section: BeamSection
    length: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`length` must be positive", self.length, self.length > 0)

    def mass(self) -> Scalar:
        """Mass [kg]."""
        return self.material.density * self.section.area * self.length

    def rigidity(self) -> Float[Array, "3"]:
        r"""Torsional and flexural rigidities $(GI_t, EI_y, EI_z)$ [N m^2]."""
        return jnp.stack(
            [
                self.material.shear * self.section.torsion_constant,
                self.material.young * self.section.second_moment_y,
                self.material.young * self.section.second_moment_z,
            ]
        )

    def tip_compliance(self) -> Float[Array, "2 2 2"]:
        r"""Exact static compliance of the tip, for bending about y and about z.

        Entry i is $\begin{pmatrix} l^3/3EI & l^2/2EI \\ l^2/2EI & l/EI \end{pmatrix}$:
        deflection [m] and slope [rad] per tip force [N] and tip moment [N m].
        """
        l = self.length
        shape = jnp.stack([l**3 / 3.0, l**2 / 2.0, l**2 / 2.0, l]).reshape(2, 2)
        return shape[None] / self.rigidity()[1:, None, None]

    def clamp_stiffness(self, load: LoadCase = TIP_FORCE) -> Float[Array, "3"]:
        r"""Spring stiffness of three hinges (x, y, z) at the clamp [N m/rad].

        The replacement with three degrees of freedom: one rigid body on hinges at the
        clamp with $GI_t/l$ and, for a tip force, $3EI/l$. The slope at the tip is met
        by dependent hinges there, $\alpha_i = \gamma_\varphi\varphi_i$ with
        `load.slope_factor`; [Reiner2010] calls this slope a curvature.

        References:
            [Reiner2010] sec. 2.4.3, figures 2.11 and 2.12; the numbers are the statics
            of the cantilever.
        """
        factor = load.stiffness_factor
        return self.rigidity() * np.array([1.0, factor, factor]) / self.length

    def hinge_stiffness(self) -> Float[Array, "3"]:
        r"""Springs of the replacement with five degrees of freedom [N m/rad].

        Torsion $GI_t/l$ of the hinge in the middle, bending $2EI/l$ about y and z of
        each of the two hinges at `HINGE_POSITION` times the length from either end.
        They reproduce `tip_compliance` exactly, because the hinges sit on the abscissas
        of two-point Gauss quadrature. The text leaves the values open.

        References:
            [Reiner2010] (2.23a), figure 2.10.
        """
        return self.rigidity() * np.array([1.0, 2.0, 2.0]) / self.length
