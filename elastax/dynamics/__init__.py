"""Elastic robots: assembly, energies, equations of motion, simulation."""

from ._beam_parts import (
    clamped_beam_parts as clamped_beam_parts,
    segmented_beam_parts as segmented_beam_parts,
)
from ._block_form import (
    EquationsOfMotion as EquationsOfMotion,
    equations_of_motion as equations_of_motion,
    forward_dynamics as forward_dynamics,
)
from ._bodies import RigidBodies as RigidBodies, no_bodies as no_bodies
from ._closed_loop import (
    AbstractMotorController as AbstractMotorController,
    ControllerMemory as ControllerMemory,
    LoopState as LoopState,
    loop_rates as loop_rates,
)
from ._command import (
    CommandInterpolant as CommandInterpolant,
    MotorCommand as MotorCommand,
    MotorSample as MotorSample,
    MotorSetpoint as MotorSetpoint,
)
from ._cut_forces import cut_forces as cut_forces
from ._dh import dh_link as dh_link
from ._energy import (
    dissipated_power as dissipated_power,
    gear_energy as gear_energy,
    kinetic_energy as kinetic_energy,
    potential_energy as potential_energy,
)
from ._equilibrium import (
    holding_torque as holding_torque,
    static_equilibrium as static_equilibrium,
    static_load as static_load,
)
from ._gear_loads import resting_loads as resting_loads
from ._lagrange import lagrange_forces as lagrange_forces
from ._linearised import body_accelerations as body_accelerations
from ._modal_links import ModalLink as ModalLink
from ._newton_euler import inverse_dynamics as inverse_dynamics
from ._parts import (
    Axis as Axis,
    Body as Body,
    ElasticJoint as ElasticJoint,
    EndSlope as EndSlope,
    FlexibleLink as FlexibleLink,
    Offset as Offset,
    Part as Part,
    WristCentre as WristCentre,
    assemble as assemble,
)
from ._recursion import generalised_forces as generalised_forces
from ._robot import (
    AxisRole as AxisRole,
    ElasticRobot as ElasticRobot,
    ElasticRole as ElasticRole,
    JointLimits as JointLimits,
    NodeRole as NodeRole,
    SlopeRole as SlopeRole,
)
from ._screws import multibody as multibody
from ._simulate import (
    SimulationResult as SimulationResult,
    resting_loop as resting_loop,
    resting_state as resting_state,
    simulate as simulate,
)
from ._switching import (
    AbstractSwitchingSystem as AbstractSwitchingSystem,
    SwitchingResult as SwitchingResult,
    simulate_switching as simulate_switching,
)
from ._switching_loop import SwitchingLoop as SwitchingLoop
from ._tool_state import tool_state as tool_state
