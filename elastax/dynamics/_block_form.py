"""Equations of motion in the blocks of joints, structure and motors."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from ._forces import applied_forces
from ._newton_euler import forces_by_screws, multibody
from ._robot import ElasticRobot


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
) -> EquationsOfMotion:
    """Blocks of the equations of motion.

    Args:
        robot: the robot.
        q, qd: joint angles [rad] and velocities, shape (axes,).
        eta, etad: elastic coordinates and velocities, shape (elastic,).
        theta, thetad: motor angles and velocities on the output side, shape (axes,);
            without effect if the gears are rigid.

    References:
        [Reiner2010] (2.38). The gyroscopic coupling of the rotors is neglected there
        and here.
    """
    n = robot.axes
    mass, bias = multibody(robot, q, eta, qd, etad)
    joint, structure = applied_forces(robot, q, eta, qd, etad)
    inertia = robot.drives.reflected_inertia()
    h_a, h_e = bias[:n] + joint, bias[n:] + structure
    friction = robot.drives.motor_friction.torque
    if not robot.has_elastic_gears:
        empty = jnp.zeros((0,), q.dtype)
        return EquationsOfMotion(
            mass[:n, :n] + jnp.diag(inertia),
            mass[:n, n:],
            mass[n:, n:],
            h_a + friction(qd),
            h_e,
            empty,
            empty,
        )
    gear = robot.drives.gear_torque(q - theta, qd - thetad)
    return EquationsOfMotion(
        mass[:n, :n],
        mass[:n, n:],
        mass[n:, n:],
        h_a + gear,
        h_e,
        friction(thetad) - gear,
        inertia,
    )


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
) -> tuple[PerJoint, PerElastic, PerJoint]:
    r"""Accelerations of joints, structure and motors under the motor torque `tau_m`.

    The derivatives need no derivative of the mass matrix: where $a$ solves
    $r(x, a) = 0$, the inverse dynamics, $M\,\delta a = -\partial_x r\,\delta x$.

    Args:
        robot: the robot.
        q, eta, theta, qd, etad, thetad: as for `equations_of_motion`.
        tau_m: motor torques on the output side [N m], shape (axes,).

    Returns:
        qdd (axes,), etadd (elastic,), thetadd (axes,) [rad/s^2]; for rigid gears
        thetadd equals qdd.
    """
    state = (q, eta, theta, qd, etad, thetad)
    acceleration = _link_acceleration(robot, state, tau_m)
    qdd, etadd = acceleration[: robot.axes], acceleration[robot.axes :]
    if not robot.has_elastic_gears:
        return qdd, etadd, qdd
    gear = robot.drives.gear_torque(q - theta, qd - thetad)
    load = robot.drives.motor_friction.torque(thetad) - gear
    return qdd, etadd, (tau_m - load) / robot.drives.reflected_inertia()


@jax.custom_jvp
def _link_acceleration(robot: ElasticRobot, state, tau_m):
    eom = equations_of_motion(robot, *state)
    drive = jnp.zeros_like(tau_m) if robot.has_elastic_gears else tau_m
    force = jnp.concatenate([drive - eom.h_a, -eom.h_e])
    return _solve(_mass(eom), force)


@_link_acceleration.defjvp
def _link_acceleration_jvp(primals, tangents):
    robot, state, tau_m = primals
    acceleration = _link_acceleration(robot, state, tau_m)
    n = robot.axes

    def unbalanced(robot, state, tau_m):
        q, eta, theta, qd, etad, thetad = state
        links = (q, eta, qd, etad)
        total = forces_by_screws(robot, *links, acceleration[:n], acceleration[n:])
        joint, structure = applied_forces(robot, *links)
        if robot.has_elastic_gears:
            drive = -robot.drives.gear_torque(q - theta, qd - thetad)
        else:
            rotors = robot.drives.reflected_inertia() * acceleration[:n]
            drive = tau_m - rotors - robot.drives.motor_friction.torque(qd)
        return jnp.concatenate([joint - drive, structure]) + total

    _, missing = jax.jvp(unbalanced, primals, tangents)
    mass = _mass(equations_of_motion(robot, *state))
    return acceleration, -_solve(mass, missing)


def _mass(eom: EquationsOfMotion):
    return jnp.block([[eom.M_aa, eom.M_ae], [eom.M_ae.T, eom.M_ee]])


def _solve(mass, force):
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(mass), force)
