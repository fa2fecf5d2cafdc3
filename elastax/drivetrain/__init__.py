"""Drive trains: friction, gear stiffness, counterbalance and their assembly."""

from ..structure import (
    AbstractStiffness as AbstractStiffness,
    CubicStiffness as CubicStiffness,
    LimitedStiffness as LimitedStiffness,
    LinearStiffness as LinearStiffness,
)
from ._branch import (
    AbstractGearBranch as AbstractGearBranch,
    AbstractSwitchingBranch as AbstractSwitchingBranch,
    RelaxationBranch as RelaxationBranch,
)
from ._counterbalance import (
    AbstractCounterbalance as AbstractCounterbalance,
    GasCounterbalance as GasCounterbalance,
    SpringCounterbalance as SpringCounterbalance,
)
from ._drivetrain import DriveTrain as DriveTrain, GearMemory as GearMemory
from ._friction import (
    AbstractFriction as AbstractFriction,
    CoulombViscousFriction as CoulombViscousFriction,
    TwoScaleFriction as TwoScaleFriction,
)
from ._hysteresis import (
    AbstractSmoothPlay as AbstractSmoothPlay,
    DelayedPlay as DelayedPlay,
    PadeDelay as PadeDelay,
    PrandtlIshlinskii as PrandtlIshlinskii,
    RateIndependentPlay as RateIndependentPlay,
    play as play,
)
from ._hysteretic_branch import (
    ExactHysteresisBranch as ExactHysteresisBranch,
    ExactStopBranch as ExactStopBranch,
    HysteresisBranch as HysteresisBranch,
    StopBranch as StopBranch,
)
from ._mesh import AbstractMesh as AbstractMesh
from ._motor import Motor as Motor
from ._transmission_error import TransmissionError as TransmissionError
