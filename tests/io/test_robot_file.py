"""Robot files: the example, its twin in Python, and every refusal."""

import copy
import inspect
import pathlib
import re
import tomllib

import jax
import numpy as np
import pytest
from elastax.drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    GasCounterbalance,
    LinearStiffness,
    Motor,
    SpringCounterbalance,
)
from elastax.dynamics import (
    Body,
    ElasticJoint,
    EndSlope,
    JointLimits,
    Offset,
    WristCentre,
    assemble,
    dh_link,
)
from elastax.io import _robot_schema, load_robot, robot_from_table
from elastax.robots import ROBOTS, named_robot
from elastax.structure import CubicStiffness

from tests.helpers import assert_close


EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / "examples" / "robot.toml"
CONTENT = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def example():
    return load_robot(EXAMPLE)


def by_hand():
    """The robot of the example, assembled in Python."""
    right = np.pi / 2
    # box 100 x 140 x 6 mm of aluminium, 0.6 m: 3 E I_z / l across its plane
    second_moment = (0.10 * 0.14**3 - 0.088 * 0.128**3) / 12
    lateral = 3 * 70e9 * second_moment / 0.6
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    parts = [
        Offset((0.0, 0.0, 0.2)),
        *dh_link(
            "A1",
            0.0,
            0.4,
            0.1,
            -right,
            Body("body of A1", 40.0, (-0.05, 0.1, 0.0), np.diag([0.8, 0.7, 0.9])),
            hinges=(
                ElasticJoint("tilt 1 x", x, 1.0e6, 400.0),
                ElasticJoint("tilt 1 y", y, 1.0e6, 400.0),
            ),
        ),
        *dh_link(
            "A2",
            0.0,
            0.0,
            0.6,
            0.0,
            Body("body of A2", 25.0, (-0.3, 0.0, 0.0), np.diag([0.15, 0.9, 0.9])),
            hinges=(ElasticJoint("link lateral", y, lateral, 3e-4 * lateral),),
            slopes=(EndSlope("link lateral", 0.5),),
        ),
        WristCentre(),
        *dh_link(
            "A3",
            0.0,
            0.0,
            0.5,
            0.0,
            Body(
                "body of A3",
                12.0,
                (-0.25, 0.02, 0.0),
                np.array([[0.05, 0.01, 0.0], [0.01, 0.3, 0.0], [0.0, 0.0, 0.3]]),
            ),
        ),
    ]
    drives = DriveTrain(
        ratio=np.array([100.0, 120.0, 80.0]),
        motor=Motor(np.array([5e-4, 5e-4, 3e-4])),
        stiffness=LinearStiffness(np.array([2.0e5, 2.0e5, 8.0e4])),
        damping=np.array([150.0, 150.0, 60.0]),
        motor_friction=CoulombViscousFriction(
            np.array([50.0, 50.0, 20.0]),
            np.array([30.0, 30.0, 15.0]),
            np.full(3, 500.0),
        ),
        joint_friction=CoulombViscousFriction(
            np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 2.0]), np.full(3, 500.0)
        ),
    )
    degrees = np.deg2rad
    limits = JointLimits(
        lower=degrees([-170.0, -120.0, -120.0]),
        upper=degrees([170.0, 60.0, 120.0]),
        velocity=degrees([150.0, 150.0, 180.0]),
        acceleration=degrees([400.0, 400.0, 600.0]),
        jerk=degrees([4000.0, 4000.0, 6000.0]),
    )
    tool = np.array([[0, 0, 1, 0.15], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], float)
    return assemble(
        "example arm",
        parts,
        drives,
        limits,
        axis_signs=[-1.0, 1.0, 1.0],
        axis_zeros=[0.0, 0.0, right],
        poses={
            "stretched": degrees([0.0, 0.0, -90.0]),
            "upright": degrees([0.0, -90.0, -90.0]),
            "elbow": degrees([0.0, -45.0, 0.0]),
        },
        counterbalance=SpringCounterbalance(
            base_distance=0.3,
            lever=0.1,
            angle_offset=right,
            spring_rate=8000.0,
            reference_length=0.2,
            preload=500.0,
        ),
        counterbalanced_axis=1,
        tool=tool,
        sources=("invented for this example",),
        assumptions=("all numbers",),
    ).with_payload(10.0, np.array([0.1, 0.0, 0.0]), 0.03 * np.eye(3))


