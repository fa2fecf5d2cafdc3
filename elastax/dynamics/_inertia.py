"""Refusal of robots whose mass matrix is singular."""

import numpy as np

from .._checks import is_concrete
from ..kinematics import JointKind
from ._robot import AxisRole, ElasticRobot, ElasticRole


def check_inertia(robot: ElasticRobot) -> None:
    """Refuse a robot whose mass matrix is singular.

    A hinge in line with an axis and no body between them moves nothing: the torque
    that accelerates it is undefined. Lump such a hinge into the gear.

    Raises:
        ValueError: the mass matrix at a pose without special geometry is singular; the
            message names the coordinates that move nothing.
    """
    if not is_concrete(robot.bodies.mass, robot.payload.mass, robot.chain.base):
        return
    mass = _mass_matrix(robot)
    names = (*robot.axis_names, *robot.elastic_names)
    still = [name for name, m in zip(names, np.diag(mass)) if not m > 0]
    if not still:
        scale = np.sqrt(np.diag(mass))
        values, vectors = np.linalg.eigh(mass / np.outer(scale, scale))
        if values[0] > 1e-9:
            return
        part = np.abs(vectors[:, 0])
        still = [name for name, p in zip(names, part) if p > 0.3 * part.max()]
    raise ValueError(
        f"the mass matrix of `{robot.name}` is singular: no inertia lies between or "
        f"behind the joints {', '.join(still)}. Lump a hinge that is in line with an "
        "axis into its gear, or attach a body"
    )


def _mass_matrix(robot: ElasticRobot) -> np.ndarray:
    """Mass matrix at a general pose from body Jacobians, in numpy: no compilation."""
    number = robot.axes + robot.elastic
    values = 0.3 + 0.17 * np.arange(number)
    slopes = np.asarray(robot.slopes)
    groups = (robot.bodies, robot.payload)
    frames = robot.chain.joints.frames()
    before, axis, after = map(np.asarray, (frames.before, frames.axis, frames.after))
    mass, com, inertia = (
        np.concatenate([np.asarray(getattr(bodies, name)) for bodies in groups])
        for name in ("mass", "com", "inertia")
    )
    carriers = np.array([joint for bodies in groups for joint in bodies.joint])
    pose, screws, weights, total = np.asarray(robot.chain.base), [], [], 0.0
    for joint, role in enumerate(robot.roles):
        match role:
            case AxisRole(index):
                column, factor = index, 1.0
            case ElasticRole(index):
                column, factor = robot.axes + index, 1.0
            case _:
                column, factor = robot.axes + role.index, slopes[role.slope]
        pose = pose @ before[joint]
        direction = pose[:3, :3] @ axis[joint]
        screws.append((pose[:3, 3], direction, robot.chain.kinds[joint]))
        weights.append((column, factor))
        pose = pose @ _motion(robot.chain.kinds[joint], axis[joint], values[column])
        for k in np.flatnonzero(carriers == joint):
            centre = pose[:3, :3] @ com[k] + pose[:3, 3]
            linear, angular = np.zeros((3, number)), np.zeros((3, number))
            for (point, z, kind), (c, f) in zip(screws, weights):
                rotary = kind is JointKind.REVOLUTE
                linear[:, c] += f * (np.cross(z, centre - point) if rotary else z)
                angular[:, c] += f * z * rotary
            tensor = pose[:3, :3] @ inertia[k] @ pose[:3, :3].T
            total = total + mass[k] * linear.T @ linear
            total = total + angular.T @ tensor @ angular
        pose = pose @ after[joint]
    return total + np.zeros((number, number))


def _motion(kind: JointKind, axis: np.ndarray, value: float) -> np.ndarray:
    pose = np.eye(4)
    if kind is JointKind.PRISMATIC:
        pose[:3, 3] = value * axis
        return pose
    x, y, z = axis
    a = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose[:3, :3] += np.sin(value) * a + (1 - np.cos(value)) * a @ a
    return pose
