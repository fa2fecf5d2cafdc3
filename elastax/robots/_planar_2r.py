"""The planar arm of [Berns]: kinematics only."""

import numpy as np

from .._custom_types import as_real
from ..kinematics import Arm, SerialChain


def planar_2r(first: float = 1.0, second: float = 0.7) -> Arm:
    """Two links in the x-y plane, both joints about z.

    Args:
        first: length of the first link [m].
        second: length of the second link [m].

    References:
        [Berns], planar arm with two links. The text has letters only; every number is
        assumed.
    """
    zeros = np.zeros(2)
    half = np.full(2, np.pi)
    return Arm(
        chain=SerialChain.from_dh(zeros, zeros, np.array([first, second]), zeros),
        lower=-half,
        upper=half,
        velocity=half,
        signs=np.ones(2),
        zeros=zeros,
        poses={
            "stretched": as_real(zeros),
            "square": as_real(np.array([0.0, np.pi / 2])),
        },
        name="planar_2r",
        axis_names=("J1", "J2"),
        sources=("structure: [Berns], planar arm with two links",),
        assumptions=(
            "lengths 1 m and 0.7 m unless given, limits of half a turn, half a turn "
            "per second: the text gives no numbers",
        ),
    )
