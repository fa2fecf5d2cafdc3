"""Arms and elastic robots of URDF files."""

import pathlib
import warnings
from typing import Any

import numpy as np

from .._custom_types import as_real
from ..dynamics import (
    Axis,
    ElasticRobot,
    EndSlope,
    JointLimits,
    Offset,
    Part,
    WristCentre,
    assemble,
)
from ..kinematics import Arm, JointKind, SerialChain, length_doubts
from ._robot_parts import (
    check_names,
    clamp_springs,
    counterbalance_of,
    counterbalanced_axis,
    drives_of,
    hinges_of,
    pose_from,
    poses_of,
    with_payload_of,
)
from ._toml import load_toml
from ._urdf_bodies import bodies_of, inertia_doubts
from ._urdf_chain import UrdfChain, limits_of, read_chain
from ._urdf_file import read_urdf
from ._urdf_notes import UrdfWarning
from ._urdf_schema import ELASTIC


def arm_from_urdf(
    source: str | pathlib.Path, *, base: str | None = None, tip: str | None = None
) -> Arm:
    """Kinematics of a URDF.

    The joints are `RPYJoints` with the numbers of the file. Fixed joints are folded
    into the joint behind them; those at the ends of the chain are its base and its
    tool, the frame of the tip link. The angles of the maker are those of the file.
    Meshes are never loaded.

    One `UrdfWarning` lists what is left out, put in, or looks wrong: branches, joints
    that mimic others, tags for other purposes, limits of continuous joints, inertias
    that no body can have, lengths that are hardly in metres.

    Args:
        source: path of a file, or the text itself, which begins with "<".
        base: first link; the root unless given.
        tip: last link. Unless given, the chain is that with the most moving joints, of
            those the one with the most joints, of those the first in the file.

    Raises:
        ImportError: yourdfpy is not installed; it comes with the extra `urdf`.
        ValueError: with file and line, what must be changed.
    """
    chain = read_chain(read_urdf(source), base, tip)
    arm, notes = _arm(chain)
    _warn(chain, notes)
    return arm


def robot_from_urdf(
    source: str | pathlib.Path, elastic: str | pathlib.Path | dict[str, Any]
) -> ElasticRobot:
    """Elastic robot of a URDF and of a TOML file with what a URDF does not hold.

    From the URDF: joints, limits of angle and speed, and the bodies, those of fixed
    links included. From the other file: gears, friction, hinges of the structure,
    beams, counterbalance, limits of acceleration and jerk, the maker's signs and zeros.
    `examples/urdf_robot.toml` shows every key with its unit; the vocabulary is that of
    `load_robot`.

    Hinges sit at the joint, behind its drive, in the axes of the URDF's joint frame;
    end slopes in the origin of the next one, about the axes of their hinges.

    Args:
        source: path of the URDF, or its text.
        elastic: path of the TOML file, or its content as `tomllib` returns it.

    Raises:
        ImportError: yourdfpy is not installed; it comes with the extra `urdf`.
        ValueError: with the file and its line or key, what must be changed. Sliding
            joints are refused: the file describes gears of turning axes.
    """
    if isinstance(elastic, dict):
        return _robot(source, elastic)
    content = load_toml(elastic)
    try:
        return _robot(source, content)
    except ValueError as error:
        reason = " ".join(str(error).split())
        if reason.startswith((f"{source}", "URDF text")):
            raise
        raise ValueError(f"{elastic}: {reason}") from None


def _arm(chain: UrdfChain) -> tuple[Arm, list[str]]:
    lower, upper, speed, notes = limits_of(chain)
    number = len(chain.moving)
    arm = Arm(
        SerialChain.from_rpy(
            np.array([m.position for m in chain.moving]),
            np.array([m.rpy for m in chain.moving]),
            np.array([m.axis for m in chain.moving]),
            kinds=tuple(m.kind for m in chain.moving),
            base=chain.base,
            tool=chain.tool,
        ),
        lower,
        upper,
        speed,
        np.ones(number),
        np.zeros(number),
        {"zero": as_real(np.zeros(number))},
        chain.file.robot.name,
        tuple(m.joint.name for m in chain.moving),
        (f"URDF: {chain.file.label}",),
    )
    return arm, [*notes, *inertia_doubts(chain), *length_doubts(arm.chain)]


