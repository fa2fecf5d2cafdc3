"""Homogeneous transforms, serial chains, Jacobians and inverse kinematics."""

from ._arm import Arm as Arm
from ._calibration import (
    Calibration as Calibration,
    calibrate as calibrate,
)
from ._calibration_problem import (
    RELIABLE_CONDITION as RELIABLE_CONDITION,
    CalibrationProblem as CalibrationProblem,
    GaussianPrior as GaussianPrior,
    Identifiability as Identifiability,
    identifiability as identifiability,
)
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
from ._dependence import (
    Dependence as Dependence,
    dependent_columns as dependent_columns,
)
from ._estimate import (
    Estimate as Estimate,
    NoiseVariance as NoiseVariance,
    estimate_parameters as estimate_parameters,
)
from ._exponential import (
    rotation_from_vector as rotation_from_vector,
    transform_from_twist as transform_from_twist,
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
from ._instruments import (
    AbstractInstrument as AbstractInstrument,
    DistanceInstrument as DistanceInstrument,
    PointInstrument as PointInstrument,
    PoseInstrument as PoseInstrument,
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
from ._link_conventions import (
    HayatiJoints as HayatiJoints,
    MixedJoints as MixedJoints,
    ModifiedDHJoints as ModifiedDHJoints,
    VeitscheggerWuJoints as VeitscheggerWuJoints,
)
from ._measurements import Measurements as Measurements
from ._observability import (
    AbstractObservability as AbstractObservability,
    InverseConditionIndex as InverseConditionIndex,
    MeanVarianceIndex as MeanVarianceIndex,
    NoiseAmplificationIndex as NoiseAmplificationIndex,
    ProductIndex as ProductIndex,
    ReciprocalSumIndex as ReciprocalSumIndex,
    SmallestSingularValueIndex as SmallestSingularValueIndex,
    observability as observability,
    reading_jacobian as reading_jacobian,
)
from ._parameters import (
    ChainParameters as ChainParameters,
    Parameter as Parameter,
    parameter_jacobian as parameter_jacobian,
)
from ._pose_selection import (
    PoseSelection as PoseSelection,
    random_poses as random_poses,
    select_poses as select_poses,
)
from ._registration import (
    PointFit as PointFit,
    RotationFit as RotationFit,
    fit_points as fit_points,
    mean_rotation as mean_rotation,
    nearest_rotation as nearest_rotation,
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
from ._structured import (
    SAME as SAME,
    JointStructure as JointStructure,
    Placement as Placement,
    StructuredJoints as StructuredJoints,
    placement as placement,
    placements as placements,
    structured as structured,
)
from ._tool_pose import (
    Mounting as Mounting,
    ToolCentre as ToolCentre,
    frame_from_points as frame_from_points,
    mounting_pose as mounting_pose,
    tool_centre_point as tool_centre_point,
    tool_frame as tool_frame,
    tool_orientation as tool_orientation,
)
