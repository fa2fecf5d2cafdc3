"""Motion of the tool and of the wrist centre."""

import jax.numpy as jnp

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from .._taylor import leading
from ..kinematics import moving_frames, transform
from ._robot import ElasticRobot
from ._screws import chain_motion, joint_screws


@kernel
def tool_state(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    qdd: PerJoint,
    etadd: PerElastic,
):
    """Pose, velocity, acceleration of the tool and acceleration of the wrist centre.

    Returns:
        Pose (4, 4) [m], velocity (6,) and acceleration (6,) of the tool in the base
        frame, acceleration of the wrist centre (3,) [m/s^2]; without gravity.
    """
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    twist, spatial = chain_motion(
        robot,
        joint_screws(robot, frames),
        robot.joint_coordinates(qd, etad),
        robot.joint_coordinates(qdd, etadd),
    )

    def at(point, joint):
        v, w = twist[joint, :3], twist[joint, 3:]
        a, alpha = spatial[joint, :3] + robot.gravity, spatial[joint, 3:]
        velocity = v + jnp.cross(w, point)
        acceleration = a + jnp.cross(alpha, point) + jnp.cross(w, velocity)
        return jnp.concatenate([velocity, w]), jnp.concatenate([acceleration, alpha])

    velocity, acceleration = at(frames.tool_position, robot.chain.number - 1)
    _, wrist = at(frames.position[robot.wrist], robot.wrist)
    pose = transform(leading(frames.tool_rotation), leading(frames.tool_position))
    return pose, velocity, acceleration, wrist[:3]
