"""Robot files: an elastic robot described in TOML."""

import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from ..drivetrain import (
    AbstractCounterbalance,
    CoulombViscousFriction,
    CubicStiffness,
    DriveTrain,
    GasCounterbalance,
    LinearStiffness,
    SpringCounterbalance,
)
from ..dynamics import (
    Body,
    ElasticJoint,
    ElasticRobot,
    EndSlope,
    JointLimits,
    Offset,
    Part,
    WristCentre,
    assemble,
    dh_link,
)
from ..structure import BeamSection, Material, UniformBeam
from ._robot_schema import DEFORMATIONS, ROBOT
from ._toml import choice, load_toml


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
        return robot_from_table(content)
    except ValueError as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def robot_from_table(content: dict[str, Any]) -> ElasticRobot:
    """Elastic robot of the content of a robot file.

    Args:
        content: the tables, as `tomllib` returns them.

    Raises:
        ValueError: as for `load_robot`.
    """
    data = ROBOT(content, "")
    axes = data["axes"]
    _check_names(axes)
    beams = {name: _clamp_springs(name, beam) for name, beam in data["beams"].items()}
    parts: list[Part] = [_offset(data["base"])]
    for k, axis in enumerate(axes):
        if axis["wrist_centre"]:
            parts.append(WristCentre())
        parts += _link(axis, beams, f"axes[{k + 1}]")
    counterbalance = data["counterbalance"]
    robot = assemble(
        data["name"],
        parts,
        _drives([axis["gear"] for axis in axes]),
        _limits([axis["limits_deg"] for axis in axes]),
        axis_signs=[float(axis["sign"]) for axis in axes],
        axis_zeros=np.deg2rad([axis["zero_deg"] for axis in axes]),
        poses=_poses(data["poses_deg"], [axis["name"] for axis in axes]),
        counterbalance=_counterbalance(counterbalance),
        counterbalanced_axis=_counterbalanced(counterbalance, axes),
        gravity=data["gravity"],
        tool=_pose(data["tool"]),
        sources=tuple(data["sources"]),
        assumptions=tuple(data["assumptions"]),
    )
    payload = data["payload"]
    if payload is None:
        return robot
    return robot.with_payload(
        payload["mass"], np.array(payload["com"]), payload["inertia"]
    )


def _check_names(axes) -> None:
    names = [axis["name"] for axis in axes]
    names += [hinge["name"] for axis in axes for hinge in axis["hinges"]]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(
                f"the name `{name}` stands at {names.count(name)} axes or hinges: give "
                "each its own"
            )
    marks = [axis["name"] for axis in axes if axis["wrist_centre"]]
    if len(marks) > 1:
        raise ValueError(
            "`wrist_centre` must be true for one axis at most, but is for "
            f"{', '.join(marks)}"
        )


def _link(axis, beams, where: str) -> list[Part]:
    hinges = [
        _hinge(hinge, beams, f"{where}.hinges[{k + 1}]")
        for k, hinge in enumerate(axis["hinges"])
    ]
    slopes = [
        EndSlope(hinge["name"], hinge["end_slope"])
        for hinge in axis["hinges"]
        if hinge["end_slope"] is not None
    ]
    body = Body(f"body of {axis['name']}", **axis["body"])
    return dh_link(
        axis["name"],
        np.deg2rad(axis["theta_deg"]),
        axis["d"],
        axis["a"],
        np.deg2rad(axis["alpha_deg"]),
        body,
        hinges=tuple(hinges),
        slopes=tuple(slopes),
    )


def _hinge(hinge, beams, where: str) -> ElasticJoint:
    length = float(np.linalg.norm(hinge["axis"]))
    if abs(length - 1) > 1e-6:
        raise ValueError(
            f"`{where}.axis` must be a unit vector, but has length {length}"
        )
    stiffness = hinge["stiffness"]
    if (stiffness is None) == (hinge["beam"] is None):
        raise ValueError(f"`{where}` must have either `stiffness` or `beam`")
    if (hinge["beam"] is None) != (hinge["deformation"] is None):
        raise ValueError(f"`{where}` must have `beam` and `deformation` together")
    if stiffness is None:
        if hinge["beam"] not in beams:
            raise ValueError(
                f"`{where}.beam` must name one of `beams` "
                f"({', '.join(beams) or 'there are none'}), but is `{hinge['beam']}`"
            )
        stiffness = beams[hinge["beam"]][hinge["deformation"]]
    if (hinge["damping"] is None) == (hinge["damping_time"] is None):
        raise ValueError(f"`{where}` must have either `damping` or `damping_time`")
    damping = hinge["damping"]
    if damping is None:
        damping = hinge["damping_time"] * stiffness
    x, y, z = np.asarray(hinge["axis"]) / length
    axis = (float(x), float(y), float(z))
    return ElasticJoint(hinge["name"], axis, stiffness, damping, hinge["hardening"])


