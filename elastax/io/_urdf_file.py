"""The text of a URDF: parsed, and refused with the line where it is malformed.

yourdfpy reads what the elements mean. It mends broken XML silently and puts numbers
where some are missing (an inertia of 1 kg m^2); so everything that it is given is
checked here first, on the same lxml tree that knows the lines.
"""

import copy
import dataclasses
import importlib
import io
import math
import pathlib
from typing import Any

import numpy as np


JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
LIMITED = ("revolute", "prismatic")
_XACRO = "http://www.ros.org/wiki/xacro"
# what is neither handed to yourdfpy nor ever loaded
_SHAPES = ("visual", "collision")


@dataclasses.dataclass(frozen=True)
class UrdfFile:
    """A URDF that has passed every check.

    Attributes:
        label: path of the file, or "URDF text", for messages.
        robot: the record of yourdfpy, without shapes.
        root: the lxml element, with everything.
    """

    label: str
    robot: Any
    root: Any

    def element(self, tag: str, name: str) -> Any:
        """The joint or link of that name."""
        (found,) = [e for e in self.root.findall(tag) if e.get("name") == name]
        return found

    def where(self, tag: str, name: str) -> str:
        """Joint or link with its line, for messages."""
        return f"{tag} `{name}` (line {self.element(tag, name).sourceline})"

    def refuse(self, tag: str, name: str, reason: str) -> ValueError:
        """The error about one joint or link."""
        return refusal(self.label, self.element(tag, name), f"{tag} `{name}` {reason}")

    def rpy(self, tag: str, name: str) -> np.ndarray:
        """Angles of its origin as printed [rad].

        A rotation matrix, which is what yourdfpy makes of them, does not give them back
        at a pitch of 90 degrees.
        """
        element = self.element(tag, name)
        origin = (element if tag == "joint" else element.find("inertial")).find(
            "origin"
        )
        text = "0 0 0" if origin is None else origin.get("rpy", "0 0 0")
        return np.array([float(number) for number in text.split()])


def read_urdf(source: str | pathlib.Path) -> UrdfFile:
    """Parse and check a URDF.

    Args:
        source: path of a file, or the text itself, which begins with "<".

    Raises:
        ImportError: yourdfpy is not installed.
        ValueError: with file and line, what must be changed.
    """
    try:
        # two libraries that most users of the package never need
        yourdfpy, etree = map(importlib.import_module, ("yourdfpy", "lxml.etree"))
    except ImportError:
        raise ImportError(
            "reading a URDF needs yourdfpy, which is not installed: "
            "`pip install 'elastax[urdf]'`"
        ) from None
    text, label = _text(source)
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, remove_comments=True
    )
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        raise ValueError(
            f"{label}, line {error.lineno}: is no valid XML: {error.msg}"
        ) from None
    _check(root, label)
    bare = copy.deepcopy(root)
    for shape in list(bare.iter(*_SHAPES)):
        shape.getparent().remove(shape)
    model = yourdfpy.URDF.load(
        io.BytesIO(etree.tostring(bare)), build_scene_graph=False, load_meshes=False
    )
    return UrdfFile(label, model.robot, root)


def refusal(label: str, element, reason: str) -> ValueError:
    """The error with file and line."""
    return ValueError(f"{label}, line {element.sourceline}: {reason}")


def _text(source: str | pathlib.Path) -> tuple[bytes, str]:
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return source.strip().encode(), "URDF text"
    try:
        return pathlib.Path(source).read_bytes(), str(source)
    except OSError as error:
        reason = error.strerror or "unreadable"
        raise ValueError(f"{source}: cannot be read: {reason}") from None


def _check(root, label: str) -> None:
    """Refuse what yourdfpy would guess, mend or fail on."""
    if root.getroottree().docinfo.doctype:
        raise refusal(label, root, "must not hold a DOCTYPE")
    if root.tag != "robot":
        raise refusal(label, root, f"must hold <robot>, but holds <{root.tag}>")
    for element in root.iter("{*}*"):
        if str(element.tag).startswith(f"{{{_XACRO}}}"):
            raise refusal(
                label, element, "holds a xacro macro: expand it first, `xacro FILE`"
            )
    if not root.get("name"):
        raise refusal(label, root, "<robot> must have a name")
    names = {tag: _names(root, label, tag) for tag in ("link", "joint")}
    for link in root.findall("link"):
        _check_link(link, label)
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        _check_joint(joint, label, names)
        child, name = joint.find("child").get("link"), joint.get("name")
        if child in parents:
            raise refusal(
                label,
                joint,
                f"joint `{name}` must not have the child `{child}`, which joint "
                f"`{parents[child]}` has already",
            )
        parents[child] = name
    _check_tree(root, label, parents)


