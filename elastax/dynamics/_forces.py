"""Forces that friction, counterbalance and structural springs add to the bodies'."""

import jax.numpy as jnp

from .._taylor import compose, concatenate
from ._robot import ElasticRobot


def applied_forces(robot: ElasticRobot, q, eta, qd, etad):
    """Forces of joint friction, counterbalance and structural springs, in h's sign.

    Args:
        robot: the robot.
        q, qd: joint angles [rad] and velocities, arrays or series.
        eta, etad: elastic coordinates and velocities.

    Returns:
        Forces of the joints (axes,) and of the structure (elastic,) [N m].
    """
    joint = compose(robot.drives.joint_friction.torque, qd)
    if robot.counterbalance is not None:
        axis, cylinder = robot.counterbalanced_axis, robot.counterbalance
        angle, speed = q[axis : axis + 1], qd[axis : axis + 1]
        # the rod's damping is linear in the speed: its torque at unit speed is a factor
        factor = compose(lambda a: cylinder.damping_torque(a, jnp.ones_like(a)), angle)
        support = compose(cylinder.torque, angle) + factor * speed
        joint = concatenate(
            [joint[:axis], joint[axis : axis + 1] - support, joint[axis + 1 :]]
        )
    if robot.structure_stiffness is None:
        return joint, etad
    structure = compose(robot.structure_stiffness.torque, eta)
    return joint, structure + etad * robot.structure_damping
