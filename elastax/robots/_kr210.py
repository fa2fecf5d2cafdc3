"""KUKA KR210 of the R2700 type with 210 kg."""

import numpy as np

from ..dynamics import Body, ElasticRobot, JointLimits, Offset, assemble
from . import _quantec as quantec
from ._arm_structure import AbstractArmStructure, HingedArm
from ._kuka_arm import arm_parts


BASE = (0.0, 0.0, 0.2256)  # of the first row's frame [m]


def kr210(structure: AbstractArmStructure = HingedArm()) -> ElasticRobot:
    """KUKA KR210, 2.7 m reach, with a dumb-bell of 210 kg.

    Bodies from a public MATLAB model of a KR210 used for milling (values from CAD),
    with the milling spindle taken off; motors, gears, friction and counterbalance of
    the KR300 [Weigand2021]; structure estimated from assumed sections. KUKA has not
    published the elastic parameters: what is assumed stands in `assumptions`.

    The joint angles are KUKA's: zero is the stretched arm, A1 turns about -z, positive
    A2 and A3 lower the arm.

    Args:
        structure: how the link arm and the arm bend; at every detail the undeformed
            robot is the same.

    Examples:
        >>> robot = kr210(ModalArm(ModeCounts(2, 2, 1)))
    """
    parts = [
        Offset(BASE),
        *arm_parts(
            denavit_hartenberg(),
            link_bodies(),
            bearing_stiffness=(
                quantec.BEARING_STIFFNESS_1,
                quantec.BEARING_STIFFNESS_3,
            ),
            link_arm=quantec.link_arm_section(),
            forearm=quantec.forearm_section(),
            material=quantec.CAST_IRON,
            damping_time=quantec.STRUCTURE_DAMPING,
            structure=structure,
        ),
    ]
    degrees = np.deg2rad
    limits = JointLimits(
        lower=degrees([-185.0, -140.0, -120.0, -350.0, -125.0, -350.0]),
        upper=degrees([185.0, 20.0, 155.0, 350.0, 125.0, 350.0]),
        velocity=degrees([123.0, 115.0, 112.0, 179.0, 172.0, 219.0]),
        acceleration=degrees([300.0] * 3 + [600.0] * 3),
        jerk=degrees([3000.0] * 3 + [6000.0] * 3),
    )
    load = np.array([0.0, 0.0, 0.24])
    robot = assemble(
        "kr210",
        parts,
        quantec.drives(quantec.coulomb_viscous()),
        limits,
        axis_signs=[-1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        axis_zeros=np.zeros(6),
        poses={
            "stretched": np.zeros(6),
            "cannon": degrees([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]),
            "upright": degrees([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]),
        },
        counterbalance=quantec.counterbalance(),
        tool=np.block(
            [[np.eye(3), load[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
        ),
        sources=(
            "bodies and kinematics: public MATLAB model of a KR210 for milling",
            "motors, gears of axes 1 to 3, friction, counterbalance: KR300 R2500 ultra "
            "[Weigand2021]",
            "speeds: kuka_experimental, kr210l150",
        ),
        assumptions=(
            *quantec.ASSUMPTIONS,
            "friction: both Coulomb terms of the KR300 as one, steepness 500 s/rad",
            "counterbalance of the KR300; the KR210 of the text has a spring",
            "payload: dumb-bell, two steel discs 0.4 m apart, 0.24 m in front of the "
            "flange; flange body without spindle: that of the KR300, inertia estimated",
            "flange 0.215 m in front of the wrist centre (the source's 0.42 m include "
            "the spindle)",
            "A2 widened to +20 deg: the text works from the stretched arm (A2 = 0), "
            "the maker's limit is -5 deg",
            "products of inertia of the link arm: read as tensor elements",
        ),
    )
    return robot.with_payload(210.0, load, np.diag([9.6, 3.8, 9.6]))


def denavit_hartenberg() -> np.ndarray:
    """Rows theta, d, a, alpha [rad, m], from the frame at `BASE` on."""
    right = np.pi / 2
    return np.array(
        [
            [0.0, 0.4494, 0.350, -right],
            [0.0, 0.0, 1.150, 0.0],
            [right, 0.0, 0.041, -right],
            [0.0, -1.2, 0.0, right],
            [0.0, 0.0, 0.0, -right],
            [np.pi, -0.215, 0.0, np.pi],
        ]
    )


def link_bodies() -> list[Body]:
    """Bodies of the links in their distal frames, without the milling spindle."""
    tensor = quantec.tensor
    return [
        Body(
            "carousel", 259.85, (-0.36493, 0.22028, 0.00434), tensor(8.88, 13.72, 16.27)
        ),
        Body(
            "link arm",
            334.71,
            (-0.71793, 0.02787, -0.23573),
            tensor(6.19, 55.86, 55.17, xy=-1.69, xz=-6.13),
        ),
        Body("arm", 217.46, (-0.02558, 0.02189, -0.31108), tensor(25.44, 25.92, 2.31)),
        Body("forearm", 12.17, (0.0, 0.12343, 0.00135), tensor(0.1285, 0.0298, 0.1302)),
        Body("wrist", 29.53, (0.00005, -0.024, -0.0467), tensor(0.402, 0.238, 0.288)),
        Body("flange", 17.78, (0.0, 0.0, -0.050), tensor(0.06, 0.06, 0.09)),
    ]
