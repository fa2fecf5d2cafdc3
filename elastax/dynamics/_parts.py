"""Parts of a robot, listed from base to flange, and their assembly."""

import dataclasses

import numpy as np

from .._custom_types import as_real
from ..drivetrain import AbstractCounterbalance, DriveTrain
from ..kinematics import SAME, JointKind, Placement, SerialChain, structured
from ..structure import CubicStiffness, LinearStiffness, ModalBody
from ._bodies import RigidBodies, no_bodies
from ._inertia import check_inertia
from ._modal_links import ModalLink
from ._mounting import base_motion, mounted_body, node_motion
from ._robot import (
    AxisRole,
    ElasticRobot,
    ElasticRole,
    JointLimits,
    JointRole,
    NodeRole,
    SlopeRole,
)


@dataclasses.dataclass(frozen=True)
class Offset:
    """Constant transform to the following part.

    Attributes:
        position: [m], shape (3,). Without one the parts lie in one place for good; a
            position of zeros is a parameter of the assembled robot.
        rotation: shape (3, 3); identity unless given. Right angles are structure,
            anything else is a parameter of the assembled robot.
    """

    position: object = None
    rotation: object = None


@dataclasses.dataclass(frozen=True)
class Axis:
    """Driven axis along z of the current frame, with its drive train elsewhere."""

    name: str
    kind: JointKind = JointKind.REVOLUTE


@dataclasses.dataclass(frozen=True)
class ElasticJoint:
    """Hinge with spring and damper: a tilt joint or the hinge of a beam.

    Attributes:
        name: of the elastic coordinate.
        axis: unit vector in the current frame.
        stiffness: spring constant [N m/rad].
        damping: damper constant [N m s/rad].
        hardening: gamma of (2.7) [1/rad^2].

    References:
        [Reiner2010] sections 2.4.1 and 2.4.3.
    """

    name: str
    axis: tuple[float, float, float]
    stiffness: object
    damping: object
    hardening: object = 0.0


@dataclasses.dataclass(frozen=True)
class EndSlope:
    """Joint at the end of a beam that follows one of its hinges, about the same axis.

    Attributes:
        of: name of the elastic coordinate.
        factor: angle of this joint over the angle of the hinge (1/2 under a tip force).

    References:
        [Reiner2010] section 2.4.3, second variant.
    """

    of: str
    factor: object


@dataclasses.dataclass(frozen=True)
class Body:
    """Rigid body in the current frame.

    Attributes:
        name: for messages.
        mass: [kg].
        com: centre of mass [m].
        inertia: about the centre of mass, shape (3, 3) [kg m^2].
    """

    name: str
    mass: object
    com: object
    inertia: object


@dataclasses.dataclass(frozen=True)
class FlexibleLink:
    """Flexible body whose reference frame is the current frame, up to one of its nodes.

    What follows stands in the frame of that node and moves with it.

    Attributes:
        name: of the link; its modes are elastic coordinates of the names
            `name: mode`.
        body: in modes with diagonal stiffness and damping, which do not move the
            origin of the reference frame.
        node: name of the node at which the following part is attached; `None` for a
            body that ends the chain.
        base: name of the node that lies in the origin of the current frame; unless
            given, that is the origin of the body's own reference frame.
        floating: whether the modes may move the node `base`, as those of supported or
            free beams do. The reference frame then moves against the current frame.

    References:
        [Reiner2010] sections 2.4.2 and 3.7.
    """

    name: str
    body: ModalBody
    node: str | None = None
    base: str | None = None
    floating: bool = False


@dataclasses.dataclass(frozen=True)
class WristCentre:
    """Marks the next axis as the one whose origin is the wrist centre."""


Part = Offset | Axis | ElasticJoint | EndSlope | Body | FlexibleLink | WristCentre


