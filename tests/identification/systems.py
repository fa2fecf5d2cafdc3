"""A small robot and a recording that obeys its model exactly."""

import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    LinearStiffness,
    Motor,
)
from elastax.dynamics import Axis, Body, JointLimits, Offset, assemble
from elastax.identification import Recording


TIMES = np.arange(1001) * 4e-3
SIGNS = np.array([-1.0, 1.0])
ZEROS = np.array([0.1, -0.3])
RATIO = np.array([100.0, 80.0])


def arm():
    """Vertical arm of two axes with elastic gears; the first counts backwards."""
    down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    none = CoulombViscousFriction(np.zeros(2), np.zeros(2), np.ones(2))
    tensor = np.diag([0.1, 0.5, 0.5])
    ones = np.ones(2)
    robot = assemble(
        "arm",
        [
            Offset(rotation=down),
            Axis("A1"),
            Body("upper", 20.0, (0.4, 0.0, 0.0), tensor),
            Offset((0.8, 0.0, 0.0)),
            Axis("A2"),
            Body("lower", 10.0, (0.3, 0.0, 0.0), tensor),
            Offset((0.6, 0.0, 0.0)),
        ],
        DriveTrain(
            ratio=RATIO,
            motor=Motor(np.array([1e-3, 5e-4])),
            stiffness=LinearStiffness(np.array([2e5, 1e5])),
            damping=np.array([200.0, 100.0]),
            motor_friction=none,
            joint_friction=none,
        ),
        JointLimits(-3.0 * ones, 3.0 * ones, 2.0 * ones, 9.0 * ones, 90.0 * ones),
        axis_signs=SIGNS,
        axis_zeros=ZEROS,
        poses={"zero": np.zeros(2)},
    )
    return robot.with_payload(5.0, np.zeros(3), 0.05 * np.eye(3))


def motion(order=4):
    """Maker's angles and derivatives: two sines that start at rest."""
    rate = np.array([2.0, 3.1])
    size = np.array([0.3, 0.2])
    phase = rate * TIMES[:, None]
    rows = [size * (1.0 - np.cos(phase))]
    for k in range(1, order + 1):
        rows.append(-size * rate**k * np.cos(phase + 0.5 * np.pi * k))
    return (
        np.stack(rows)
        + np.array([0.2, -0.1]) * (np.arange(order + 1) == 0)[:, None, None]
    )


def recording(torque, windup=None, *, delay=0.003, order=4, name="synthetic", **other):
    """Recording of exact motor torques, optionally with link-side encoders."""
    reference = motion(order)
    angle, speed = motion()[:2]
    if windup is None:
        link, encoders = np.zeros((len(TIMES), 0)), ()
    else:
        link, encoders = angle + windup - delay * speed - 0.01, (0, 1)
    return Recording(
        times=TIMES,
        reference=reference,
        motor_angle=angle,
        motor_speed=speed,
        motor_torque=jnp.asarray(torque),
        link_angle=link,
        stored_torque=other.get("stored"),
        encoders=encoders,
        name=name,
    )