def test_example_equals_its_twin_in_python(example):
    twin = by_hand()
    assert jax.tree.structure(example) == jax.tree.structure(twin)
    # atol: cosines of right angles
    assert_close(example, twin, rtol=1e-14, atol=1e-15)


def test_example_shows_every_key():
    text = EXAMPLE.read_text(encoding="utf-8")
    keys = re.findall(r'"(\w+)": Key\(', inspect.getsource(_robot_schema))
    assert len(keys) > 50
    missing = [key for key in keys if not re.search(rf"\b{key}\b", text)]
    assert not missing


def test_defaults():
    """What is left out takes its default; the other laws are reached by their keys."""
    content = changed(
        ("base", None),
        ("payload", None),
        ("tool", None),
        ("poses_deg", None),
        ("sources", None),
        ("axes.0.gear.hardening", 1e3),
        ("axes.0.gear.motor_friction", None),
        ("axes.2.wrist_centre", None),
        ("beams.link.section", "circular_tube"),
        ("beams.link.height", None),
        ("beams.link.width", None),
        ("beams.link.diameter", 0.1),
        ("counterbalance.kind", "gas"),
        ("counterbalance.spring_rate", None),
        ("counterbalance.preload", None),
        ("counterbalance.pressure", 1.6e7),
        ("counterbalance.volume", 1e-3),
        ("counterbalance.piston_diameter", 0.05),
        ("counterbalance.rod_diameter", 0.03),
    )
    robot = robot_from_table(content)
    assert robot.payload.number == 0
    assert list(robot.poses) == ["zero"]
    assert isinstance(robot.drives.stiffness, CubicStiffness)
    assert isinstance(robot.counterbalance, GasCounterbalance)
    assert_close(robot.drives.motor_friction.coulomb[0], 0.0, rtol=0)
    assert_close(robot.chain.base, np.eye(4), rtol=0)
    tube = np.pi * (0.1**4 - 0.088**4) / 64
    assert_close(robot.structure_stiffness.linear[2], 3 * 70e9 * tube / 0.6, rtol=1e-13)


def changed(*changes):
    """The example's content with values replaced, or taken out where `None`."""
    content = copy.deepcopy(CONTENT)
    for path, value in changes:
        *front, last = path.split(".")
        place = content
        for step in front:
            place = place[int(step) if isinstance(place, list) else step]
        if value is None:
            del place[last]
        else:
            place[int(last) if isinstance(place, list) else last] = value
    return content


