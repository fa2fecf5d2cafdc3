"""Lagrange's equations of the second kind, from the energies by differentiation."""

import jax
import jax.numpy as jnp

from .._custom_types import PerElastic, PerJoint
from ..drivetrain import GearMemory
from ._energy import gear_energy, kinetic_energy, potential_energy
from ._gear_loads import gear_loads, rigid_motor_load
from ._robot import ElasticRobot


def lagrange_forces(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    theta: PerJoint,
    qd: PerJoint,
    etad: PerElastic,
    thetad: PerJoint,
    qdd: PerJoint,
    etadd: PerElastic,
    thetadd: PerJoint,
    memory: GearMemory | None = None,
) -> tuple[PerJoint, PerElastic, PerJoint]:
    r"""Generalised forces that a motion needs, by Lagrange's equations.

    $\frac{d}{dt}\frac{\partial L}{\partial \dot x} - \frac{\partial L}{\partial x} -
    f_{diss}$ with $x = (q, \eta, \theta)$: the left-hand side of
    $M a + h = (0, 0, \tau_m)$. Slow and readable: the definition.

    Args:
        robot: the robot.
        q, eta, theta, qd, etad, thetad, qdd, etadd, thetadd: the motion; for rigid
            gears the motors follow the joints and the last force is zero.
        memory: of the gears' branch, shape (states, axes); only where they have one.

    Returns:
        Forces of joints, structure and motors [N m].

    References:
        [Reiner2010] (2.36), (2.37), with friction also at the driven joints.
    """
    x, xd, xdd = (q, eta, theta), (qd, etad, thetad), (qdd, etadd, thetadd)

    def lagrangian(x, xd):
        kinetic = kinetic_energy(robot, x[0], x[1], *xd)
        return kinetic - potential_energy(robot, *x)

    def momentum(x, xd):
        return jax.grad(lagrangian, argnums=1)(x, xd)

    _, rate = jax.jvp(momentum, (x, xd), (xd, xdd))
    force = jax.grad(lagrangian, argnums=0)(x, xd)
    drives = robot.drives
    lost_q = drives.joint_friction.torque(qd)
    if robot.counterbalance is not None:
        k = robot.counterbalanced_axis
        lost_q = lost_q.at[k].add(-robot.counterbalance.damping_torque(q[k], qd[k]))
    lost_eta = robot.structure_damping * etad
    if robot.has_elastic_gears:
        # the springs are in the potential, the rest of the drive trains is not
        gear, h_m = gear_loads(robot, q, theta, qd, thetad, memory)
        stored = jax.grad(lambda x: gear_energy(robot, *x), argnums=0)((q, theta))
        lost_q = lost_q + gear - stored[0]
        lost_theta = h_m - stored[1]
    else:
        lost_q = lost_q + rigid_motor_load(robot, qd)
        lost_theta = jnp.zeros_like(qd)
    lost = (lost_q, lost_eta, lost_theta)
    return jax.tree.map(lambda r, f, d: r - f + d, rate, force, lost)
