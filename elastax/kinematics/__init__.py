"""Homogeneous transforms, serial chains, Jacobians and inverse kinematics."""

from ._arm import Arm as Arm
from ._axis_lines import (
    AxisLines as AxisLines,
    axis_lines as axis_lines,
    characteristic_length as characteristic_length,
)
from ._chain import (
    MovingFrames as MovingFrames,
    SerialChain as SerialChain,
    forward_kinematics as forward_kinematics,
    joint_steps as joint_steps,
    link_poses as link_poses,
    moving_frames as moving_frames,
)
from ._configuration import (
    FanucConfiguration as FanucConfiguration,
    KukaConfiguration as KukaConfiguration,
    fanuc_configuration as fanuc_configuration,
    fanuc_joint_angles as fanuc_joint_angles,
    kuka_configuration as kuka_configuration,
    kuka_joint_angles as kuka_joint_angles,
)
from ._convention_properties import (
    ConventionProperties as ConventionProperties,
    JointProperties as JointProperties,
    convention_properties as convention_properties,
    joint_properties as joint_properties,
)
from ._convert import (
    to_dh as to_dh,
    to_hayati as to_hayati,
    to_mixed as to_mixed,
    to_modified_dh as to_modified_dh,
    to_rpy as to_rpy,
    to_veitschegger_wu as to_veitschegger_wu,
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
from ._elementary import (
    Element as Element,
    ElementaryProduct as ElementaryProduct,
    ElementKind as ElementKind,
    elementary_pose as elementary_pose,
)
from ._elementary_chain import elementary_chain as elementary_chain
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
from ._ik_calibrated import (
    calibrated_inverse_kinematics as calibrated_inverse_kinematics,
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
from ._ik_elastic import geometric_correction as geometric_correction
from ._ik_evaluate import pose_difference as pose_difference
from ._ik_minimise import minimise_pose as minimise_pose
from ._ik_numeric import (
    NumericSolution as NumericSolution,
    singular_distance as singular_distance,
    solve_pose as solve_pose,
)
from ._ik_planar import (
    PlanarArm as PlanarArm,
    planar_inverse as planar_inverse,
    planar_inverse_geometric as planar_inverse_geometric,
)
from ._ik_restarts import (
    FoundPose as FoundPose,
    PoseSearch as PoseSearch,
    SearchResults as SearchResults,
    find_pose as find_pose,
)
from ._ik_steps import (
    AbstractStep as AbstractStep,
    DampedStep as DampedStep,
    ErrorDampedStep as ErrorDampedStep,
    PseudoInverseStep as PseudoInverseStep,
    RestPostureStep as RestPostureStep,
    limit_step as limit_step,
)
from ._inverse_motion import (
    AbstractRateInverse as AbstractRateInverse,
    DampedRateInverse as DampedRateInverse,
    ExactRateInverse as ExactRateInverse,
    JointMotion as JointMotion,
    LeastSquaresRateInverse as LeastSquaresRateInverse,
    inverse_motion as inverse_motion,
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
from ._lengths import length_doubts as length_doubts
from ._link_conventions import (
    HayatiJoints as HayatiJoints,
    MixedJoints as MixedJoints,
    ModifiedDHJoints as ModifiedDHJoints,
    VeitscheggerWuJoints as VeitscheggerWuJoints,
)
from ._minimal import (
    MinimalModel as MinimalModel,
    minimal_model as minimal_model,
    parameter_count as parameter_count,
    random_poses as random_poses,
)
from ._motion import (
    ToolMotion as ToolMotion,
    motion_from_rpy as motion_from_rpy,
    product_derivatives as product_derivatives,
    rpy_derivatives as rpy_derivatives,
    tool_derivatives as tool_derivatives,
)
from ._motion_limits import (
    MotionCheck as MotionCheck,
    MotionLimits as MotionLimits,
    check_motion as check_motion,
    motion_margins as motion_margins,
)
from ._parameters import (
    ChainParameters as ChainParameters,
    Parameter as Parameter,
    parameter_jacobian as parameter_jacobian,
    stacked_jacobian as stacked_jacobian,
)
from ._pose_correction import (
    DeformableArm as DeformableArm,
    PoseCorrection as PoseCorrection,
    correct_pose as correct_pose,
)
from ._pose_derivatives import (
    MultiIndices as MultiIndices,
    elementary_jacobian as elementary_jacobian,
    multi_indices as multi_indices,
    pose_derivative as pose_derivative,
    pose_gradient as pose_gradient,
    pose_hessian as pose_hessian,
)
from ._posture import (
    Posture as Posture,
    branch_index as branch_index,
    posture_of as posture_of,
)
from ._redundancy import (
    hard_and_soft as hard_and_soft,
    weighted_correction as weighted_correction,
)
from ._resolved_motion import resolved_motion as resolved_motion
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
from ._separation import (
    MatrixEquation as MatrixEquation,
    contained_unknowns as contained_unknowns,
    inverse_by_separation as inverse_by_separation,
    link_transforms as link_transforms,
    separated_equation as separated_equation,
    separated_equations as separated_equations,
)
from ._singular_values import singular_values as singular_values
from ._singularities import (
    Combination as Combination,
    Singularity as Singularity,
    drive_singularity as drive_singularity,
    parameter_singularity as parameter_singularity,
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
from ._taylor_expansion import (
    TaylorRemainder as TaylorRemainder,
    pose_differentials as pose_differentials,
    taylor_majorant as taylor_majorant,
    taylor_polynomials as taylor_polynomials,
    taylor_remainder as taylor_remainder,
)
from ._wrist_weights import WristWeights as WristWeights