REFUSALS = [
    # unknown and missing keys
    ("payloads", {}, "`payloads` is unknown: did you mean `payload`"),
    ("axes.1.gear.stifness", 1.0, "`axes[2].gear.stifness` is unknown: did you mean"),
    ("axes.1.gear.qqq", 1.0, "take one of ratio"),
    ("axes", None, "`axes` is missing"),
    ("axes.0.gear", None, "`axes[1].gear` is missing"),
    ("axes.0.gear.ratio", None, "`axes[1].gear.ratio` is missing: add the gear ratio"),
    ("payload.inertia", None, "`payload.inertia` is missing: add the inertia tensor"),
    ("axes.1.body", None, "`axes[2].body` is missing"),
    ("name", None, "`name` is missing"),
    # types and lengths
    ("axes", [], "`axes` must be a list of at least 1"),
    ("axes.0", 3, "`axes[1]` must be a table, but is 3"),
    ("name", "", "`name` must be a text"),
    ("gravity", [0.0, 9.81], "`gravity` must be a list of 3 numbers"),
    ("gravity", [0.0, 0.0, "g"], "`gravity[3]` must be a finite number, but is 'g'"),
    ("gravity", [0.0, 0.0, float("nan")], "`gravity[3]` must be a finite number"),
    ("axes.0.d", True, "`axes[1].d` must be a finite number, but is True"),
    ("axes.2.wrist_centre", 1, "must be true or false"),
    ("axes.0.sign", 2, "`axes[1].sign` must be one of 1, -1, but is 2"),
    ("poses_deg.elbow", [0.0, 1.0], "`poses_deg.elbow` must have one angle for each"),
    ("poses_deg.elbow", 1.0, "`poses_deg.elbow` must be a list"),
    ("poses_deg", 1.0, "`poses_deg` must be a table"),
    ("payload.inertia", [1.0, 1.0], "must be a list of 3 numbers (xx, yy, zz) or 6"),
    # values
    ("axes.0.gear.stiffness", 0.0, "`axes[1].gear.stiffness` must be positive"),
    ("axes.0.gear.damping", -1.0, "`axes[1].gear.damping` must be positive"),
    ("axes.0.gear.ratio", 0.0, "`axes[1].gear.ratio` must not be zero"),
    ("axes.0.gear.motor_inertia", 0.0, "`axes[1].gear.motor_inertia` must be positive"),
    ("axes.0.gear.hardening", -1.0, "must not be negative"),
    ("axes.0.hinges.1.stiffness", -1e6, "`axes[1].hinges[2].stiffness` must be pos"),
    ("axes.0.body.mass", -1.0, "`axes[1].body.mass` must be positive"),
    ("axes.0.body.inertia", [1.0, 1.0, 0.0], "must have positive principal moments"),
    ("axes.2.body.inertia", [1.0, 1.0, 1.0, 2.0, 0.0, 0.0], "principal moments"),
    ("axes.0.limits_deg.upper", -180.0, "`axes[1].limits_deg.upper` must lie above"),
    ("axes.0.limits_deg.jerk", 0.0, "`axes[1].limits_deg.jerk` must be positive"),
    ("beams.link.wall", 0.2, "`beams.link.wall` must be at most half of"),
    ("beams.link.height", None, "must have `height` and `width`, but has `width`"),
    ("beams.link.diameter", 0.1, "must have `height` and `width`, but has"),
    ("beams.link.section", "i_beam", "must be one of rectangular_tube, circular_tube"),
    ("counterbalance.kind", "rope", "`counterbalance.kind` must be one of spring, gas"),
    ("counterbalance.axis", "A7", "`counterbalance.axis` must be one of A1, A2, A3"),
    ("counterbalance.lever", 0.3, "`lever` must differ from `base_distance`"),
    # hinges
    ("axes.0.hinges.0.axis", [1.0, 1.0, 0.0], "must be a unit vector"),
    ("axes.0.hinges.0.damping_time", 1.0, "either `damping` or `damping_time`"),
    ("axes.0.hinges.0.damping", None, "either `damping` or `damping_time`"),
    ("axes.1.hinges.0.stiffness", 1.0, "either `stiffness` or `beam`"),
    ("axes.1.hinges.0.deformation", None, "`beam` and `deformation` together"),
    ("axes.1.hinges.0.deformation", "shear", "must be one of torsion, bending_y"),
    ("axes.1.hinges.0.beam", "boom", "must name one of `beams` (link)"),
    ("axes.1.name", "A1", "the name `A1` stands at 2 axes or hinges"),
    ("axes.0.wrist_centre", True, "`wrist_centre` must be true for one axis at most"),
    (
        "axes.0.hinges.0.axis",
        [0.0, 0.0, 1.0],
        "the mass matrix of `example arm` is sing",
    ),
]


@pytest.mark.parametrize(("path", "value", "message"), REFUSALS)
def test_refusal(path, value, message):
    with pytest.raises(ValueError) as error:
        robot_from_table(changed((path, value)))
    assert message in str(error.value)


def test_refusal_is_one_line_with_the_file(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8")
    path = tmp_path / "arm.toml"
    coaxial = text.replace("axis = [1.0, 0.0, 0.0]", "axis = [0.0, 0.0, 1.0]")
    for broken, message in [
        (text.replace("stiffness = 8.0e4", "stiffness = -8.0e4"), "must be positive"),
        (coaxial, "mass matrix"),
        (text + "\n[axes", "no valid TOML"),
        ("", "`name` is missing"),
    ]:
        path.write_text(broken, encoding="utf-8")
        with pytest.raises(ValueError, match=message) as error:
            load_robot(path)
        assert str(error.value).startswith(f"{path}: ")
        assert "\n" not in str(error.value)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="must be a text file"):
        load_robot(path)
    with pytest.raises(ValueError, match="cannot be read: No such file"):
        load_robot(tmp_path / "absent.toml")
    with pytest.raises(ValueError, match="cannot be read: Is a directory"):
        load_robot(tmp_path)


def test_named_robot(example):
    assert {"kr210", "kr16", "manutec_r3"} <= set(ROBOTS)
    assert named_robot("manutec_r3").name == "manutec_r3"
    assert_close(named_robot(str(EXAMPLE)), example, rtol=0)
    assert_close(named_robot(EXAMPLE), example, rtol=0)
    with pytest.raises(ValueError, match="`kr201` is unknown: take one of kr210"):
        named_robot("kr201")