def _warn(chain: UrdfChain, notes: list[str]) -> None:
    if chain.notes or notes:
        warnings.warn(
            UrdfWarning(chain.file.label, (*chain.notes, *notes)), stacklevel=3
        )


def _robot(source, content: dict[str, Any]) -> ElasticRobot:
    data = ELASTIC(content, "")
    chain = read_chain(read_urdf(source), data["base_link"], data["tip_link"])
    arm, notes = _arm(chain)
    axes = _ordered(data["axes"], chain)
    check_names(axes)
    signs = np.array([float(axis["sign"]) for axis in axes])
    zeros = np.deg2rad([axis["zero_deg"] for axis in axes])
    counterbalance = data["counterbalance"]
    robot = assemble(
        data["name"] or arm.name,
        _parts(chain, axes, data["beams"]),
        drives_of([axis["gear"] for axis in axes]),
        _limits(arm, axes, signs, zeros),
        axis_signs=signs,
        axis_zeros=zeros,
        poses=poses_of(data["poses_deg"], arm.axis_names),
        counterbalance=counterbalance_of(counterbalance),
        counterbalanced_axis=counterbalanced_axis(counterbalance, axes),
        gravity=data["gravity"],
        tool=pose_from(data["tool"]),
        sources=(*arm.sources, *data["sources"]),
        assumptions=tuple(data["assumptions"]),
    )
    robot = with_payload_of(robot, data["payload"])
    _warn(chain, notes)
    return robot


def _ordered(axes: list[dict], chain: UrdfChain) -> list[dict]:
    """The tables in the order of the joints."""
    found = {axis["name"]: axis for axis in axes}
    wanted = [m.joint.name for m in chain.moving]
    for name in found:
        if name not in wanted:
            raise ValueError(
                f"`axes` must be the moving joints of the chain, {', '.join(wanted)}, "
                f"but one is `{name}`"
            )
    for m in chain.moving:
        if m.joint.name not in found:
            raise ValueError(
                f"`axes` must hold all moving joints of the chain, but "
                f"`{m.joint.name}` is missing"
            )
        if m.kind is JointKind.PRISMATIC:
            raise chain.file.refuse(
                "joint",
                m.joint.name,
                "is prismatic: an elastic robot from files has turning axes only",
            )
    if len(axes) > len(wanted):
        raise ValueError("`axes` must hold every joint once")
    return [found[name] for name in wanted]


def _limits(arm: Arm, axes, signs, zeros) -> JointLimits:
    """Limits in the maker's angles; a sign of -1 swaps lower and upper."""
    ends = np.stack([signs * (np.asarray(x) - zeros) for x in (arm.lower, arm.upper)])
    column = lambda name: np.deg2rad([axis["limits_deg"][name] for axis in axes])
    return JointLimits(
        lower=ends.min(axis=0),
        upper=ends.max(axis=0),
        velocity=arm.velocity,
        acceleration=column("acceleration"),
        jerk=column("jerk"),
    )


def _parts(chain: UrdfChain, axes: list[dict], beams: dict) -> list[Part]:
    springs = {name: clamp_springs(name, beam) for name, beam in beams.items()}
    parts: list[Part] = [_shift(chain.base[:3, 3]), Offset(rotation=chain.base[:3, :3])]
    slopes: list[EndSlope] = []
    for k, (moving, axis) in enumerate(zip(chain.moving, axes)):
        hinges, behind = hinges_of(axis, springs, f"axes[{k + 1}]")
        turn = _to_axis(moving.axis)
        parts += [_shift(moving.position), *slopes, Offset(rotation=moving.rotation())]
        if axis["wrist_centre"]:
            parts.append(WristCentre())
        parts += [
            Offset(rotation=turn),
            Axis(moving.joint.name),
            Offset(rotation=turn.T),
            *hinges,
            *bodies_of(chain, moving),
        ]
        slopes = behind
    tool = chain.tool
    return [*parts, _shift(tool[:3, 3]), *slopes, Offset(rotation=tool[:3, :3])]


def _shift(position: np.ndarray) -> Offset:
    """Displacement; frames in one place lie there for good."""
    return Offset(position if np.any(position) else None)


def _to_axis(axis: np.ndarray) -> np.ndarray:
    """Rotation whose third column is the axis; right angles wherever they will do."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    if axis[2] == 1:
        return np.eye(3)
    return np.stack([first, np.cross(axis, first), axis], axis=1)
