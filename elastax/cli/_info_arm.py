"""What `elastax info` says about the kinematics of an arm."""

import numpy as np

from .._rpy import rpy_of
from ..kinematics import (
    Arm,
    JointKind,
    SerialChain,
    SphericalWrist,
    length_doubts,
    to_dh,
)
from ._geometry import (
    SAME,
    Geometry,
    angle_between,
    distance,
    geometry,
    jacobian_of,
    meet,
)
from ._tables import table


def kinematics_text(arm: Arm) -> str:
    """Everything about the kinematics, section by section."""
    zero = geometry(arm.chain, np.zeros(arm.chain.number))
    sections = [
        "Joints: where they are and turn at q = 0, in the base frame\n"
        + joint_table(arm, zero),
        "Denavit-Hartenberg parameters; q adds to theta, or to d where a joint slides\n"
        + denavit_table(arm),
        frame_lines(arm, zero),
        "\n".join([reach_line(arm, zero), *inverse_lines(arm, zero)]),
        "Named poses\n" + pose_table(arm),
    ]
    doubts = length_doubts(arm.chain)
    if doubts:
        sections.append("Doubtful:\n" + "\n".join(f"  - {line}" for line in doubts))
    return "\n\n".join(sections)


def joint_table(arm: Arm, zero: Geometry) -> str:
    """Origins, axes, the maker's angles and limits; angles in degrees, lengths in m."""
    lower, upper = (np.asarray(arm.to_maker(x)) for x in (arm.lower, arm.upper))
    rows = []
    for k, name in enumerate(arm.axis_names):
        turns = arm.chain.kinds[k] is JointKind.REVOLUTE
        shown = np.rad2deg if turns else np.asarray
        ends = sorted(float(shown(x[k])) for x in (lower, upper))
        rows.append(
            [
                name,
                arm.chain.kinds[k].value,
                _point(zero.origins[k]),
                _direction(zero.axes[k]),
                f"{float(arm.signs[k]):+.0f}",
                f"{float(shown(arm.zeros[k])) + 0.0:g}",
                f"{ends[0]:g} .. {ends[1]:g}",
                f"{float(shown(arm.velocity[k])):g}",
            ]
        )
    # of turning joints; sliding ones say so
    unit = "[deg]" if JointKind.PRISMATIC not in arm.chain.kinds else "[deg; m]"
    return table(
        rows,
        [
            "axis",
            "kind",
            "origin x y z [m]",
            "axis x y z",
            "sign",
            f"zero {unit}",
            f"limits, maker's {unit}",
            f"speed {unit[:-1]}/s]",
        ],
    )


def denavit_table(arm: Arm) -> str:
    """Standard Denavit-Hartenberg parameters, or why there are none."""
    try:
        chain = to_dh(arm.chain)
    except ValueError as error:
        return f"none: {error}"
    joints = chain.joints
    names = ("theta", "d", "a", "alpha")
    columns = [np.asarray(getattr(joints, name)) for name in names]
    rows = [
        [
            axis,
            f"{np.rad2deg(columns[0][k]) + 0.0:.6g}",
            f"{columns[1][k] + 0.0:.6g}",
            f"{columns[2][k] + 0.0:.6g}",
            f"{np.rad2deg(columns[3][k]) + 0.0:.6g}",
        ]
        for k, axis in enumerate(arm.axis_names)
    ]
    titles = ["axis", "theta [deg]", "d [m]", "a [m]", "alpha [deg]"]
    ends = (("frame in front of the first row", chain.base, "base"),)
    ends += (("tool behind the last row", chain.tool, "last"),)
    lines = [
        f"{which}: {_pose(np.asarray(pose), frame)}"
        for which, pose, frame in ends
        if not np.allclose(pose, np.eye(4), atol=1e-9)
    ]
    return "\n".join([table(rows, titles), *lines])


def frame_lines(arm: Arm, zero: Geometry) -> str:
    """Base and tool."""
    return "\n".join(
        [
            f"base: {_pose(np.asarray(arm.chain.base))}",
            f"tool at q = 0: {_pose(zero.tool)}",
            "chain angle = sign * maker's angle + zero",
        ]
    )


def reach_line(arm: Arm, zero: Geometry) -> str:
    """How far the wrist centre, or the tool, gets from axis 1; limits aside."""
    if _has_closed_form(arm.chain):
        _, radius, upper, fore, lateral = _segments(zero)
        reach = np.hypot(radius + upper + fore, lateral)
        return (
            f"reach of the wrist centre from axis 1: {reach:.4f} m (offset "
            f"{radius:.4f}, upper arm {upper:.4f}, forearm {fore:.4f} m), limits aside"
        )
    steps = [*np.diff(zero.origins, axis=0), zero.tool[:3, 3] - zero.origins[-1]]
    slides = zip(arm.chain.kinds, arm.lower, arm.upper)
    travel = sum(
        max(abs(float(a)), abs(float(b)))
        for kind, a, b in slides
        if kind is JointKind.PRISMATIC
    )
    total = sum(np.linalg.norm(step) for step in steps) + travel
    return (
        f"reach of the tool from joint 1: at most {total:.4f} m, the sum of all links"
    )


def inverse_lines(arm: Arm, zero: Geometry) -> list[str]:
    """Type of the wrist, which inverse applies, where the arm is singular."""
    try:
        SphericalWrist.from_chain(arm.chain)
    except ValueError as error:
        reason = str(error).split(":")[0].replace("`chain`", "the arm")
        if arm.chain.number != 6:
            reason = f"the arm has {arm.chain.number} joints"
        return [
            f"wrist: {_wrist(arm, zero)}",
            *_parallel(arm, zero),
            "inverse kinematics: iterative (`find_pose`); the closed form of a "
            f"spherical wrist does not apply: {reason}",
        ]
    return [
        "wrist: spherical, the axes 4, 5 and 6 meet in one point",
        "inverse kinematics: closed form (`inverse_kinematics`), eight branches",
        *_singularities(arm, zero),
    ]


