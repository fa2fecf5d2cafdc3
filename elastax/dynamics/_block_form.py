"""Equations of motion in the blocks of joints, structure and motors."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from ..drivetrain import GearMemory
from ._forces import applied_forces
from ._gear_loads import gear_loads, rigid_motor_load
from ._linearised import body_accelerations
from ._robot import ElasticRobot
from ._screws import multibody


class EquationsOfMotion(eqx.Module):
    r"""Blocks of $M a + h = (0, 0, \tau_m)$; springs, dampers, friction are inside h.

    For a robot with rigid gears the motors move with the joints: `Theta` is part of
    `M_aa`, the motor friction part of `h_a`, and the motor torque acts on the joints.

    Attributes:
        M_aa, M_ae, M_ee: mass matrix of joints and structure [kg m^2].
        h_a, h_e: forces of joints and structure [N m].
        h_m: forces of the motors [N m], empty for rigid gears.
        Theta: motor inertias on the output side [kg m^2], empty for rigid gears.

    References:
        [Reiner2010] (2.38), (3.74).
    """

    M_aa: Float[Array, "axes axes"]
    M_ae: Float[Array, "axes elastic"]
    M_ee: Float[Array, "elastic elastic"]
    h_a: Float[Array, " axes"]
    h_e: Float[Array, " elastic"]
    h_m: Float[Array, " motors"]
    Theta: Float[Array, " motors"]


@kernel
def equations_of_motion(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    theta: PerJoint,
    qd: PerJoint,
    etad: PerElastic,
    thetad: PerJoint,
    memory: GearMemory | None = None,
) -> EquationsOfMotion:
    """Blocks of the equations of motion.

    Args:
        robot: the robot.
        q, qd: joint angles [rad] and velocities, shape (axes,).
        eta, etad: elastic coordinates and velocities, shape (elastic,).
        theta, thetad: motor angles and velocities on the output side, shape (axes,);
            without effect if the gears are rigid.
        memory: of the gears' branch, shape (states, axes); only where they have one.

    Raises:
        ValueError: rigid gears with a mesh or a transmission error, or gears with a
            branch without its memory.

    References:
        [Reiner2010] (2.38). The gyroscopic coupling of the rotors is neglected there
        and here.
    """
    n = robot.axes
    mass, bias = multibody(robot, q, eta, qd, etad)
    joint, structure = applied_forces(robot, q, eta, qd, etad)
    inertia = robot.drives.reflected_inertia()
    h_a, h_e = bias[:n] + joint, bias[n:] + structure
    if not robot.has_elastic_gears:
        empty = jnp.zeros((0,), q.dtype)
        return EquationsOfMotion(
            mass[:n, :n] + jnp.diag(inertia),
            mass[:n, n:],
            mass[n:, n:],
            h_a + rigid_motor_load(robot, qd),
            h_e,
            empty,
            empty,
        )
    gear, h_m = gear_loads(robot, q, theta, qd, thetad, memory)
    return EquationsOfMotion(
        mass[:n, :n],
        mass[:n, n:],
        mass[n:, n:],
        h_a + gear,
        h_e,
        h_m,
        inertia,
    )


@kernel
def _loads(robot: ElasticRobot, q, eta, theta, qd, etad, thetad, tau_m, memory, mode):
    """Forces on joints and structure besides those of the bodies, on the motors."""
    joint, structure = applied_forces(robot, q, eta, qd, etad)
    if not robot.has_elastic_gears:
        driven = tau_m - rigid_motor_load(robot, qd) - joint
        return jnp.concatenate([driven, -structure]), tau_m
    gear, h_m = gear_loads(robot, q, theta, qd, thetad, memory, mode)
    motor = tau_m - h_m
    if mode is not None:
        motor = jnp.where(mode == 0.0, 0.0, motor)
    return jnp.concatenate([-joint - gear, -structure]), motor


@kernel
def forward_dynamics(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    theta: PerJoint,
    qd: PerJoint,
    etad: PerElastic,
    thetad: PerJoint,
    tau_m: PerJoint,
    memory: GearMemory | None = None,
    mode: PerJoint | None = None,
) -> tuple[PerJoint, PerElastic, PerJoint]:
    """Accelerations of joints, structure and motors under the motor torque `tau_m`.

    Args:
        robot: the robot.
        q, eta, theta, qd, etad, thetad, memory: as for `equations_of_motion`.
        tau_m: motor torques on the output side [N m], shape (axes,).
        mode: for drive trains that switch, +1 or -1 where the motor moves in that
            direction, 0 where it sticks, whatever torque acts; shape (axes,).

    Returns:
        qdd (axes,), etadd (elastic,), thetadd (axes,) [rad/s^2]; for rigid gears
        thetadd equals qdd.
    """
    state = q, eta, theta, qd, etad, thetad
    force, motor = _loads(robot, *state, tau_m, memory, mode)
    rotors = None if robot.has_elastic_gears else robot.drives.reflected_inertia()
    acceleration = body_accelerations(robot, q, eta, qd, etad, force, rotors)
    qdd, etadd = acceleration[: robot.axes], acceleration[robot.axes :]
    if not robot.has_elastic_gears:
        return qdd, etadd, qdd
    return qdd, etadd, motor / robot.drives.reflected_inertia()