def assemble(
    name: str,
    parts: list[Part],
    drives: DriveTrain,
    limits: JointLimits,
    *,
    axis_signs,
    axis_zeros,
    poses,
    counterbalance: AbstractCounterbalance | None = None,
    counterbalanced_axis: int = 1,
    gravity=(0.0, 0.0, -9.81),
    tool=None,
    sources: tuple[str, ...] = (),
    assumptions: tuple[str, ...] = (),
) -> ElasticRobot:
    """Elastic robot from its parts, listed from the base to the flange.

    Frames are carried along: each part stands in the frame that the parts in front of
    it have led to. Bodies belong to the joint in front of them. The parts hold numbers;
    to differentiate by a parameter, replace the leaf of the assembled robot.

    Args:
        name: of the robot.
        parts: the parts in their order.
        drives: one drive train per axis.
        limits: of the axes, in the maker's angles.
        axis_signs, axis_zeros: from the maker's angles to the chain's.
        poses: named poses in the maker's angles [rad].
        counterbalance, counterbalanced_axis: acts on that axis.
        gravity: gravity vector in the base frame [m/s^2].
        tool: pose of the tool in the flange frame [m].
        sources, assumptions: for reports.

    Raises:
        ValueError: no axis, an unknown hinge, elastic joints in line with an axis and
            no inertia between them (the mass matrix is singular), a flexible body whose
            modes move the place where it is attached.
    """
    joints, kinds, roles = [], [], []
    masses, coms, tensors, carriers, body_names = [], [], [], [], []
    springs, elastic_names, axis_names = [], [], []
    hinge_axes, slopes, links = {}, [], []
    place = SAME
    wrist, mark = None, False

    def attach(steps, place: Placement, first: int) -> Placement:
        """Joints that modes move, and the placement of what follows."""
        for direction, kind, factors in steps:
            moving = tuple(int(k) for k in np.flatnonzero(factors))
            weights = tuple(range(len(slopes), len(slopes) + len(moving)))
            slopes.extend(factors[k] for k in moving)
            joints.append((place, (direction, True)))
            kinds.append(kind)
            roles.append(NodeRole(tuple(first + k for k in moving), weights))
            place = SAME
        return place

    for part in parts:
        match part:
            case Offset():
                place = place.then(_placement(part))
                continue
            case Body():
                if roles:  # others rest on the ground
                    turn = place.rotation
                    com = Placement(np.eye(3), np.asarray(part.com, float))
                    masses.append(np.asarray(part.mass, float))
                    coms.append(place.then(com).position)
                    tensors.append(turn @ np.asarray(part.inertia, float) @ turn.T)
                    carriers.append(len(roles) - 1)
                    body_names.append(part.name)
                continue
            case WristCentre():
                mark = True
                continue
            case FlexibleLink():
                if not roles:
                    raise ValueError(
                        f"the flexible link `{part.name}` must have a joint in front "
                        "of it: on the ground it moves nothing"
                    )
                first = len(elastic_names)
                turn = Placement(place.rotation, None, place.is_structure)
                body = mounted_body(part, place)
                if part.floating:
                    attach(base_motion(body, part.base), place, first)
                    place = SAME
                links.append(ModalLink(body, len(roles) - 1, first))
                elastic_names += [f"{part.name}: {mode}" for mode in body.mode_names]
                springs += [
                    (k, d, 0.0) for k, d in zip(np.diag(body.K_e), np.diag(body.D_e))
                ]
                if part.node is None:
                    continue
                at, steps = node_motion(body, part.node)
                place = attach(steps, Placement(np.eye(3), at), first)
                place = place.then(turn)
                continue
            case Axis():
                direction, kind = (0.0, 0.0, 1.0), part.kind
                role: JointRole = AxisRole(len(axis_names))
                axis_names.append(part.name)
                if mark:
                    wrist, mark = len(roles), False
            case ElasticJoint():
                if part.name in hinge_axes:
                    raise ValueError(
                        f"every elastic joint must have a name of its own, but "
                        f"`{part.name}` is there twice"
                    )
                direction, kind = part.axis, JointKind.REVOLUTE
                role = ElasticRole(len(elastic_names))
                hinge_axes[part.name] = (len(elastic_names), part.axis)
                elastic_names.append(part.name)
                springs.append((part.stiffness, part.damping, part.hardening))
            case EndSlope():
                if part.of not in hinge_axes:
                    raise ValueError(
                        f"the end slope follows `{part.of}`, which is no elastic joint "
                        f"in front of it; there are {sorted(hinge_axes)}"
                    )
                index, direction = hinge_axes[part.of]
                kind, role = JointKind.REVOLUTE, SlopeRole(index, len(slopes))
                slopes.append(part.factor)
        joints.append((place, (np.asarray(direction, float), True)))
        kinds.append(kind)
        roles.append(role)
        place = SAME
    if not axis_names:
        raise ValueError(f"`{name}` has no driven axis: list at least one `Axis`")
    stiffness, damping, hardening = np.asarray(springs, float).reshape(-1, 3).T
    flange = np.eye(4)
    flange[:3, :3] = place.rotation
    if place.position is not None:
        flange[:3, 3] = place.position
    robot = ElasticRobot(
        chain=SerialChain(
            structured(joints),
            np.eye(4),
            flange if tool is None else flange @ np.asarray(tool, float),
            tuple(kinds),
        ),
        bodies=RigidBodies(
            np.array(masses),
            np.array(coms).reshape(-1, 3),
            np.array(tensors).reshape(-1, 3, 3),
            tuple(carriers),
            tuple(body_names),
        ),
        payload=no_bodies(),
        flange=flange,
        slopes=np.asarray(slopes, float),
        structure_stiffness=_springs(stiffness, hardening),
        structure_damping=damping,
        drives=drives,
        counterbalance=counterbalance,
        gravity=np.asarray(gravity, float),
        limits=limits,
        axis_signs=np.asarray(axis_signs, float),
        axis_zeros=np.asarray(axis_zeros, float),
        poses={key: as_real(value) for key, value in poses.items()},
        roles=tuple(roles),
        wrist=len(roles) - 1 if wrist is None else wrist,
        counterbalanced_axis=counterbalanced_axis,
        name=name,
        axis_names=tuple(axis_names),
        elastic_names=tuple(elastic_names),
        sources=tuple(sources),
        assumptions=tuple(assumptions),
        modal_links=tuple(links),
    )
    check_inertia(robot)
    return robot


def _placement(part: Offset) -> Placement:
    rotation = np.eye(3) if part.rotation is None else np.asarray(part.rotation, float)
    if part.position is None:
        return Placement(rotation, None)
    return Placement(rotation, np.asarray(part.position, float))


def _springs(stiffness: np.ndarray, hardening: np.ndarray):
    if not stiffness.size:
        return None
    if not hardening.any():
        return LinearStiffness(stiffness)
    return CubicStiffness(stiffness, hardening)
