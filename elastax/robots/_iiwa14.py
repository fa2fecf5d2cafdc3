"""KUKA LBR iiwa 14 R820: kinematics of the maker."""

import numpy as np

from .._custom_types import as_real
from ..kinematics import Arm, SerialChain


def iiwa14() -> Arm:
    """KUKA LBR iiwa 14 R820, 0.82 m reach, seven axes, spherical shoulder and wrist.

    Zero is the upright arm. The tool frame is the flange without media coupling: z
    points outwards. The angles are the maker's.
    """
    right = np.pi / 2
    # theta, d, a, alpha [rad, m]; d of the axes 1, 3, 5, 7 below
    table = np.array(
        [
            [0.0, 0.1575 + 0.2025, 0.0, -right],
            [0.0, 0.0, 0.0, right],
            [0.0, 0.2045 + 0.2155, 0.0, right],
            [0.0, 0.0, 0.0, -right],
            [0.0, 0.1845 + 0.2155, 0.0, -right],
            [0.0, 0.0, 0.0, right],
            [0.0, 0.081 + 0.045, 0.0, 0.0],
        ]
    )
    degrees = lambda *angles: as_real(np.deg2rad(np.array(angles)))
    limit = (170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 175.0)
    return Arm(
        chain=SerialChain.from_dh(*table.T),
        lower=-degrees(*limit),
        upper=degrees(*limit),
        velocity=degrees(85.0, 85.0, 100.0, 75.0, 130.0, 135.0, 135.0),
        signs=np.ones(7),
        zeros=np.zeros(7),
        poses={
            "upright": degrees(*[0.0] * 7),
            "bent": degrees(0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0),
        },
        name="iiwa14",
        axis_names=tuple(f"A{k}" for k in range(1, 8)),
        sources=(
            "dimensions and limits: IFL-CAMP/iiwa_stack, "
            "iiwa_description/urdf/iiwa14.xacro",
            "speeds: data sheet KUKA LBR iiwa 14 R820, as mj_manipulator quotes it",
        ),
        assumptions=(
            "speeds: not compared with the maker's own document",
            "the pose `bent` is ours",
        ),
    )
