"""Robots of elastax as models of Pinocchio, and its batched algorithms."""

from collections.abc import Callable

import jax
import numpy as np
import pinocchio as pin
from elastax.dynamics import ElasticRobot, SlopeRole
from elastax.kinematics import JointKind, SerialChain


TOOL = "tool"


def chain_model(chain: SerialChain, keep: tuple[int, ...] | None = None) -> pin.Model:
    """Kinematic tree of a chain, without bodies; the tool is the frame `TOOL`.

    Args:
        chain: the chain.
        keep: joints that move; the others are welded at zero. All unless given.
    """
    model, _ = _tree(chain, keep)
    return model


def robot_model(robot: ElasticRobot, *, weld_end_slopes: bool = False) -> pin.Model:
    """Tree of the robot's joints with its bodies and gravity.

    Springs, friction, counterbalance and motors are left out.

    Args:
        robot: the robot.
        weld_end_slopes: whether the joints at the ends of bending links, which follow
            an elastic coordinate, are welded; their factors must be zero then.

    Raises:
        ValueError: an end slope that is to be welded is not zero.
    """
    keep = None
    if weld_end_slopes:
        if np.any(np.asarray(robot.slopes) != 0):
            raise ValueError(
                "`weld_end_slopes` needs end-slope factors of zero, but they are "
                f"{robot.slopes}"
            )
        keep = independent_joints(robot)
    model, carriers = _tree(robot.chain, keep)
    model.gravity.linear = np.asarray(robot.gravity)
    bodies = jax.device_get(robot.all_bodies())
    for k, joint in enumerate(bodies.joint):
        parent, pose = carriers[joint]
        inertia = pin.Inertia(bodies.mass[k], bodies.com[k], bodies.inertia[k])
        model.appendBodyToJoint(parent, inertia, pose)
    return model


def independent_joints(robot: ElasticRobot) -> tuple[int, ...]:
    """Joints of the chain that do not follow another coordinate."""
    return tuple(k for k, r in enumerate(robot.roles) if not isinstance(r, SlopeRole))


def coupling(robot: ElasticRobot, *, weld_end_slopes: bool = False) -> np.ndarray:
    """Matrix from the coordinates (q, eta) to the coordinates of the model."""
    matrix = np.asarray(robot.coupling())
    return matrix[list(independent_joints(robot))] if weld_end_slopes else matrix


def _tree(chain: SerialChain, keep) -> tuple[pin.Model, list]:
    """Model, and for each joint of the chain its carrier and its frame in that."""
    frames = jax.device_get(chain.joints.frames())
    model, parent, carriers = pin.Model(), 0, []
    pose = pin.SE3(np.asarray(chain.base))
    for k, kind in enumerate(chain.kinds):
        pose = pose * pin.SE3(np.asarray(frames.before[k]))
        if keep is None or k in keep:
            joints = {
                JointKind.REVOLUTE: pin.JointModelRevoluteUnaligned,
                JointKind.PRISMATIC: pin.JointModelPrismaticUnaligned,
            }
            joint = joints[kind](np.asarray(frames.axis[k]))
            parent = model.addJoint(parent, joint, pose, f"joint {k}")
            pose = pin.SE3.Identity()
        carriers.append((parent, pose.copy()))
        pose = pose * pin.SE3(np.asarray(frames.after[k]))
    tool = pose * pin.SE3(np.asarray(chain.tool))
    model.addFrame(pin.Frame(TOOL, parent, tool, pin.FrameType.OP_FRAME))
    return model, carriers


def batched(
    function: Callable, model: pin.Model, threads: int, *columns
) -> tuple[Callable[[], None], np.ndarray]:
    """A batched algorithm ready to be timed, and the array that it fills.

    Args:
        function: `pin.rneaInParallel` or `pin.abaInParallel`.
        model: of the robot.
        threads: that it may use.
        columns: inputs, one sample per row.
    """
    pool = pin.ModelPool(model, threads)
    inputs = [np.asfortranarray(np.asarray(x).T) for x in columns]
    result = np.zeros_like(inputs[-1])
    return lambda: function(threads, pool, *inputs, result), result


def mass_matrix(model: pin.Model, data: pin.Data, x: np.ndarray) -> np.ndarray:
    """Full mass matrix by the composite-rigid-body algorithm."""
    upper = np.triu(pin.crba(model, data, x))
    return upper + np.triu(upper, 1).T


def tool_pose(model: pin.Model, data: pin.Data, x: np.ndarray) -> np.ndarray:
    """Pose of the tool, (4, 4)."""
    pin.framesForwardKinematics(model, data, x)
    return data.oMf[model.getFrameId(TOOL)].homogeneous.copy()


def tool_jacobian(model: pin.Model, data: pin.Data, x: np.ndarray) -> np.ndarray:
    """Geometric Jacobian of the tool in the base frame, translation above rotation."""
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return pin.computeFrameJacobian(model, data, x, model.getFrameId(TOOL), world)


def frame_pose(model: pin.Model, data: pin.Data, frame: int, q, qd) -> np.ndarray:
    """Pose of a frame, (4, 4)."""
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[frame].homogeneous.copy()


def frame_jacobian(model: pin.Model, data: pin.Data, frame: int, q, qd) -> np.ndarray:
    """Geometric Jacobian of a frame in the base frame, translation above rotation."""
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return pin.computeFrameJacobian(model, data, q, frame, world).copy()


def frame_jacobian_rate(
    model: pin.Model, data: pin.Data, frame: int, q, qd
) -> np.ndarray:
    """Time derivative of that Jacobian at the joint speeds qd."""
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    pin.computeJointJacobiansTimeVariation(model, data, q, qd)
    pin.updateFramePlacements(model, data)
    return pin.getFrameJacobianTimeVariation(model, data, frame, world).copy()
