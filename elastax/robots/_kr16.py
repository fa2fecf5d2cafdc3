"""KUKA KR16-2, a small arm: kinematics of the maker, dynamics scaled from the KR210."""

import numpy as np

from ..drivetrain import CoulombViscousFriction, DriveTrain, LinearStiffness, Motor
from ..dynamics import Body, ElasticRobot, JointLimits, assemble
from ..structure import BeamSection
from . import _quantec as quantec
from ._kr210 import link_bodies
from ._kuka_arm import arm_parts


# reach 1.611 m over the 2.701 m of the KR210
LENGTH_SCALE = 0.6
MASS_SCALE = LENGTH_SCALE**3
INERTIA_SCALE = LENGTH_SCALE**5
# gravity torques, and with them the size of gears and bearings
TORQUE_SCALE = LENGTH_SCALE**4

STEEL_DENSITY = 7850.0  # kg/m^3


def kr16() -> ElasticRobot:
    """KUKA KR16-2, 1.6 m reach, with 16 kg.

    Kinematics, angle limits and speeds are the maker's. No dynamic parameter of this
    arm is public: bodies, drive trains and structure are those of the KR210 record,
    scaled by geometric similarity. The record is an example of a small arm, not a model
    of this one.

    The joint angles are KUKA's: zero is the stretched arm, A1 turns about -z, positive
    A2 and A3 lower the arm.
    """
    right = np.pi / 2
    # theta, d, a, alpha [rad, m]
    table = np.array(
        [
            [0.0, 0.675, 0.260, -right],
            [0.0, 0.0, 0.680, 0.0],
            [right, 0.0, 0.035, -right],
            [0.0, -0.670, 0.0, right],
            [0.0, 0.0, 0.0, -right],
            [np.pi, -0.158, 0.0, np.pi],
        ]
    )
    bodies = [_scaled(body) for body in link_bodies()]
    size = LENGTH_SCALE
    parts = arm_parts(
        table,
        bodies,
        bearing_stiffness=(
            TORQUE_SCALE * quantec.BEARING_STIFFNESS_1,
            TORQUE_SCALE * quantec.BEARING_STIFFNESS_3,
        ),
        link_arm=BeamSection.rectangular_tube(
            height=0.18 * size, width=0.30 * size, wall=0.012 * size
        ),
        forearm=BeamSection.circular_tube(diameter=0.22 * size, wall=0.010 * size),
        material=quantec.CAST_IRON,
        damping_time=quantec.STRUCTURE_DAMPING,
    )
    degrees = np.deg2rad
    limits = JointLimits(
        lower=degrees([-185.0, -155.0, -130.0, -350.0, -130.0, -350.0]),
        upper=degrees([185.0, 35.0, 154.0, 350.0, 130.0, 350.0]),
        velocity=degrees([156.0, 156.0, 156.0, 330.0, 330.0, 615.0]),
        acceleration=degrees([400.0] * 3 + [1200.0] * 3),
        jerk=degrees([4000.0] * 3 + [12000.0] * 3),
    )
    load = np.array([0.0, 0.0, 0.12])
    robot = assemble(
        "kr16",
        parts,
        _drives(),
        limits,
        axis_signs=[-1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        axis_zeros=np.zeros(6),
        poses={
            "stretched": np.zeros(6),
            "cannon": degrees([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]),
            "upright": degrees([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]),
        },
        tool=np.block(
            [[np.eye(3), load[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
        ),
        sources=("kinematics, angle limits, speeds: kuka_experimental, kr16_2",),
        assumptions=(
            "bodies, motors, gears, friction, bearings and sections: those of the "
            f"KR210 record by geometric similarity with the length scale s = {size:g} "
            "(the ratio of the reaches): masses s^3 (the moving ones are 188 kg of the "
            "235 kg of the data sheet), centres of mass s, inertias s^5, springs, "
            "dampers and friction of gears and bearings s^4 (equal wind-up under the "
            "arm's own weight), sections s; hence eigenfrequencies about 1/sqrt(s) = "
            "1.3 times those of the KR210 with its load in proportion (45 kg), more "
            "with 16 kg",
            "gear ratios: those of the KR210 record; motor inertias s^5",
            "no counterbalance",
            "payload: steel cube of 16 kg, 0.12 m in front of the flange",
            "acceleration and jerk limits: 400 deg/s^2 and 4000 deg/s^3 on axes 1 to "
            "3, 1200 deg/s^2 and 12000 deg/s^3 on axes 4 to 6",
            *quantec.ASSUMPTIONS[:1],
        ),
    )
    mass = 16.0
    edge = (mass / STEEL_DENSITY) ** (1 / 3)
    return robot.with_payload(mass, load, mass * edge**2 / 6 * np.eye(3))


def _scaled(body: Body) -> Body:
    """Similar body of the small arm."""
    return Body(
        body.name,
        MASS_SCALE * np.asarray(body.mass),
        LENGTH_SCALE * np.asarray(body.com),
        INERTIA_SCALE * np.asarray(body.inertia),
    )


def _drives() -> DriveTrain:
    friction = CoulombViscousFriction(
        TORQUE_SCALE * quantec.VISCOUS,
        TORQUE_SCALE * (quantec.COULOMB + quantec.COULOMB_FINE),
        np.full(6, 500.0),
    )
    return DriveTrain(
        ratio=quantec.RATIO,
        motor=Motor(INERTIA_SCALE * quantec.MOTOR_INERTIA),
        stiffness=LinearStiffness(TORQUE_SCALE * quantec.GEAR_STIFFNESS),
        damping=TORQUE_SCALE * quantec.GEAR_DAMPING,
        motor_friction=friction,
        joint_friction=quantec.no_friction(),
    )
