"""Homogeneous transforms, serial chains, Jacobians and inverse kinematics."""

from ._chain import (
    MovingFrames as MovingFrames,
    SerialChain as SerialChain,
    forward_kinematics as forward_kinematics,
    joint_steps as joint_steps,
    link_poses as link_poses,
    moving_frames as moving_frames,
)
from ._damping import (
    AbstractDamping as AbstractDamping,
    ConstantDamping as ConstantDamping,
    CorrectionLimiter as CorrectionLimiter,
    SigmoidDamping as SigmoidDamping,
    attenuate as attenuate,
    limit as limit,
)
from ._ik_analytic import (
    SphericalWrist as SphericalWrist,
    inverse_kinematics as inverse_kinematics,
    inverse_kinematics_path as inverse_kinematics_path,
    select_branch as select_branch,
)
from ._ik_dls import (
    PoseResults as PoseResults,
    PoseSolution as PoseSolution,
    damped_least_squares as damped_least_squares,
    pose_error as pose_error,
    row_weights as row_weights,
    smallest_singular_value as smallest_singular_value,
    solve_damped as solve_damped,
)
from ._jacobian import (
    jacobian as jacobian,
    jacobian_derivatives as jacobian_derivatives,
    tool_jacobian as tool_jacobian,
    tool_levers as tool_levers,
    tool_motion as tool_motion,
)
from ._joints import (
    AbstractJoints as AbstractJoints,
    DHJoints as DHJoints,
    FrameJoints as FrameJoints,
    JointFrames as JointFrames,
    JointKind as JointKind,
    RPYJoints as RPYJoints,
)
from ._se3 import (
    inverse_transform as inverse_transform,
    rotation_about as rotation_about,
    rotation_error as rotation_error,
    rotation_from_rpy as rotation_from_rpy,
    rotation_x as rotation_x,
    rotation_y as rotation_y,
    rotation_z as rotation_z,
    transform as transform,
)
from ._singular_values import singular_values as singular_values
from ._structured import (
    SAME as SAME,
    JointStructure as JointStructure,
    Placement as Placement,
    StructuredJoints as StructuredJoints,
    placement as placement,
    placements as placements,
    structured as structured,
)
