"""Arms and robots as URDF text, with every number to its last digit."""

import dataclasses
import xml.etree.ElementTree as ET

import jax
import numpy as np

from .._rpy import rpy_of
from ..dynamics import (
    AxisRole,
    ElasticRobot,
    ElasticRole,
    RigidBodies,
    SlopeRole,
)
from ..kinematics import Arm, JointKind, RPYJoints, SerialChain


# of a hinge in a file for other programs: nothing else stops it there
_HINGE_LIMITS = (-0.1, 0.1, 10.0)


@dataclasses.dataclass(frozen=True)
class _Written:
    """What a joint is called and what it may do.

    Attributes:
        name: of the joint.
        limits: lower, upper and speed.
        comment: in front of the joint.
        mimic: joint that it follows, and the factor.
    """

    name: str
    limits: tuple[float, float, float]
    comment: str = ""
    mimic: tuple[str, float] | None = None


def urdf_from_arm(arm: Arm) -> str:
    """URDF of an arm: joints, limits, base and tool.

    Joint names and the numbers of `RPYJoints` are kept to the last digit; orientations
    of other conventions become roll, pitch, yaw, exact to rounding. The angles are the
    chain's; the maker's signs and zeros stand in comments. `effort` is zero: an arm has
    no limits of torque. Turning joints without limits are `continuous`.

    Raises:
        ValueError: limits of another joint, or a speed, that are not finite.
    """
    joints = [
        _Written(
            name,
            (float(arm.lower[k]), float(arm.upper[k]), float(arm.velocity[k])),
            _maker(float(arm.signs[k]), float(arm.zeros[k])),
        )
        for k, name in enumerate(arm.axis_names)
    ]
    return _text(_Tree(arm.name, arm.chain, joints, None).root())


def urdf_from_robot(robot: ElasticRobot, *, hinges: bool = False) -> str:
    """URDF of the rigid part of an elastic robot: joints, limits, bodies, payload.

    The first body behind a joint is its link, further ones are links fixed to it.
    Gears, springs, dampers, friction, counterbalance and gravity have no place in a
    URDF.

    Args:
        robot: the robot.
        hinges: whether elastic hinges are written too, as revolute joints without
            springs, each with a comment; joints at the end of a bending link mimic
            their hinge. Without, they are locked at zero.

    Raises:
        ValueError: hinges of a robot with modal bodies.
    """
    if hinges and robot.modal_links:
        raise ValueError(
            f"`{robot.name}` has modal bodies, which a URDF cannot hold: write it "
            "without hinges"
        )
    robot = robot if hinges else robot.rigid()
    signs, zeros = np.asarray(robot.axis_signs), np.asarray(robot.axis_zeros)
    ends = np.sort(
        [
            signs * np.asarray(x) + zeros
            for x in (robot.limits.lower, robot.limits.upper)
        ],
        axis=0,
    )
    speed = np.asarray(robot.limits.velocity)
    joints: list[_Written] = []
    for role in robot.roles:
        match role:
            case AxisRole(k):
                range_ = (float(ends[0, k]), float(ends[1, k]), float(speed[k]))
                comment = _maker(float(signs[k]), float(zeros[k]))
                joints.append(_Written(robot.axis_names[k], range_, comment))
            case ElasticRole(k):
                joints.append(_hinge(robot, k))
            case SlopeRole():
                of = robot.elastic_names[role.index]
                factor = float(robot.slopes[role.slope])
                name = f"end slope of {of}"
                text = "end of a bending link; follows its hinge"
                joints.append(_Written(name, _HINGE_LIMITS, text, (of, factor)))
    tree = _Tree(robot.name, robot.chain, joints, robot.all_bodies())
    return _text(tree.root(np.asarray(robot.flange)))


def _hinge(robot: ElasticRobot, k: int) -> _Written:
    assert robot.structure_stiffness is not None
    zero = jax.numpy.zeros(robot.elastic)
    spring = float(robot.structure_stiffness.stiffness(zero)[k])
    damper = float(robot.structure_damping[k])
    comment = (
        f"elastic hinge: spring {spring:g} N m/rad, damper {damper:g} N m s/rad, which "
        "a URDF cannot hold; its limits are placeholders"
    )
    return _Written(robot.elastic_names[k], _HINGE_LIMITS, comment)


def _maker(sign: float, zero: float) -> str:
    if sign == 1 and zero == 0:
        return ""
    return f"this angle = {sign:+g} * angle of the maker + {zero!r} rad"


