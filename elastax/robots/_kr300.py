"""KUKA KR300 R2500 ultra, the robot of the public recordings."""

import numpy as np

from ..drivetrain import TwoScaleFriction
from ..dynamics import Body, ElasticRobot, JointLimits, Offset, assemble
from . import _quantec as quantec
from ._kuka_arm import arm_parts


# The recordings came from a robot whose sixth link, load included, is 150 kg with the
# centre of mass 0.1 m in front of the flange. The bare link is 17.78 kg at -0.05 m.
LINK_6_MASS, LINK_6_COM = 17.78, -0.05  # kg, m
PAYLOAD_MASS = 150.0 - LINK_6_MASS  # kg
PAYLOAD_COM = (150.0 * 0.1 - LINK_6_MASS * LINK_6_COM) / PAYLOAD_MASS  # 0.1202 m

MOTOR_SPEED = 4500.0 * 2.0 * np.pi / 60.0  # rad/s, assumed


def kr300() -> ElasticRobot:
    """KUKA KR300 R2500 ultra with the 132.22 kg of the recordings.

    Kinematics, bodies, motors, gears, friction and counterbalance of [Weigand2021],
    whose recorded gravity, mass and Coriolis terms this model reproduces to the four
    digits behind the point that they were stored with (link 6 as stored there: 150 kg,
    centre of mass at 0.1 m). Structure estimated from assumed sections, as for `kr210`.

    The joint angles are KUKA's, and the base turns the table's z down: A1 turns about
    -z, zero is the stretched arm, positive A2 and A3 lower the arm. The recordings
    start in the pose "cannon".

    The friction of the source changes its sign within 1e-4 rad/s. That is harmless in a
    feed-forward, but makes a simulation stiff.
    """
    right = np.pi / 2
    # theta, d, a, alpha [rad, m]
    table = np.array(
        [
            [0.0, -0.675, 0.350, right],
            [0.0, -0.189, 1.150, 0.0],
            [right, 0.189, 0.041, -right],
            [0.0, -1.0, 0.0, right],
            [0.0, 0.0, 0.0, -right],
            [0.0, -0.240, 0.0, np.pi],
        ]
    )
    # kg, m, kg m^2 about the centre of mass
    bodies = [
        Body(
            "carousel",
            395.40,
            (-0.353, 0.174, -0.004),
            quantec.tensor(
                16.733765, 29.799119, 32.814954, -1.703664, 0.129384, 4.404062
            ),
        ),
        Body(
            "link arm",
            339.12,
            (-0.709, -0.001, 0.023),
            quantec.tensor(
                7.507819, 88.886691, 88.673761, 0.430046, 0.173157, -4.396607
            ),
        ),
        Body(
            "arm",
            105.21,
            (-0.018, -0.018, -0.076),
            quantec.tensor(
                10.783798, 10.186135, 1.943179, 0.118474, -0.606384, -0.101950
            ),
        ),
        Body(
            "forearm",
            35.80,
            (0.0, 0.236, 0.001),
            quantec.tensor(0.425035, 0.217993, 0.428465, -4e-6, -0.011353, -2.7e-5),
        ),
        Body(
            "wrist",
            31.46,
            (0.0, -0.080, -0.009),
            quantec.tensor(0.283826, 0.229562, 0.258266, -4e-6, -0.019521, -1.2e-4),
        ),
        Body(
            "flange",
            LINK_6_MASS,
            (0.0, 0.0, LINK_6_COM),
            quantec.tensor(0.060429, 0.060382, 0.090701, 2.1e-5, 6e-6, 4e-6),
        ),
    ]
    parts = [
        Offset(rotation=np.diag([1.0, -1.0, -1.0])),
        *arm_parts(
            table,
            bodies,
            bearing_stiffness=(
                quantec.BEARING_STIFFNESS_1,
                quantec.BEARING_STIFFNESS_3,
            ),
            link_arm=quantec.link_arm_section(),
            forearm=quantec.forearm_section(),
            material=quantec.CAST_IRON,
            damping_time=quantec.STRUCTURE_DAMPING,
        ),
    ]
    degrees = np.deg2rad
    limits = JointLimits(
        lower=degrees([-147.0, -140.0, -112.0, -350.0, -122.5, -350.0]),
        upper=degrees([147.0, 20.0, 153.0, 350.0, 122.5, 350.0]),
        velocity=MOTOR_SPEED / quantec.RATIO,
        acceleration=degrees([300.0] * 3 + [600.0] * 3),
        jerk=degrees([3000.0] * 3 + [6000.0] * 3),
    )
    tool = np.eye(4)
    tool[:3, :3] = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]  # -90 deg on y
    robot = assemble(
        "kr300",
        parts,
        quantec.drives(_friction()),
        limits,
        axis_signs=np.ones(6),
        axis_zeros=np.zeros(6),
        poses={
            "stretched": np.zeros(6),
            "cannon": degrees([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]),
            "upright": degrees([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]),
        },
        counterbalance=quantec.counterbalance(),
        tool=tool,
        sources=(
            "kinematics, bodies, motors, gears of axes 1 to 3, friction, "
            "counterbalance, ranges of the axes: KR300 R2500 ultra [Weigand2021]",
            "mass and centre of mass of the load: from terms stored in the recordings",
        ),
        assumptions=(
            *quantec.ASSUMPTIONS,
            "payload: the recordings' 150 kg of link 6 less the flange's 17.78 kg, "
            "first moments kept; its inertia is that of a steel disc 0.4 m across; "
            "the tensor stored for link 6, too small for both, is kept as the flange's",
            "speeds: 4500 rpm at the motors",
            "A2 widened to +20 deg for the stretched pose, the maker's limit is -5 deg",
        ),
    )
    return robot.with_payload(PAYLOAD_MASS, (0.0, 0.0, PAYLOAD_COM), _disc())


def _friction() -> TwoScaleFriction:
    return TwoScaleFriction(
        viscous=quantec.VISCOUS,
        coulomb=quantec.COULOMB,
        steepness=np.full(6, quantec.STEEPNESS),
        coulomb_fine=quantec.COULOMB_FINE,
        steepness_fine=quantec.STEEPNESS_FINE,
        offset=quantec.OFFSET,
    )


def _disc() -> np.ndarray:
    """Assumed inertia of the load: steel disc of 0.4 m diameter [kg m^2]."""
    radius = 0.2
    height = PAYLOAD_MASS / (7850.0 * np.pi * radius**2)
    across = PAYLOAD_MASS * (3.0 * radius**2 + height**2) / 12.0
    return np.diag([across, across, 0.5 * PAYLOAD_MASS * radius**2])
