"""Robot files: an elastic robot described in TOML."""

import pathlib
from typing import Any

import numpy as np

from ..dynamics import (
    Body,
    ElasticRobot,
    JointLimits,
    Offset,
    Part,
    WristCentre,
    assemble,
    dh_link,
)
from ._robot_members import member_of
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
from ._robot_schema import ROBOT
from ._toml import load_toml


def load_robot(path: str | pathlib.Path) -> ElasticRobot:
    """Elastic robot of a TOML file.

    `examples/robot.toml` shows every key with its unit. SI units throughout, angles in
    rad except under keys that end in `_deg`. Everything about a gear is on its output
    side, except `ratio` and `motor_inertia`.

    Args:
        path: of the file.

    Raises:
        ValueError: in one line, with the file and the key, what must be changed: the
            file is unreadable, a key unknown or missing, a list of the wrong length, a
            value out of its range, or a hinge without inertia behind it.
    """
    content = load_toml(path)
    try:
        return robot_from_table(content, pathlib.Path(path).parent)
    except ValueError as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def robot_from_table(
    content: dict[str, Any], folder: str | pathlib.Path = "."
) -> ElasticRobot:
    """Elastic robot of the content of a robot file.

    Args:
        content: the tables, as `tomllib` returns them.
        folder: from which the names of SID files count.

    Raises:
        ValueError: as for `load_robot`.
    """
    data = ROBOT(content, "")
    axes = data["axes"]
    check_names(axes)
    beams = {name: clamp_springs(name, beam) for name, beam in data["beams"].items()}
    base = pose_from(data["base"])
    parts: list[Part] = [Offset(base[:3, 3], base[:3, :3])]
    for k, axis in enumerate(axes):
        if axis["wrist_centre"]:
            parts.append(WristCentre())
        parts += _link(axis, beams, f"axes[{k + 1}]", pathlib.Path(folder))
    counterbalance = data["counterbalance"]
    robot = assemble(
        data["name"],
        parts,
        drives_of([axis["gear"] for axis in axes]),
        _limits([axis["limits_deg"] for axis in axes]),
        axis_signs=[float(axis["sign"]) for axis in axes],
        axis_zeros=np.deg2rad([axis["zero_deg"] for axis in axes]),
        poses=poses_of(data["poses_deg"], [axis["name"] for axis in axes]),
        counterbalance=counterbalance_of(counterbalance),
        counterbalanced_axis=counterbalanced_axis(counterbalance, axes),
        gravity=data["gravity"],
        tool=pose_from(data["tool"]),
        sources=tuple(data["sources"]),
        assumptions=tuple(data["assumptions"]),
    )
    return with_payload_of(robot, data["payload"])


def _link(axis, beams, where: str, folder: pathlib.Path) -> list[Part]:
    hinges, slopes = hinges_of(axis, beams, where)
    member = member_of(axis, f"{where}.flexible", folder)
    if axis["body"] is None and member is None:
        raise ValueError(f"`{where}.body` is missing: add it")
    body = Body(f"body of {axis['name']}", **axis["body"]) if axis["body"] else None
    return dh_link(
        axis["name"],
        np.deg2rad(axis["theta_deg"]),
        axis["d"],
        axis["a"],
        np.deg2rad(axis["alpha_deg"]),
        body,
        member=member,
        hinges=tuple(hinges),
        slopes=tuple(slopes),
    )


def _limits(limits) -> JointLimits:
    for k, limit in enumerate(limits):
        if limit["upper"] <= limit["lower"]:
            raise ValueError(
                f"`axes[{k + 1}].limits_deg.upper` must lie above `lower` "
                f"({limit['lower']:g}), but is {limit['upper']:g}"
            )
    column = lambda name: np.deg2rad([limit[name] for limit in limits])
    return JointLimits(
        **{
            name: column(name)
            for name in ("lower", "upper", "velocity", "acceleration", "jerk")
        }
    )
