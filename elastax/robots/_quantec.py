"""What the KUKA Quantec arms here share: motors, gears, friction, counterbalance.

Numbers of the KR300 R2500 ultra from [Weigand2021] unless marked otherwise.
"""

import numpy as np

from ..drivetrain import (
    AbstractFriction,
    CoulombViscousFriction,
    DriveTrain,
    GasCounterbalance,
    LinearStiffness,
    Motor,
)
from ..structure import BeamSection, Material


RATIO = np.array(
    [1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340]
)  # motor / output [-]
MOTOR_INERTIA = np.array([0.00923, 0.0118, 0.0118, 0.00173, 0.00173, 0.00173])  # kg m^2
VISCOUS = np.array([2050.35, 2306.7, 2024.4, 453.66, 1000.0, 458.8])  # N m s/rad
COULOMB = np.array([285.36, 10.0, 29.859, 34.34, 10.0, 15.449])  # N m
COULOMB_FINE = np.array([70.135, 232.33, 264.635, 16.0465, 36.73395, 60.68])  # N m
STEEPNESS = 10.0  # s/rad, argument of the tanh
STEEPNESS_FINE = np.array([530.0, 28994.0, 31572.0, 837.45, 4855.06, 2465.3])  # s/rad
OFFSET = np.array([54.024, -255.55, -200.53, -2.1199, 0.49337, 0.3674])  # N m

# axes 1 to 3 [Weigand2021]; axes 4 to 6 from a public file of a KR210-like arm that
# names no source of its own: an order of magnitude
GEAR_STIFFNESS = np.array(
    [4_577_800.0, 7_518_900.0, 4_099_900.0, 360_000.0, 370_000.0, 380_000.0]
)  # N m/rad
# axes 1 to 3: dampers of a KR500 from a public file, "measured from EMA"; axes 4 to 6:
# damper over spring of that file's axis 4, 1.9e3 / 3.0e6 s, times our springs
GEAR_DAMPING = np.array(
    [1.9e3, 1.4e3, 0.6e3, *(1.9e3 / 3.0e6 * GEAR_STIFFNESS[3:])]
)  # N m s/rad

# material of the arm's castings, handbook values of ductile iron EN-GJS-400
CAST_IRON = Material(young=169e9, shear=66e9, density=7100.0)

# assumed: moment stiffness of the main bearings of gears of this size, the order of
# magnitude that makers of cycloidal gears give
BEARING_STIFFNESS_1 = 1.7e7  # N m/rad
BEARING_STIFFNESS_3 = 1.0e7  # N m/rad

# assumed: damper over spring of the structure [s]: 1 % of critical at 10 Hz
STRUCTURE_DAMPING = 3.2e-4

ASSUMPTIONS = (
    "gear stiffness of axes 4 to 6: order of magnitude, from a file without source",
    "gear damping: of a KR500 (larger robot); axes 4 to 6 in proportion to stiffness",
    "tilt stiffness of axis 1 (1.7e7 N m/rad) and axis 3 (1.0e7 N m/rad): order of "
    "magnitude of the main bearings of such gears",
    "link arm: box section 300 x 180 mm, wall 12 mm, ductile iron; forearm: tube of "
    "220 mm, wall 10 mm; both uniform, tip-force springs 3 EI / l, slope factor 1/2",
    "structural damping: d = 3.2e-4 s times stiffness (1 % of critical at 10 Hz)",
    "acceleration and jerk limits: 300 deg/s^2 and 3000 deg/s^3 on axes 1 to 3, "
    "600 deg/s^2 and 6000 deg/s^3 on axes 4 to 6",
)


def link_arm_section() -> BeamSection:
    """Assumed box section of the link arm, 300 mm in its plane, 180 mm across."""
    return BeamSection.rectangular_tube(height=0.18, width=0.30, wall=0.012)


def forearm_section() -> BeamSection:
    """Assumed tube of the forearm."""
    return BeamSection.circular_tube(diameter=0.22, wall=0.010)


def coulomb_viscous() -> AbstractFriction:
    """The KR300's friction in the form of [Reiner2010] (2.3).

    Both Coulomb terms of the source add up to one; the steepness is assumed.
    """
    return CoulombViscousFriction(VISCOUS, COULOMB + COULOMB_FINE, np.full(6, 500.0))


def no_friction() -> AbstractFriction:
    """The source puts all friction on the motor side."""
    return CoulombViscousFriction(np.zeros(6), np.zeros(6), np.ones(6))


def drives(friction: AbstractFriction) -> DriveTrain:
    """Drive trains with the given friction at the motors."""
    return DriveTrain(
        ratio=RATIO,
        motor=Motor(MOTOR_INERTIA),
        stiffness=LinearStiffness(GEAR_STIFFNESS),
        damping=GEAR_DAMPING,
        motor_friction=friction,
        joint_friction=no_friction(),
    )


def counterbalance() -> GasCounterbalance:
    """Hydraulic cylinder and bladder accumulator at axis 2 of the KR300."""
    return GasCounterbalance.from_gas(
        mass=0.159,
        gas_constant=296.8,
        temperature=328.0,
        compressibility=1.01,
        volume=0.96e-3,
        base_distance=0.8,
        lever=0.2,
        angle_offset=np.deg2rad(95.0),
        reference_length=0.6,
        piston_diameter=0.055,
        rod_diameter=0.030,
    )


def tensor(xx, yy, zz, xy=0.0, yz=0.0, xz=0.0) -> np.ndarray:
    """Inertia tensor from its elements [kg m^2]."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