def _names(root, label: str, tag: str) -> set[str]:
    found = set()
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise refusal(label, element, f"<{tag}> must have a name")
        if name in found:
            raise refusal(label, element, f"the {tag} `{name}` is there twice")
        found.add(name)
    return found


def _check_tree(root, label: str, parents: dict[str, str]) -> None:
    links = [link.get("name") for link in root.findall("link")]
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        what = ", ".join(roots) or "none: the joints form a ring"
        raise refusal(
            label,
            root,
            f"one link only must have no joint in front, but there is {what}",
        )
    # every other link has one parent: those that the root does not reach form a ring
    above = {
        j.find("child").get("link"): j.find("parent").get("link")
        for j in root.findall("joint")
    }
    for name in links:
        at, seen = name, set()
        while at in above and at not in seen:
            seen.add(at)
            at = above[at]
        if at != roots[0]:
            (joint,) = [
                j for j in root.findall("joint") if j.get("name") == parents[at]
            ]
            raise refusal(label, joint, f"the joints in front of `{name}` form a ring")


def _check_link(link, label: str) -> None:
    what = f"link `{link.get('name')}`"
    inertial = link.find("inertial")
    if inertial is None:
        return
    _check_origin(inertial, label, what)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    for name, element in (("mass", mass), ("inertia", inertia)):
        if element is None:
            raise refusal(label, inertial, f"{what}: <inertial> must have <{name}>")
    value = _number(mass, "value", label, what)
    if value < 0:
        raise refusal(label, mass, f"{what}: the mass must not be negative [kg]")
    for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        _number(inertia, name, label, what)


def _check_joint(joint, label: str, names: dict[str, set[str]]) -> None:
    what = f"joint `{joint.get('name')}`"
    kind = joint.get("type")
    if kind not in JOINT_TYPES:
        raise refusal(
            label,
            joint,
            f"{what}: the type must be one of {', '.join(JOINT_TYPES)}, but is {kind}",
        )
    for tag in ("parent", "child"):
        element = joint.find(tag)
        if element is None:
            raise refusal(label, joint, f"{what} must have <{tag} link=...>")
        if element.get("link") not in names["link"]:
            raise refusal(
                label,
                element,
                f"{what}: the {tag} link `{element.get('link')}` is not there",
            )
    _check_origin(joint, label, what)
    axis = joint.find("axis")
    if axis is not None and kind != "fixed":
        numbers = _vector(axis, "xyz", "1 0 0", label, what)
        if not any(numbers):
            raise refusal(label, axis, f"{what}: the axis must not be zero")
    limit = joint.find("limit")
    if limit is None and kind in LIMITED:
        raise refusal(
            label, joint, f"{what} must have <limit lower=... upper=... velocity=...>"
        )
    dynamics = joint.find("dynamics")
    for element, numbers in (
        (limit, ("lower", "upper", "velocity", "effort")),
        (dynamics, ("damping", "friction")),
    ):
        for name in numbers:
            if element is not None and element.get(name) is not None:
                _number(element, name, label, what)


def _check_origin(element, label: str, what: str) -> None:
    origin = element.find("origin")
    if origin is not None:
        for name in ("xyz", "rpy"):
            _vector(origin, name, "0 0 0", label, what)


def _vector(element, name: str, default: str, label: str, what: str) -> list[float]:
    text = element.get(name, default)
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise refusal(
            label,
            element,
            f"{what}: `{name}` of <{element.tag}> must be three numbers, but is "
            f'"{text}"',
        )
    return numbers


def _number(element, name: str, label: str, what: str) -> float:
    text = element.get(name)
    try:
        number = float(text)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise refusal(
            label,
            element,
            f"{what}: `{name}` of <{element.tag}> must be a number, but is "
            + ("missing" if text is None else f'"{text}"'),
        )
    return number
