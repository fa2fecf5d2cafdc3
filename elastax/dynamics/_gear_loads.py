"""What the drive trains exchange with the links and ask of the motors."""

from .._custom_types import PerJoint
from ..drivetrain import AbstractSwitchingFriction, GearMemory
from ._robot import ElasticRobot


def gear_loads(
    robot: ElasticRobot,
    q: PerJoint,
    theta: PerJoint,
    qd: PerJoint,
    thetad: PerJoint,
    memory: GearMemory | None = None,
    mode: PerJoint | None = None,
) -> tuple[PerJoint, PerJoint]:
    """Torques of elastic gears and what they ask of the motors.

    Args:
        robot: the robot.
        q, qd: joint angles [rad] and velocities.
        theta, thetad: motor angles [rad] and velocities.
        memory: of the gears' branch, (states, axes).
        mode: direction of the motors' motion, +1 or -1, for parts that switch.

    Returns:
        Torque of the gears, that of springs, dampers and branches, and `h_m` with the
        friction of the motors [N m].

    References:
        [Reiner2010] (2.38).
    """
    drives = robot.drives
    angle, speed = drives.motion_behind_teeth(theta, thetad)
    gear = drives.gear_torque(q - angle, qd - speed, memory)
    return gear, drives.motor_load(gear, angle, thetad, mode)


def gear_memory_rates(
    robot: ElasticRobot,
    q: PerJoint,
    theta: PerJoint,
    qd: PerJoint,
    thetad: PerJoint,
    memory: GearMemory,
) -> GearMemory:
    """Rates of the memory of the gears' branch, (states, axes)."""
    angle, speed = robot.drives.motion_behind_teeth(theta, thetad)
    return robot.drives.memory_rates(q - angle, qd - speed, memory)


def resting_loads(
    robot: ElasticRobot, q: PerJoint, theta: PerJoint
) -> tuple[PerJoint, PerJoint]:
    """`gear_loads` at rest, of gears that were never loaded beyond this torsion."""
    angle = robot.drives.behind_teeth(theta)
    gear = robot.drives.resting_torque(q - angle)
    return gear, robot.drives.motor_load(gear, angle, 0.0 * theta)


def rigid_motor_load(robot: ElasticRobot, qd: PerJoint) -> PerJoint:
    """Friction of motors that move with the joints [N m].

    Raises:
        ValueError: the drive trains have a mesh or a transmission error, whose torques
            behind rigid gears would depend on the accelerations, or exact friction.
    """
    drives, friction = robot.drives, robot.drives.motor_friction
    if drives.mesh is not None or drives.transmission_error is not None:
        raise ValueError(
            "the dynamics of rigid gears know neither `mesh` nor `transmission_error`: "
            "take elastic gears, or drive trains without these parts"
        )
    if isinstance(friction, AbstractSwitchingFriction):
        raise ValueError(
            "the dynamics of rigid gears need smooth friction: exact friction sticks"
        )
    return friction.torque(qd)
