"""Energies of the elastic robot: what everything else must agree with."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerElastic, PerJoint, Scalar
from .._taylor import leading
from ..drivetrain import GearMemory
from ..kinematics import moving_frames
from ._gear_loads import gear_loads, rigid_motor_load
from ._modal_links import modal_energy, modal_weight
from ._robot import ElasticRobot


def body_poses(
    robot: ElasticRobot, q: PerJoint, eta: PerElastic
) -> tuple[Float[Array, "bodies 3 3"], Float[Array, "bodies 3"]]:
    """Orientations and centres of mass [m] of all bodies in the base frame."""
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    bodies = robot.all_bodies()
    index = np.array(bodies.joint, int)
    rotation = leading(frames.rotation)[index]
    com = leading(frames.position)[index] + jnp.einsum(
        "kab,kb->ka", rotation, bodies.com
    )
    return rotation, com


def link_frames(robot: ElasticRobot, q: PerJoint, eta: PerElastic):
    """Orientations and origins [m] of all links in the base frame."""
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    return leading(frames.rotation), leading(frames.position)


def kinetic_energy(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    thetad: PerJoint,
) -> Scalar:
    r"""Kinetic energy [J] of bodies and rotors.

    $T = \tfrac12\sum_i (m_i \dot r_i^T \dot r_i + \omega_i^T \Theta_i \omega_i) +
    \tfrac12 \dot\theta^T \Theta \dot\theta$ with velocities by differentiation of the
    positions and $\tilde\omega = R^T \dot R$; flexible bodies add
    $\tfrac12 z^T M z$ with their own velocities. A robot with rigid gears takes
    `thetad` = `qd`.

    References:
        [Reiner2010] (2.28), (2.33); the rotors turn about their own axes only.
    """
    (rotation, _), (turning, velocity) = jax.jvp(
        lambda a, b: body_poses(robot, a, b), (q, eta), (qd, etad)
    )
    bodies = robot.all_bodies()
    cross_matrix = jnp.einsum("kba,kbc->kac", rotation, turning)
    omega = 0.5 * jnp.stack(
        [
            cross_matrix[:, 2, 1] - cross_matrix[:, 1, 2],
            cross_matrix[:, 0, 2] - cross_matrix[:, 2, 0],
            cross_matrix[:, 1, 0] - cross_matrix[:, 0, 1],
        ],
        axis=1,
    )
    if not robot.has_elastic_gears:
        thetad = qd
    flexible = jnp.zeros((), qd.dtype)
    if robot.modal_links:
        (rotation, position), (turning, velocity_R) = jax.jvp(
            lambda a, b: link_frames(robot, a, b), (q, eta), (qd, etad)
        )
        flexible = modal_energy(
            robot, rotation, position, turning, velocity_R, eta, etad
        )
    return flexible + 0.5 * (
        jnp.sum(bodies.mass * jnp.sum(velocity**2, axis=1))
        + jnp.einsum("ka,kab,kb->", omega, bodies.inertia, omega)
        + jnp.sum(robot.drives.reflected_inertia() * thetad**2)
    )


def potential_energy(
    robot: ElasticRobot, q: PerJoint, eta: PerElastic, theta: PerJoint
) -> Scalar:
    r"""Potential energy [J] of gravity, gears, structure and counterbalance.

    References:
        [Reiner2010] (2.34) with $V = -m g^T r$ for a gravity vector that points down,
        (2.35), (3.80b).
    """
    _, com = body_poses(robot, q, eta)
    energy = -jnp.sum(robot.all_bodies().mass * (com @ robot.gravity))
    if robot.modal_links:
        energy = energy + modal_weight(robot, *link_frames(robot, q, eta), eta)
    if robot.has_elastic_gears:
        energy = energy + gear_energy(robot, q, theta)
    if robot.structure_stiffness is not None:
        energy = energy + jnp.sum(robot.structure_stiffness.potential(eta))
    if robot.counterbalance is not None:
        energy = energy + robot.counterbalance.potential(q[robot.counterbalanced_axis])
    return energy


def gear_energy(robot: ElasticRobot, q: PerJoint, theta: PerJoint) -> Scalar:
    """Energy [J] in the springs of elastic gears; what branches store is left out."""
    drives = robot.drives
    if drives.stiffness is None:
        return jnp.zeros((), q.dtype)
    return jnp.sum(drives.stiffness.potential(q - drives.behind_teeth(theta)))


def dissipated_power(
    robot: ElasticRobot,
    q: PerJoint,
    theta: PerJoint,
    qd: PerJoint,
    etad: PerElastic,
    thetad: PerJoint,
    memory: GearMemory | None = None,
) -> Scalar:
    """Power [W] lost in friction, gears, structure and the counterbalance's rod.

    Args:
        robot: the robot.
        q, theta: joint and motor angles [rad], shape (axes,).
        qd, etad, thetad: velocities of joints, structure and motors.
        memory: of the gears' branch, shape (states, axes); only where they have one.
            What flows into a branch counts as lost, also what it will give back.
    """
    drives = robot.drives
    rod = jnp.zeros((), qd.dtype)
    if robot.counterbalance is not None:
        k = robot.counterbalanced_axis
        rod = -robot.counterbalance.damping_torque(q[k], qd[k]) * qd[k]
    lost = rod + jnp.sum(robot.structure_damping * etad**2)
    lost = lost + jnp.sum(drives.joint_friction.torque(qd) * qd)
    if not robot.has_elastic_gears:
        return lost + jnp.sum(rigid_motor_load(robot, qd) * qd)
    gear, h_m = gear_loads(robot, q, theta, qd, thetad, memory)
    energy = lambda q, theta: gear_energy(robot, q, theta)
    _, stored = jax.jvp(energy, (q, theta), (qd, thetad))
    return lost + jnp.sum(gear * qd) + jnp.sum(h_m * thetad) - stored
