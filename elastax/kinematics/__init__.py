"""Homogeneous transforms, serial chains, Jacobians and inverse kinematics."""

from ._angle_rates import (
    analytic_jacobian as analytic_jacobian,
    angle_motion as angle_motion,
    angular_velocity as angular_velocity,
    quaternion_rate_matrix as quaternion_rate_matrix,
    quaternion_rates as quaternion_rates,
    rpy_rate_matrix as rpy_rate_matrix,
    rpy_rates as rpy_rates,
    zxz_rate_matrix as zxz_rate_matrix,
    zxz_rates as zxz_rates,
)
from ._arm import Arm as Arm
from ._axis_lines import (
    AxisLines as AxisLines,
    axis_lines as axis_lines,
    characteristic_length as characteristic_length,
)
from ._base_relation import (
    BaseRelation as BaseRelation,
    identify_base_relation as identify_base_relation,
)
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
from ._cooperating import (
    Cooperation as Cooperation,
    SlaveMotion as SlaveMotion,
    led_motion as led_motion,
    loop_error as loop_error,
    slave_motion as slave_motion,
    slave_pose as slave_pose,
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
from ._instruments import (
    AbstractInstrument as AbstractInstrument,
    DistanceInstrument as DistanceInstrument,
    PointInstrument as PointInstrument,
    PoseInstrument as PoseInstrument,
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
from ._logarithm import (
    pose_difference as pose_difference,
    twist_from_transform as twist_from_transform,
    vector_from_rotation as vector_from_rotation,
)
from ._manipulability import (
    Ellipsoid as Ellipsoid,
    condition_number as condition_number,
    directional_reach as directional_reach,
    inverse_condition_number as inverse_condition_number,
    manipulability as manipulability,
    scaled_jacobian as scaled_jacobian,
    velocity_ellipsoid as velocity_ellipsoid,
)
from ._measurements import Measurements as Measurements
from ._minimal import (
    MinimalModel as MinimalModel,
    generic_poses as generic_poses,
    minimal_model as minimal_model,
    parameter_count as parameter_count,
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
from ._orientation import (
    abc_from_rotation as abc_from_rotation,
    check_rotation as check_rotation,
    check_transform as check_transform,
    rotation_from_abc as rotation_from_abc,
    rotation_from_zxz as rotation_from_zxz,
    rpy_from_rotation as rpy_from_rotation,
    rpy_solutions as rpy_solutions,
    zxz_from_rotation as zxz_from_rotation,
    zxz_solutions as zxz_solutions,
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
from ._pose_selection import (
    PoseSelection as PoseSelection,
    select_poses as select_poses,
)
from ._posture import (
    Posture as Posture,
    branch_index as branch_index,
    posture_of as posture_of,
)
from ._quaternion import (
    continuous_quaternions as continuous_quaternions,
    quaternion_from_rotation as quaternion_from_rotation,
    quaternion_product as quaternion_product,
    rotation_from_quaternion as rotation_from_quaternion,
)
from ._reach import (
    ReachLimits as ReachLimits,
    extent as extent,
    reach_limits as reach_limits,
)
from ._redundancy import (
    hard_and_soft as hard_and_soft,
    weighted_correction as weighted_correction,
)
from ._registration import (
    PointFit as PointFit,
    RotationFit as RotationFit,
    fit_points as fit_points,
    mean_rotation as mean_rotation,
    nearest_rotation as nearest_rotation,
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
from ._starts import random_joints as random_joints
from ._statics import (
    WrenchEstimate as WrenchEstimate,
    generalised_wrench as generalised_wrench,
    joint_torques as joint_torques,
    tool_compliance as tool_compliance,
    tool_stiffness as tool_stiffness,
    wrench_about as wrench_about,
    wrench_from_generalised as wrench_from_generalised,
    wrench_from_joint_torques as wrench_from_joint_torques,
    wrench_to_base as wrench_to_base,
    wrench_to_tool as wrench_to_tool,
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
from ._tool_pose import (
    Mounting as Mounting,
    ToolCentre as ToolCentre,
    frame_from_points as frame_from_points,
    mounting_pose as mounting_pose,
    tool_centre_point as tool_centre_point,
    tool_frame as tool_frame,
    tool_orientation as tool_orientation,
)
from ._uncertainty import (
    Quantisation as Quantisation,
    explicit_sensitivity as explicit_sensitivity,
    implicit_sensitivity as implicit_sensitivity,
    propagated_covariance as propagated_covariance,
    quantisation as quantisation,
    tool_covariance as tool_covariance,
    tool_deviation as tool_deviation,
    tool_sensitivity as tool_sensitivity,
    tool_worst_case as tool_worst_case,
    worst_case as worst_case,
)
from ._workspace import (
    PoseQuality as PoseQuality,
    SampledSection as SampledSection,
    joint_grid as joint_grid,
    pose_quality as pose_quality,
    reachable_points as reachable_points,
    sampled_section as sampled_section,
    section_map as section_map,
    section_points as section_points,
)
from ._wrist_weights import WristWeights as WristWeights