class _Tree:
    """Builds the element <robot>."""

    def __init__(
        self,
        name: str,
        chain: SerialChain,
        joints: list[_Written],
        bodies: RigidBodies | None,
    ):
        self.element = ET.Element("robot", name=name)
        self.element.append(ET.Comment(" written by elastax; m, kg, s, rad "))
        self.chain, self.joints = chain, joints
        self.bodies = None if bodies is None else jax.device_get(bodies)
        self.links: set[str] = set()

    def root(self, flange: np.ndarray | None = None) -> ET.Element:
        """Base, joints with their links, and the tool."""
        frames = jax.device_get(self.chain.joints.frames())
        before, after = np.asarray(frames.before), np.asarray(frames.after)
        parent, behind = self.link("base_link"), np.eye(4)
        base = np.asarray(self.chain.base)
        if not np.array_equal(base, np.eye(4)):
            parent = self.fixed("base", base, parent)
        for k, written in enumerate(self.joints):
            pose = behind @ before[k]
            rpy = rpy_of(pose[:3, :3])
            if isinstance(self.chain.joints, RPYJoints):
                rpy = np.asarray(self.chain.joints.rpy[k])
            parent = self.moving(k, written, parent, pose[:3, 3], rpy, frames.axis[k])
            behind = after[k]
        tool = behind @ np.asarray(self.chain.tool)
        if flange is not None:
            parent = self.fixed("flange", flange, parent)
            tool = np.linalg.inv(flange) @ tool
        self.fixed("tool", tool, parent)
        return self.element

    def link(self, name: str, body: int | None = None) -> str:
        """A link of a name that is not there yet, with the body of that index."""
        while name in self.links:
            name += "'"
        self.links.add(name)
        link = ET.SubElement(self.element, "link", name=name)
        if body is not None:
            bodies = self.bodies
            assert bodies is not None
            inertial = ET.SubElement(link, "inertial")
            _origin(inertial, bodies.com[body], np.zeros(3))
            ET.SubElement(inertial, "mass", value=_number(bodies.mass[body]))
            rows = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2)}
            rows |= {"iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
            tensor = bodies.inertia[body]
            values = {name: _number(tensor[index]) for name, index in rows.items()}
            ET.SubElement(inertial, "inertia", values)
        return name

    def fixed(self, name: str, pose: np.ndarray, parent: str, body=None) -> str:
        """A link fixed to another one."""
        child = self.link(name, body)
        joint = self.joint(f"{name} fixed", "fixed", parent, child)
        _origin(joint, pose[:3, 3], rpy_of(pose[:3, :3]))
        return child

    def moving(self, k: int, written: _Written, parent, position, rpy, axis) -> str:
        """The joint, its link, and the bodies that it carries."""
        carried = []
        if self.bodies is not None:
            carried = [b for b, j in enumerate(self.bodies.joint) if j == k]
            carried = [b for b in carried if self.bodies.mass[b] > 0]
        if carried:
            assert self.bodies is not None
            child = self.link(self.bodies.names[carried[0]], carried[0])
        else:
            child = self.link(f"link of {written.name}")
        if written.comment:
            text = written.comment.replace("--", "- -")  # not allowed in a comment
            self.element.append(ET.Comment(f" {written.name}: {text} "))
        kind, range_ = _range(written, self.chain.kinds[k])
        joint = self.joint(written.name, kind, parent, child)
        _origin(joint, position, rpy)
        ET.SubElement(joint, "axis", xyz=_numbers(axis))
        speed = _number(written.limits[2])
        ET.SubElement(joint, "limit", {**range_, "velocity": speed, "effort": "0"})
        if written.mimic is not None:
            of, factor = written.mimic
            ET.SubElement(joint, "mimic", joint=of, multiplier=_number(factor))
        for body in carried[1:]:
            assert self.bodies is not None
            self.fixed(self.bodies.names[body], np.eye(4), child, body)
        return child

    def joint(self, name: str, kind: str, parent: str, child: str) -> ET.Element:
        """A joint between two links."""
        joint = ET.SubElement(self.element, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        return joint


def _range(written: _Written, kind: JointKind) -> tuple[str, dict[str, str]]:
    """Type of a joint, and its limits; a turning one may have none."""
    lower, upper, speed = written.limits
    turns = kind is JointKind.REVOLUTE
    if turns and np.isinf([lower, upper]).all() and np.isfinite(speed):
        return "continuous", {}
    if not np.isfinite(written.limits).all():
        raise ValueError(
            f"the limits of `{written.name}` must be finite in a URDF, but are "
            f"{lower:g} .. {upper:g}, speed {speed:g}"
        )
    limits = {"lower": _number(lower), "upper": _number(upper)}
    return "revolute" if turns else "prismatic", limits


def _origin(element: ET.Element, position, rpy) -> None:
    ET.SubElement(element, "origin", xyz=_numbers(position), rpy=_numbers(rpy))


def _numbers(values) -> str:
    return " ".join(map(_number, values))


def _number(value) -> str:
    """All digits; no negative zero."""
    return repr(float(value) + 0.0)


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'
