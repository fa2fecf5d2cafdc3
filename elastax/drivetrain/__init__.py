"""Drive trains: friction, gear stiffness, counterbalance and their assembly."""

from ..structure import (
    AbstractStiffness as AbstractStiffness,
    AxisStiffness as AxisStiffness,
    BacklashStiffness as BacklashStiffness,
    CubicStiffness as CubicStiffness,
    ExponentialStiffness as ExponentialStiffness,
    LimitedStiffness as LimitedStiffness,
    LinearStiffness as LinearStiffness,
    TabulatedStiffness as TabulatedStiffness,
)
from ._backlash import Backlash as Backlash
from ._branch import (
    AbstractGearBranch as AbstractGearBranch,
    AbstractSwitchingBranch as AbstractSwitchingBranch,
    RelaxationBranch as RelaxationBranch,
)
from ._clutch import FrictionContact as FrictionContact
from ._counterbalance import (
    AbstractCounterbalance as AbstractCounterbalance,
    GasCounterbalance as GasCounterbalance,
    SpringCounterbalance as SpringCounterbalance,
)
from ._cylinder_body import CylinderBody as CylinderBody
from ._drivetrain import DriveTrain as DriveTrain, GearMemory as GearMemory
from ._efficiency import (
    AbstractEfficiency as AbstractEfficiency,
    ConstantEfficiency as ConstantEfficiency,
    FallingEfficiency as FallingEfficiency,
)
from ._friction import (
    AbstractFriction as AbstractFriction,
    AsymmetricFriction as AsymmetricFriction,
    AxisFriction as AxisFriction,
    BreakawayFriction as BreakawayFriction,
    CoulombViscousFriction as CoulombViscousFriction,
    PiecewiseFriction as PiecewiseFriction,
    StribeckFriction as StribeckFriction,
    TemperatureFriction as TemperatureFriction,
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
from ._mesh import (
    AbstractMesh as AbstractMesh,
    DirectionalEfficiency as DirectionalEfficiency,
    LoadFriction as LoadFriction,
)
from ._motor import Motor as Motor
from ._switching_friction import (
    AbstractSwitchingFriction as AbstractSwitchingFriction,
    StickSlipFriction as StickSlipFriction,
)
from ._switching_mesh import (
    AbstractSwitchingMesh as AbstractSwitchingMesh,
    ExactEfficiency as ExactEfficiency,
)
from ._transmission_error import TransmissionError as TransmissionError
