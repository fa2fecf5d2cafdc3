"""What the tables of a robot file, or of the file beside a URDF, become."""

from collections.abc import Callable

import numpy as np

from .._rpy import pose_of, rotation_of
from ..drivetrain import (
    AbstractCounterbalance,
    CoulombViscousFriction,
    CubicStiffness,
    DriveTrain,
    GasCounterbalance,
    LinearStiffness,
    Motor,
    SpringCounterbalance,
)
from ..dynamics import ElasticJoint, ElasticRobot, EndSlope
from ..structure import BeamSection, Material, UniformBeam
from ._robot_schema import DEFORMATIONS
from ._toml import choice


def check_names(axes) -> None:
    """Refuse names that stand twice, and two wrist centres."""
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


def hinges_of(axis, beams, where: str) -> tuple[list[ElasticJoint], list[EndSlope]]:
    """Hinges of an axis, and the end slopes that follow them."""
    hinges = [
        _hinge(hinge, beams, f"{where}.hinges[{k + 1}]")
        for k, hinge in enumerate(axis["hinges"])
    ]
    slopes = [
        EndSlope(hinge["name"], hinge["end_slope"])
        for hinge in axis["hinges"]
        if hinge["end_slope"] is not None
    ]
    return hinges, slopes


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


def clamp_springs(name: str, beam) -> dict[str, float]:
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


def drives_of(gears) -> DriveTrain:
    """Drive trains of the axes."""
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
        motor=Motor(column("motor_inertia")),
        stiffness=CubicStiffness(stiffness, hardening)
        if hardening.any()
        else LinearStiffness(stiffness),
        damping=column("damping"),
        motor_friction=friction("motor_friction"),
        joint_friction=friction("joint_friction"),
    )


def poses_of(poses, names) -> dict[str, np.ndarray]:
    """Named poses in the maker's angles [rad]; "zero" where there is none."""
    for name, angles in poses.items():
        if len(angles) != len(names):
            raise ValueError(
                f"`poses_deg.{name}` must have one angle for each of the {len(names)} "
                f"axes ({', '.join(names)}), but has {len(angles)}"
            )
    if not poses:
        return {"zero": np.zeros(len(names))}
    return {name: np.deg2rad(angles) for name, angles in poses.items()}


def counterbalance_of(value) -> AbstractCounterbalance | None:
    """The cylinder of one axis."""
    if value is None:
        return None
    law = {"spring": SpringCounterbalance, "gas": GasCounterbalance}[value["kind"]]
    rest = {k: v for k, v in value.items() if k not in ("kind", "axis")}
    angle = float(np.deg2rad(rest.pop("angle_offset_deg")))
    return law(angle_offset=angle, **rest)


def counterbalanced_axis(value, axes) -> int:
    """Index of that axis."""
    names = [axis["name"] for axis in axes]
    if value is None:
        return 0
    return names.index(choice(*names)(value["axis"], "counterbalance.axis"))


def with_payload_of(robot: ElasticRobot, payload) -> ElasticRobot:
    """The robot with the load of the file."""
    if payload is None:
        return robot
    return robot.with_payload(
        payload["mass"], np.array(payload["com"]), payload["inertia"]
    )


def pose_from(value) -> np.ndarray:
    """Pose of position and of roll, pitch, yaw about the fixed x, y, z."""
    if value is None:
        return np.eye(4)
    return pose_of(value["position"], rotation_of(np.deg2rad(value["rpy_deg"])))
