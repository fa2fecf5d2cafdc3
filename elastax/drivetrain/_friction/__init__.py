"""Friction of motors, gears and bearings as a function of speed.

The laws are smooth, so that an inverse model can differentiate them, and act
elementwise; their parameters are scalars or hold one value per joint. Friction opposes
the motion: it is subtracted from the motor torque. The smoothed Coulomb part is a
level, not stiction, and vanishes at rest.
"""

from ._asymmetric import AsymmetricFriction as AsymmetricFriction
from ._axes import AxisFriction as AxisFriction
from ._base import AbstractFriction as AbstractFriction
from ._coulomb import (
    CoulombViscousFriction as CoulombViscousFriction,
    TwoScaleFriction as TwoScaleFriction,
)
from ._piecewise import PiecewiseFriction as PiecewiseFriction
from ._stribeck import (
    BreakawayFriction as BreakawayFriction,
    StribeckFriction as StribeckFriction,
)
from ._temperature import TemperatureFriction as TemperatureFriction
