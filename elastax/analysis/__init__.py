"""Poles, zeros and zero dynamics of robots and systems, figures that judge a motion."""

from ._channels import (
    AbstractDrive as AbstractDrive,
    AbstractSensor as AbstractSensor,
    BodyPoint as BodyPoint,
    JointEncoder as JointEncoder,
    MotorAngles as MotorAngles,
    MotorEncoder as MotorEncoder,
    MotorTorques as MotorTorques,
    NodePoint as NodePoint,
    SensorGroup as SensorGroup,
    ToolPosition as ToolPosition,
)
from ._control_system import (
    ControlSystem as ControlSystem,
    find_equilibrium as find_equilibrium,
    linearise as linearise,
)
from ._judgement import (
    WINDOW as WINDOW,
    Judgement as Judgement,
    criterion as criterion,
    judge as judge,
)
from ._lie import (
    input_lie_derivative as input_lie_derivative,
    lie_derivative as lie_derivative,
)
from ._linear_inverse import (
    HighGainCondition as HighGainCondition,
    high_gain_condition as high_gain_condition,
    high_gain_inverse as high_gain_inverse,
    inverse_model as inverse_model,
)
from ._linear_model import (
    LinearModel as LinearModel,
    OperatingPoint as OperatingPoint,
    SignalNames as SignalNames,
    linear_model_of as linear_model_of,
)
from ._locked_modes import locked_frequencies as locked_frequencies
from ._modes import Modes as Modes, modes_of as modes_of
from ._normal_form import NormalForm as NormalForm, normal_form as normal_form
from ._output_position import (
    LinkZeros as LinkZeros,
    zeros_along_link as zeros_along_link,
)
from ._relative_degree import (
    RelativeDegree as RelativeDegree,
    decoupling_matrix as decoupling_matrix,
    relative_degree as relative_degree,
)
from ._robot_model import (
    RobotChannel as RobotChannel,
    linear_robot as linear_robot,
)
from ._robot_system import robot_system as robot_system
from ._sensitivity import (
    Sensitivity as Sensitivity,
    sensitivities as sensitivities,
)
from ._transmission_zeros import transmission_zeros as transmission_zeros
from ._zero_dynamics import (
    ZeroDynamics as ZeroDynamics,
    simulate_zero_dynamics as simulate_zero_dynamics,
    zero_dynamics as zero_dynamics,
)
from ._zero_map import (
    PoseFigures as PoseFigures,
    ZeroMap as ZeroMap,
    pose_figures as pose_figures,
    zero_map as zero_map,
)
from ._zero_structure import (
    ZeroStructure as ZeroStructure,
    zero_structure as zero_structure,
)
