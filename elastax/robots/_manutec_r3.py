"""Manutec r3, the robot of the Modelica Standard Library."""

import numpy as np

from ..control import AnalogueCascade
from ..drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    LinearStiffness,
    Motor,
    StickSlipFriction,
)
from ..dynamics import (
    Axis,
    Body,
    ElasticRobot,
    JointLimits,
    Offset,
    Part,
    WristCentre,
    assemble,
)


RATIO = np.array([-105.0, 210.0, 60.0, -99.0, 79.2, -99.0])  # motor / output [-]
MOTOR_INERTIA = np.array([1.3e-3, 1.3e-3, 1.3e-3, 1.6e-4, 1.8e-4, 4.3e-5])  # kg m^2

# gears of axes 1 to 3, motor side
SPRING = np.array([43.0, 8.0, 58.0])  # N m/rad
DAMPER = np.array([0.005, 0.01, 0.04])  # N m s/rad

# friction R = Rv0 + Rv1 |speed|: axes 1 to 3 on the motor side of the gear, axes 4 to 6
# behind it
COULOMB = np.array([0.4, 0.5, 0.7, 21.8, 30.1, 10.9])  # Rv0 [N m]
VISCOUS = np.array(
    [0.13 / 160, 0.1 / 130, 0.2 / 130, 9.8, 0.03, 3.92]
)  # Rv1 [N m s/rad]
PEAK = np.array([1.0, 1.0, 1.0, 26.7 / 21.8, 39.6 / 30.1, 16.8 / 10.9])  # static [-]
# motors and their current loops
TORQUE_CONSTANT = np.array([1.1616, 1.1616, 1.1616, 0.2365, 0.2608, 0.0842])  # N m/A
CURRENT_FREQUENCY = np.array([4590.0, 5500.0, 5500.0, 6250.0, 6250.0, 7400.0])  # 1/s
CURRENT_DAMPING = np.array([0.6, 0.6, 0.6, 0.55, 0.55, 0.27])  # ratio [-]
STEEPNESS = 500.0  # assumed, at the output [s/rad]

# assumed for the gears of axes 4 to 6, which are rigid in the source: the motor against
# a locked link oscillates at this frequency, damped to this ratio
RIGID_FREQUENCY = 300.0  # Hz
RIGID_DAMPING_RATIO = 0.1

POINT_INERTIA = 1e-3  # kg m^2, principal moments that the source gives by default


