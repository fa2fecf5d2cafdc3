"""Elastic structure: spring laws, bearings and beams."""

from ._axes import AxisStiffness as AxisStiffness
from ._backlash_stiffness import BacklashStiffness as BacklashStiffness
from ._beam import (
    HINGE_POSITION as HINGE_POSITION,
    TIP_FORCE as TIP_FORCE,
    TIP_MOMENT as TIP_MOMENT,
    UNIFORM_LOAD as UNIFORM_LOAD,
    BeamSection as BeamSection,
    LoadCase as LoadCase,
    Material as Material,
    UniformBeam as UniformBeam,
)
from ._exponential_stiffness import ExponentialStiffness as ExponentialStiffness
from ._stiffness import (
    AbstractStiffness as AbstractStiffness,
    CubicStiffness as CubicStiffness,
    LimitedStiffness as LimitedStiffness,
    LinearStiffness as LinearStiffness,
)
from ._tabulated_stiffness import TabulatedStiffness as TabulatedStiffness