def pose_table(arm: Arm) -> str:
    """Tool and distance from singularities at the named poses."""
    lengths = np.linalg.norm(
        np.diff(geometry(arm.chain, arm.zeros).origins, axis=0), axis=1
    )
    scale = max(float(np.sum(lengths)), 1e-3)
    rows = []
    for name, angles in arm.poses.items():
        here = geometry(arm.chain, arm.from_maker(angles))
        scaled = (
            jacobian_of(arm.chain, here) / np.array([scale] * 3 + [1.0] * 3)[:, None]
        )
        values = np.linalg.svd(scaled, compute_uv=False)
        rows.append(
            [
                name,
                _point(here.tool[:3, 3]),
                " ".join(f"{angle:8.2f}" for angle in _degrees(here.tool)),
                f"{values[-1]:.4f}",
            ]
        )
    return table(
        rows,
        [
            "pose",
            "tool x y z [m]",
            "roll pitch yaw [deg]",
            f"smallest singular value, length {scale:.2f} m",
        ],
    )


def _has_closed_form(chain: SerialChain) -> bool:
    try:
        SphericalWrist.from_chain(chain)
    except ValueError:
        return False
    return True


def _segments(zero: Geometry):
    """Wrist centre, offset of axis 2, upper arm, forearm, and sideways offset [m]."""
    p, a = zero.origins, zero.axes
    centre = p[3] + a[3] * (a[3] @ (p[4] - p[3]))
    outward = np.cross(a[1], a[0])
    flat = lambda v: v - a[1] * (a[1] @ v)
    return (
        centre,
        abs(outward @ (p[1] - p[0])),
        np.linalg.norm(flat(p[2] - p[1])),
        np.linalg.norm(flat(centre - p[2])),
        abs(a[1] @ (centre - p[0])),
    )


def _singularities(arm: Arm, zero: Geometry) -> list[str]:
    """Angles of axis 5 and of axis 3 at which a spherical-wrist arm is singular."""
    a, p = zero.axes, zero.origins
    centre = _segments(zero)[0]
    aligned = angle_between(a[5], a[3], a[4])
    stretched = angle_between(centre - p[2], p[2] - p[1], a[2])
    return [
        f"singular: wrist, axes 4 and 6 in line, at {_at(arm, 4, aligned)}",
        f"singular: elbow, stretched at {_at(arm, 2, stretched, 1)}, folded at "
        f"{_at(arm, 2, stretched + np.pi, 1)}",
        "singular: shoulder, the wrist centre on axis 1",
    ]


def _at(arm: Arm, joint: int, angle: float, per_turn: int = 2) -> str:
    """The maker's angles within the limits that are `angle` modulo a part of a turn."""
    step = 2 * np.pi / per_turn
    lower, upper = float(arm.lower[joint]), float(arm.upper[joint])
    first = int(np.ceil((lower - angle) / step - SAME))
    last = int(np.floor((upper - angle) / step + SAME))
    sign, zero = float(arm.signs[joint]), float(arm.zeros[joint])
    # no angle that rounding has left beside zero
    shown = [sign * (angle + k * step - zero) for k in range(first, last + 1)]
    degrees = [round(float(np.rad2deg(x)), 4) + 0.0 for x in sorted(shown)]
    name = arm.axis_names[joint]
    if not degrees:
        return f"no angle of {name} within its limits"
    return f"{name} = {', '.join(f'{x:g}' for x in degrees)} deg"


def _wrist(arm: Arm, zero: Geometry) -> str:
    """What the last three axes do to each other."""
    if arm.chain.number < 6 or JointKind.PRISMATIC in arm.chain.kinds[-3:]:
        return "none of three turning axes behind three others"
    p, a = zero.origins[-3:], zero.axes[-3:]
    size = max(float(np.ptp(zero.origins)), 1e-9)
    first, second = (distance(p[k], a[k], p[k + 1], a[k + 1]) for k in (0, 1))
    third = distance(p[0], a[0], p[2], a[2])
    if max(first, second, third) < SAME * size and meet(p, a, size):
        return "spherical, the last three axes meet in one point"
    return (
        "offset, the last three axes do not meet in one point: neighbours pass each "
        f"other at {first:.4f} and {second:.4f} m, the outer two at {third:.4f} m"
    )


def _parallel(arm: Arm, zero: Geometry) -> list[str]:
    """Runs of neighbouring axes that are parallel."""
    runs = [[0]]
    for k in range(1, arm.chain.number):
        parallel = np.linalg.norm(np.cross(zero.axes[k - 1], zero.axes[k])) < SAME
        runs = [*runs[:-1], [*runs[-1], k]] if parallel else [*runs, [k]]
    names = [", ".join(arm.axis_names[k] for k in run) for run in runs if len(run) > 1]
    return [f"parallel axes: {run}" for run in names]


def _point(position: np.ndarray) -> str:
    return " ".join(f"{x + 0.0:8.4f}" for x in np.round(position, 10))


def _direction(axis: np.ndarray) -> str:
    return " ".join(f"{x + 0.0:6.3f}" for x in np.round(axis, 10))


def _degrees(pose: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw, without what rounding leaves beside zero."""
    return np.round(np.rad2deg(rpy_of(pose[:3, :3])), 8) + 0.0


def _pose(pose: np.ndarray, frame: str = "base") -> str:
    angles = " ".join(f"{angle:g}" for angle in _degrees(pose))
    place = " ".join(_point(pose[:3, 3]).split())
    return f"{place} m, roll pitch yaw {angles} deg in the {frame} frame"