def _clamp_springs(name: str, beam) -> dict[str, float]:
    """Stiffness of the hinges at the clamp [N m/rad] by deformation."""
    build: Callable[..., BeamSection]
    if beam["section"] == "circular_tube":
        wanted, build = ("diameter",), BeamSection.circular_tube
    else:
        wanted, build = ("height", "width"), BeamSection.rectangular_tube
    sizes = {key: beam[key] for key in ("height", "width", "diameter")}
    given = [key for key, size in sizes.items() if size is not None]
    if given != list(wanted):
        raise ValueError(
            f"`beams.{name}` is a {beam['section']} and must have "
            f"{' and '.join(f'`{key}`' for key in wanted)}, but has "
            f"{' and '.join(f'`{key}`' for key in given) or 'neither'}"
        )
    if 2 * beam["wall"] > min(sizes[key] for key in wanted):
        raise ValueError(
            f"`beams.{name}.wall` must be at most half of "
            f"{' and '.join(f'`{key}`' for key in wanted)}, but is {beam['wall']:g}"
        )
    section = build(*(sizes[key] for key in wanted), beam["wall"])
    material = Material(beam["young"], beam["shear"], beam["density"])
    springs = UniformBeam(material, section, beam["length"]).clamp_stiffness()
    return dict(zip(DEFORMATIONS, np.asarray(springs).tolist()))


def _drives(gears) -> DriveTrain:
    column = lambda name: np.array([gear[name] for gear in gears])
    for k, gear in enumerate(gears):
        if gear["ratio"] == 0:
            raise ValueError(f"`axes[{k + 1}].gear.ratio` must not be zero")
    stiffness, hardening = column("stiffness"), column("hardening")

    def friction(side):
        values = [gear[side] for gear in gears]
        return CoulombViscousFriction(
            *(
                np.array([value[name] for value in values])
                for name in ("viscous", "coulomb", "steepness")
            )
        )

    return DriveTrain(
        ratio=column("ratio"),
        motor_inertia=column("motor_inertia"),
        stiffness=CubicStiffness(stiffness, hardening)
        if hardening.any()
        else LinearStiffness(stiffness),
        damping=column("damping"),
        motor_friction=friction("motor_friction"),
        joint_friction=friction("joint_friction"),
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


def _poses(poses, names) -> dict[str, np.ndarray]:
    for name, angles in poses.items():
        if len(angles) != len(names):
            raise ValueError(
                f"`poses_deg.{name}` must have one angle for each of the {len(names)} "
                f"axes ({', '.join(names)}), but has {len(angles)}"
            )
    if not poses:
        return {"zero": np.zeros(len(names))}
    return {name: np.deg2rad(angles) for name, angles in poses.items()}


def _counterbalance(value) -> AbstractCounterbalance | None:
    if value is None:
        return None
    law = {"spring": SpringCounterbalance, "gas": GasCounterbalance}[value["kind"]]
    rest = {k: v for k, v in value.items() if k not in ("kind", "axis")}
    angle = float(np.deg2rad(rest.pop("angle_offset_deg")))
    return law(angle_offset=angle, **rest)


def _counterbalanced(value, axes) -> int:
    names = [axis["name"] for axis in axes]
    if value is None:
        return 0
    return names.index(choice(*names)(value["axis"], "counterbalance.axis"))


def _offset(value) -> Offset:
    pose = _pose(value)
    return Offset(pose[:3, 3], pose[:3, :3])


def _pose(value) -> np.ndarray:
    """Pose of position and of roll, pitch, yaw about the fixed x, y, z."""
    pose = np.eye(4)
    if value is None:
        return pose
    cosines, sines = (f(np.deg2rad(value["rpy_deg"])) for f in (np.cos, np.sin))
    (cr, cp, cy), (sr, sp, sy) = cosines, sines
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = value["position"]
    return pose
