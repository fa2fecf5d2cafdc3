"""The Fanuc arm of [KinModell]: kinematics only."""

import numpy as np

from .._custom_types import as_real
from ..kinematics import Arm, SerialChain


def fanuc() -> Arm:
    """Six-axis Fanuc arm, kinematics of [KinModell] table 3-5.

    The base frame lies where axis 1 passes the height of axis 2, z up; the tool frame
    lies in the flange, z out of it. At the maker's zero the upper arm stands upright,
    the forearm points forward and the flange faces forward.

    The table gives a, d, alpha [mm, degrees] and the zero offsets. It does not give the
    senses of the axes, a coupling of the axes 2 and 3, limits or speeds: what is
    assumed stands in `assumptions`.

    References:
        [KinModell] (3-45), table 3-5. The machine's angle is the table's plus the
        offset, so that theta_2 = 90 degrees at the machine's zero.
    """
    # a, d [mm], alpha, theta_o [degrees]
    table = np.array(
        [
            [312.0, 0.0, 90.0, 0.0],
            [1075.0, 0.0, 0.0, -90.0],
            [225.0, 0.0, 90.0, 0.0],
            [0.0, 1280.0, -90.0, 0.0],
            [0.0, 0.0, 90.0, 0.0],
            [0.0, 215.0, 0.0, 0.0],
        ]
    )
    chain = SerialChain.from_dh(
        np.zeros(6), 1e-3 * table[:, 1], 1e-3 * table[:, 0], np.deg2rad(table[:, 2])
    )
    degrees = np.deg2rad
    zeros = -degrees(table[:, 3])
    # of the maker's angles; axis 2 with the sign of the table, see `assumptions`
    lower = degrees([-180.0, -76.0, -132.0, -360.0, -125.0, -360.0])
    upper = degrees([180.0, 60.0, 230.0, 360.0, 125.0, 360.0])
    return Arm(
        chain=chain,
        lower=lower + zeros,
        upper=upper + zeros,
        velocity=degrees([95.0, 90.0, 95.0, 120.0, 120.0, 190.0]),
        signs=np.ones(6),
        zeros=zeros,
        poses={
            "zero": as_real(np.zeros(6)),
            "tool down": as_real(degrees([0.0, 0.0, 0.0, 0.0, -90.0, 0.0])),
        },
        name="fanuc",
        axis_names=tuple(f"J{k}" for k in range(1, 7)),
        sources=("lengths, twists, zero offsets: [KinModell] table 3-5",),
        assumptions=(
            "all axes count in the sense of the table's z axes: the text gives no "
            "directions; published models of similar arms (ROS-Industrial, R-2000iB) "
            "turn axis 2 the other way",
            "no coupling of the axes 2 and 3, which Fanuc's controllers have",
            "limits and speeds: of the R-2000iB/210F in the ROS-Industrial model "
            "fanuc_r2000ib_support, an arm with the same lengths up to the flange; the "
            "text gives none",
        ),
    )
