"""Robots: functions that return records, every number with its source."""

from ._arm_structure import (
    AbstractArmStructure as AbstractArmStructure,
    BodiesArm as BodiesArm,
    HingedArm as HingedArm,
    LumpedArm as LumpedArm,
    ModalArm as ModalArm,
    TiltedArm as TiltedArm,
)
from ._beam_manipulators import (
    beam_on_joint as beam_on_joint,
    one_link_arm as one_link_arm,
    three_axis_arm as three_axis_arm,
    two_beams as two_beams,
)
from ._fanuc import fanuc as fanuc
from ._iiwa14 import iiwa14 as iiwa14
from ._kr16 import kr16 as kr16
from ._kr210 import kr210 as kr210
from ._kr300 import kr300 as kr300
from ._manutec_r3 import (
    manutec_r3 as manutec_r3,
    manutec_r3_control as manutec_r3_control,
    manutec_r3_friction as manutec_r3_friction,
    manutec_r3_plant as manutec_r3_plant,
)
from ._modal_manipulator import (
    ladder_link as ladder_link,
    modal_manipulator as modal_manipulator,
)
from ._named import (
    ARMS as ARMS,
    ROBOTS as ROBOTS,
    named_model as named_model,
    named_robot as named_robot,
)
from ._planar_2r import planar_2r as planar_2r
from ._quanser_2dsfl import quanser_2dsfl as quanser_2dsfl
from ._simplified_kr210 import simplified_kr210 as simplified_kr210
from ._ur10e import ur10e as ur10e
