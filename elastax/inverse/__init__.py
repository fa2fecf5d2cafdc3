"""Inverse models: from a reference of the joints to motor angles and torques."""

from ._asim import (
    ASIM as ASIM,
    default_damping as default_damping,
    structure_torque as structure_torque,
)
from ._base import (
    AbstractInverse as AbstractInverse,
    feedforward_by_steps as feedforward_by_steps,
)
from ._correction import (
    AbstractCorrection as AbstractCorrection,
    PoseCorrection as PoseCorrection,
    PositionCorrection as PositionCorrection,
    correct as correct,
)
from ._damping_signal import (
    AbstractDampingSignal as AbstractDampingSignal,
    FilteredDamping as FilteredDamping,
    FrozenDamping as FrozenDamping,
)
from ._drive import (
    DriveState as DriveState,
    GearState as GearState,
    motor_motion as motor_motion,
)
from ._export import export_step as export_step
from ._flexible_joint import FlexibleJointInverse as FlexibleJointInverse
from ._response import advance as advance, response as response
from ._rigid import RigidInverse as RigidInverse
from ._stream import (
    Latency as Latency,
    StreamedInverse as StreamedInverse,
    compile_step as compile_step,
    latency as latency,
)
