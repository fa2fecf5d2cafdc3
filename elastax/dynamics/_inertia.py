"""Refusal of robots whose mass matrix is singular."""

import numpy as np

from .._checks import is_concrete
from ..kinematics import JointKind
from ..structure import ModalBody
from ._robot import (
    AxisRole,
    ElasticRobot,
    ElasticRole,
    JointRole,
    NodeRole,
    SlopeRole,
)


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
    pose, moving, total = np.asarray(robot.chain.base), [], np.zeros((number, number))
    for joint, role in enumerate(robot.roles):
        factors = _factors(role, robot.axes, slopes)
        pose = pose @ before[joint]
        direction = pose[:3, :3] @ axis[joint]
        kind = robot.chain.kinds[joint]
        moving.append((pose[:3, 3], direction, kind, factors))
        value = sum(values[column] for column in factors)
        pose = pose @ _motion(kind, axis[joint], value)
        R = pose[:3, :3]
        for k in np.flatnonzero(carriers == joint):
            linear, angular = _velocities(moving, R @ com[k] + pose[:3, 3], number)
            tensor = R @ inertia[k] @ R.T
            total += mass[k] * linear.T @ linear + angular.T @ tensor @ angular
        for link in robot.modal_links:
            if link.joint == joint:
                linear, angular = _velocities(moving, pose[:3, 3], number)
                modes = np.eye(number)[robot.axes + link.first :][: link.body.modes]
                whole = np.concatenate([R.T @ linear, R.T @ angular, modes])
                total += whole.T @ _body_mass(link.body) @ whole
        pose = pose @ after[joint]
    return total


def _factors(role: JointRole, axes: int, slopes: np.ndarray) -> dict[int, float]:
    """Coordinates that move a joint, and by how much."""
    match role:
        case AxisRole(index):
            return {index: 1.0}
        case ElasticRole(index):
            return {axes + index: 1.0}
        case SlopeRole(index, slope):
            return {axes + index: float(slopes[slope])}
        case NodeRole(indices, weights):
            return {
                axes + index: float(slopes[weight])
                for index, weight in zip(indices, weights)
            }


def _velocities(moving, point: np.ndarray, number: int):
    """Velocity of a point and rotation by unit speeds, shape (3, coordinates) each."""
    linear, angular = np.zeros((3, number)), np.zeros((3, number))
    for origin, z, kind, factors in moving:
        rotary = kind is JointKind.REVOLUTE
        for column, factor in factors.items():
            linear[:, column] += factor * (np.cross(z, point - origin) if rotary else z)
            angular[:, column] += factor * z * rotary
    return linear, angular


def _body_mass(body: ModalBody) -> np.ndarray:
    """Mass matrix of an undeformed flexible body, whatever its equations leave out."""
    x, y, z = np.asarray(body.first_moment)
    moment = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    C_t, C_r = np.asarray(body.C_t0), np.asarray(body.C_r0)
    return np.block(
        [
            [float(body.mass) * np.eye(3), -moment, C_t.T],
            [moment, np.asarray(body.J_0), C_r.T],
            [C_t, C_r, np.asarray(body.M_e)],
        ]
    )


def _motion(kind: JointKind, axis: np.ndarray, value: float) -> np.ndarray:
    pose = np.eye(4)
    if kind is JointKind.PRISMATIC:
        pose[:3, 3] = value * axis
        return pose
    x, y, z = axis
    a = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose[:3, :3] += np.sin(value) * a + (1 - np.cos(value)) * a @ a
    return pose
