"""Universal Robots UR10e: kinematics of the maker."""

import numpy as np

from .._custom_types import as_real
from ..kinematics import Arm, SerialChain


def ur10e() -> Arm:
    """Universal Robots UR10e, 1.3 m reach, six axes without a spherical wrist.

    The tool frame is the flange of the maker (`tool0`): z points outwards. The angles
    are the maker's. Each arm leaves the factory with a calibration of its own, some
    0.1 to 1 mm away from these nominal dimensions.
    """
    right = np.pi / 2
    # theta, d, a, alpha [rad, m]
    table = np.array(
        [
            [0.0, 0.1807, 0.0, right],
            [0.0, 0.0, -0.6127, 0.0],
            [0.0, 0.0, -0.57155, 0.0],
            [0.0, 0.17415, 0.0, right],
            [0.0, 0.11985, 0.0, -right],
            [0.0, 0.11655, 0.0, 0.0],
        ]
    )
    degrees = lambda *angles: as_real(np.deg2rad(np.array(angles)))
    return Arm(
        chain=SerialChain.from_dh(*table.T),
        lower=degrees(*[-360.0] * 6),
        upper=degrees(*[360.0] * 6),
        velocity=degrees(120.0, 120.0, 180.0, 180.0, 180.0, 180.0),
        signs=np.ones(6),
        zeros=np.zeros(6),
        poses={
            "zero": degrees(*[0.0] * 6),
            "upright": degrees(0.0, -90.0, 0.0, -90.0, 0.0, 0.0),
            "elbow up": degrees(0.0, -90.0, 90.0, -90.0, -90.0, 0.0),
        },
        name="ur10e",
        axis_names=(
            "base",
            "shoulder",
            "elbow",
            "wrist 1",
            "wrist 2",
            "wrist 3",
        ),
        sources=(
            "dimensions: Universal Robots, parameters for calculations of kinematics "
            "and dynamics (article 45257), UR10e",
            "limits and speeds: UniversalRobots/Universal_Robots_ROS2_Description, "
            "config/ur10e/joint_limits.yaml, which cites the maker's user manual 5.8",
        ),
        assumptions=(
            "elbow +-360 deg as the maker states; the ROS description halves it for "
            "the sake of planners, since the arm meets itself beyond +-180 deg",
        ),
    )
