"""Drive trains: friction, gear stiffness, counterbalance and their assembly."""

from ..structure import (
    AbstractStiffness as AbstractStiffness,
    CubicStiffness as CubicStiffness,
    LimitedStiffness as LimitedStiffness,
    LinearStiffness as LinearStiffness,
)
from ._counterbalance import (
    AbstractCounterbalance as AbstractCounterbalance,
    GasCounterbalance as GasCounterbalance,
    SpringCounterbalance as SpringCounterbalance,
)
from ._drivetrain import DriveTrain as DriveTrain
from ._friction import (
    AbstractFriction as AbstractFriction,
    CoulombViscousFriction as CoulombViscousFriction,
    TwoScaleFriction as TwoScaleFriction,
)
