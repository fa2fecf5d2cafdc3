"""Forces and moments that pass through a joint of the chain."""

import jax.numpy as jnp

from .._custom_types import PerElastic, PerJoint, Vector3
from .._kernel import kernel
from .._taylor import leading
from ..kinematics import moving_frames
from ._modal_links import base_forces
from ._robot import ElasticRobot
from ._screws import body_terms, chain_motion, joint_screws, sum_behind, wrenches


def cut_forces(
    robot: ElasticRobot,
    joint: int,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    qdd: PerJoint,
    etadd: PerElastic,
) -> tuple[Vector3, Vector3]:
    """What the links in front of a joint exert on those behind it.

    In the axes of the frame behind the joint's motion, moments about its origin; the
    weight of what is behind is carried along.

    Args:
        robot: the robot.
        joint: index among the joints of the chain; `robot.axis_joint(k)` for axes.
        q, qd, qdd: joint angles and their derivatives, shape (axes,).
        eta, etad, etadd: elastic coordinates and theirs, shape (elastic,).

    Returns:
        Force [N] and moment [N m], shape (3,) each.

    References:
        [Reiner2010] (2.29), figure 3.17.
    """
    total = _wrenches(robot, q, eta, qd, etad, qdd, etadd)
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    rotation = leading(frames.rotation)[joint]
    position = leading(frames.position)[joint]
    force, moment = total[joint, :3], total[joint, 3:]
    moment = moment - jnp.cross(position, force)
    return rotation.T @ force, rotation.T @ moment


@kernel
def _wrenches(robot: ElasticRobot, q, eta, qd, etad, qdd, etadd):
    """Wrenches about the base origin that move what is behind every joint."""
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    screws = joint_screws(robot, frames)
    twist, acceleration = chain_motion(
        robot,
        screws,
        robot.joint_coordinates(qd, etad),
        robot.joint_coordinates(qdd, etadd),
    )
    rows = wrenches(robot, body_terms(robot, frames, twist), acceleration)
    if robot.modal_links:
        flexible = base_forces(robot, frames, twist, acceleration, eta, etad, etadd)
        rows = jnp.concatenate([rows, flexible.wrench])
    return sum_behind(robot, rows)