def manutec_r3() -> ElasticRobot:
    """Manutec r3 with elastic gears on axes 1 to 3 and a load of 15 kg.

    The elastic-joint robot of the Modelica Standard Library, without structural
    elasticity. Its angles are those of the library; at zero the arm points upwards. The
    library's y axis is our z, its z our x and its x our y; bodies and load are given in
    the library's axes, and so is the frame of the flange.

    References:
        Modelica Standard Library 4.1.0, MultiBody.Examples.Systems.RobotR3: FullRobot,
        MechanicalStructure, GearType1, GearType2.
    """
    body = Body
    joints = [
        ("y", body("b1", 1.0, (0, 0, 0), _tensor(yy=1.16)), (0.0, 0.324, 0.3)),
        (
            "x",
            body("b2", 56.5, (0.172, 0.205, 0.0), _tensor(2.58, 0.64, 2.73, -0.46)),
            (0.0, 0.65, 0.0),
        ),
        (
            "x",
            body("b3", 26.4, (0.064, -0.034, 0), _tensor(0.279, 0.245, 0.413, -0.07)),
            (0.0, 0.414, -0.155),
        ),
        ("y", body("b4", 28.7, (0, 0, 0), _tensor(1.67, 0.081, 1.67)), (0, 0.186, 0)),
        ("x", body("b5", 5.2, (0, 0, 0), _tensor(1.25, 0.81, 1.53)), (0, 0.125, 0)),
        ("y", body("b6", 0.5, (0.05, 0.05, 0.05), _tensor()), (0.0, 0.0, 0.0)),
    ]
    # base z up: our axes in the library's
    parts: list[Part] = [Offset(rotation=_turn("y").T), Offset((0.0, 0.351, 0.0))]
    for k, (letter, link, to_next) in enumerate(joints):
        if k == 4:
            parts.append(WristCentre())
        parts += [
            Offset(rotation=_turn(letter)),
            Axis(f"A{k + 1}"),
            Offset(rotation=_turn(letter).T),
            link,
            Offset(to_next),
        ]
    degrees = np.deg2rad
    speed = np.array([3.0, 1.5, 5.0, 3.1, 3.1, 4.1])
    acceleration = np.array([15.0, 15.0, 15.0, 60.0, 60.0, 60.0])
    reach = degrees([170.0, 115.0, 160.0, 180.0, 120.0, 180.0])
    load = np.array([0.1, 0.25, 0.1])
    robot = assemble(
        "manutec_r3",
        parts,
        _drives(),
        JointLimits(-reach, reach, speed, acceleration, 20.0 * acceleration),
        axis_signs=np.ones(6),
        axis_zeros=np.zeros(6),
        poses={
            "upright": np.zeros(6),
            "start": degrees([-60.0, 20.0, 90.0, 0.0, -110.0, 0.0]),
            "end": degrees([60.0, -70.0, -35.0, 45.0, 110.0, 45.0]),
        },
        tool=np.block(
            [[np.eye(3), load[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
        ),
        sources=(
            "Modelica Standard Library 4.1.0 (BSD-3-Clause), "
            "MultiBody.Examples.Systems.RobotR3: kinematics, bodies, load, gears, "
            "friction, motor inertias, path, speeds and accelerations of the path as "
            "limits",
        ),
        assumptions=(
            f"gears of axes 4 to 6: rigid in the source; here as stiff as to let the "
            f"motor against a locked link oscillate at {RIGID_FREQUENCY:g} Hz, nine "
            f"times the fastest of axes 1 to 3 (34 Hz), damping ratio "
            f"{RIGID_DAMPING_RATIO:g}: the load winds them up by less than 5 urad; no "
            "stiffer, since explicit solvers would only take smaller steps",
            f"friction: Coulomb part smoothed, steepness {STEEPNESS:g} s/rad at the "
            "output; its static peak is left out",
            "load: a point mass by meaning; its principal moments, like those of b1 "
            "and b6 that are not given, are the source's default of 0.001 kg m^2",
            "rotors: no gyroscopic coupling, as in the source",
            "tool centre point: the centre of the load",
            "angle limits: +-170, 115, 160, 180, 120, 180 deg; jerk: 20 1/s times the "
            "acceleration",
        ),
    )
    return robot.with_payload(15.0, load, POINT_INERTIA * np.eye(3))


def manutec_r3_friction() -> StickSlipFriction:
    """Exact bearing friction of the Manutec r3 on the output side, for its plant.

    All of it acts at the motors: behind the gears of axes 4 to 6, which are rigid in
    the source, that is the same.

    References:
        Modelica Standard Library 4.1.0, RobotR3: GearType1, GearType2, FullRobot.
    """
    on_motor = np.arange(6) < 3
    size = np.where(on_motor, np.abs(RATIO), 1.0)
    return StickSlipFriction(size**2 * VISCOUS, size * COULOMB, PEAK)


def manutec_r3_plant() -> ElasticRobot:
    """The Manutec r3 with exact bearing friction, as a reference plant."""
    none = CoulombViscousFriction(np.zeros(6), np.zeros(6), np.ones(6))
    return manutec_r3().with_drives(
        motor_friction=manutec_r3_friction(), joint_friction=none
    )


def manutec_r3_control() -> AnalogueCascade:
    """Controllers and motor electronics of the Manutec r3.

    References:
        Modelica Standard Library 4.1.0, RobotR3.Utilities: Motor, Controller;
        parameters of FullRobot.
    """
    resistance, input_resistance = 250.0, 10.0  # ohm
    return AnalogueCascade(
        ratio=RATIO,
        position_gain=np.full(6, 5.0),
        speed_gain=np.full(6, 0.5),
        reset_time=np.full(6, 0.05),
        torque_constant=TORQUE_CONSTANT,
        resistance=resistance,
        inductance=resistance / (2 * CURRENT_DAMPING * CURRENT_FREQUENCY),
        integration=input_resistance * 0.004 * CURRENT_DAMPING / CURRENT_FREQUENCY,
        amplification=1 + 200.0 / 50.0,
    )


def _drives() -> DriveTrain:
    inertia = RATIO[3:] ** 2 * MOTOR_INERTIA[3:]
    omega = 2 * np.pi * RIGID_FREQUENCY
    on_motor = np.arange(6) < 3
    size = np.where(on_motor, np.abs(RATIO), 1.0)
    coulomb, viscous = size * COULOMB, size**2 * VISCOUS
    steepness = np.full(6, STEEPNESS)
    return DriveTrain(
        ratio=RATIO,
        motor=Motor(MOTOR_INERTIA, TORQUE_CONSTANT),
        stiffness=LinearStiffness(
            np.concatenate([RATIO[:3] ** 2 * SPRING, omega**2 * inertia])
        ),
        damping=np.concatenate(
            [RATIO[:3] ** 2 * DAMPER, 2 * RIGID_DAMPING_RATIO * omega * inertia]
        ),
        motor_friction=CoulombViscousFriction(
            np.where(on_motor, viscous, 0.0),
            np.where(on_motor, coulomb, 0.0),
            steepness,
        ),
        joint_friction=CoulombViscousFriction(
            np.where(on_motor, 0.0, viscous),
            np.where(on_motor, 0.0, coulomb),
            steepness,
        ),
    )


def _turn(letter: str) -> np.ndarray:
    """Rotation that lays z on an axis of the library, by exchange of axes."""
    steps = {"x": 1, "y": 2}[letter]
    return np.roll(np.eye(3), -steps, axis=1)


def _tensor(xx=POINT_INERTIA, yy=POINT_INERTIA, zz=POINT_INERTIA, xy=0.0) -> np.ndarray:
    """Inertia tensor from its elements [kg m^2]."""
    return np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])
