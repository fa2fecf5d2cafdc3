"""URDF: arms and robots read from it, and what is told about the file."""

import inspect
import pathlib
import re
import tomllib
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import yourdfpy
from elastax.dynamics import inverse_dynamics
from elastax.io import (
    UrdfWarning,
    _robot_schema,
    _urdf_schema,
    arm_from_urdf,
    load_robot,
    robot_from_urdf,
)
from elastax.kinematics import JointKind, SerialChain, forward_kinematics, moving_frames
from elastax.robots import named_model, named_robot

from tests.helpers import assert_close, assert_gradient


EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"
UR10E, IIWA = EXAMPLES / "ur10e.urdf", EXAMPLES / "iiwa14.urdf"
URDF, BESIDE = EXAMPLES / "urdf_robot.urdf", EXAMPLES / "urdf_robot.toml"
CONTENT = tomllib.loads(BESIDE.read_text(encoding="utf-8"))

forward = jax.jit(jax.vmap(forward_kinematics, (None, 0)))


def samples(arm, count=6):
    """Coordinates within the limits."""
    generator = np.random.default_rng(1)
    lower, upper = np.asarray(arm.lower), np.asarray(arm.upper)
    return jnp.asarray(generator.uniform(lower, upper, (count, arm.chain.number)))


# -------------------------------------------------------------------------- kinematics


def test_ur10e_is_the_makers_table():
    arm, right = arm_from_urdf(UR10E), np.pi / 2
    table = SerialChain.from_dh(
        np.zeros(6),
        [0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655],
        [0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0],
        np.array([1.0, 0, 0, 1, -1, 0]) * right,
        base=np.diag([-1.0, -1, 1, 1]),  # the base link looks the other way
    )
    q = samples(arm)
    # rounding
    assert_close(forward(arm.chain, q), forward(table, q), rtol=0, atol=1e-14)
    speed = np.deg2rad([120.0, 120, 180, 180, 180, 180])
    assert_close(arm.velocity, speed, rtol=1e-15)
    assert arm.name == "ur10e" and arm.axis_names[2] == "elbow_joint"
    assert_close(arm.upper[2] - arm.lower[2], 2 * np.pi, rtol=1e-15)


@pytest.mark.slow
def test_iiwa_has_the_lengths_of_the_data_sheet():
    arm = arm_from_urdf(IIWA)
    frames = moving_frames(arm.chain, jnp.zeros(7))
    heights = np.asarray(frames.position)[[1, 3, 5], 2]
    # sums of printed decimals
    assert_close(heights, np.cumsum([0.36, 0.42, 0.40]), rtol=1e-14)
    assert_close(frames.tool_position, [0, 0, 1.306], rtol=1e-14, atol=1e-14)
    assert_close(
        np.rad2deg(arm.upper), [170.0, 120, 170, 120, 170, 120, 175], rtol=1e-14
    )


@pytest.mark.parametrize("path", [UR10E, IIWA], ids=lambda path: path.stem)
def test_pose_is_that_of_yourdfpy(path):
    """The second route: the scene graph of yourdfpy."""
    arm = arm_from_urdf(path)
    other = yourdfpy.URDF.load(str(path), load_meshes=False)
    tip = {"ur10e": "tool0", "iiwa14": "flange"}[path.stem]
    q = samples(arm, 3)
    for angles, pose in zip(q, forward(arm.chain, q)):
        other.update_cfg(np.asarray(angles))
        wanted = other.get_transform(tip, other.base_link)
        # its quaternions carry a few times the rounding
        assert_close(pose, wanted, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_gradient_by_the_printed_numbers():
    arm = arm_from_urdf(URDF)
    q = jnp.array([0.3, -0.4, 1.1])
    assert_gradient(lambda chain, x: forward_kinematics(chain, x), arm.chain, q)


FOLDED = """<robot name="folded">
  <link name="world"/>
  <joint name="f0" type="fixed"><parent link="world"/><child link="l0"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/></joint>
  <link name="l0"/>
  <joint name="q1" type="revolute"><parent link="l0"/><child link="l1"/>
    <origin xyz="0 0 0.5" rpy="0.1 0 0"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1" upper="2" velocity="3" effort="0"/></joint>
  <link name="l1"/>
  <joint name="f1" type="fixed"><parent link="l1"/><child link="l1b"/>
    <origin xyz="0.3 0 0" rpy="0 1.5707963267948966 0"/></joint>
  <link name="l1b"/>
  <joint name="q2" type="prismatic"><parent link="l1b"/><child link="l2"/>
    <origin xyz="0 0.2 0" rpy="0.3 0 -0.2"/><axis xyz="0 0 -1"/>
    <limit lower="-0.1" upper="0.4" velocity="0.5" effort="0"/></joint>
  <link name="l2"/>
  <joint name="f2" type="fixed"><parent link="l2"/><child link="l3"/>
    <origin xyz="0 0 0.05" rpy="0 0 1"/></joint>
  <link name="l3"/>
</robot>"""


@pytest.mark.slow
def test_fixed_joints_are_folded():
    arm = arm_from_urdf(FOLDED)
    assert arm.chain.kinds == (JointKind.REVOLUTE, JointKind.PRISMATIC)
    # what stands between moving joints only once stays as printed
    assert_close(arm.chain.joints.rpy[0], [0.1, 0.0, 0.0], rtol=0)
    other = yourdfpy.URDF.load(_file(FOLDED), load_meshes=False)
    q = samples(arm, 3)
    for x, pose in zip(q, forward(arm.chain, q)):
        other.update_cfg(np.asarray(x))
        # rounding, a pitch of 90 degrees included
        assert_close(pose, other.get_transform("l3", "world"), rtol=0, atol=1e-13)
    part = arm_from_urdf(FOLDED, base="l1", tip="l2")
    assert part.axis_names == ("q2",)
    inner = other.get_transform("l2", "l1")
    assert_close(forward(part.chain, q[-1:, 1:])[0], inner, rtol=0, atol=1e-13)


def _file(text: str):
    import io

    return io.BytesIO(text.encode())


# ----------------------------------------------------------------------- elastic robots


def test_robot_equals_that_of_the_robot_file():
    """The arm of `robot.toml`, its bodies given in other frames."""
    robot, twin = robot_from_urdf(URDF, BESIDE), load_robot(EXAMPLES / "robot.toml")
    assert robot.elastic_names == twin.elastic_names
    assert jax.tree.structure(robot.chain) == jax.tree.structure(twin.chain)
    # rounding of printed radians
    assert_close(robot.limits, twin.limits, rtol=1e-14)
    assert_close(robot.chain.tool, twin.chain.tool, rtol=0, atol=1e-15)
    assert_close(robot.drives, twin.drives, rtol=0)
    assert robot.wrist == twin.wrist
    generator = np.random.default_rng(0)
    states = [jnp.asarray(generator.uniform(-1, 1, 3)) for _ in range(6)]
    torques = jax.jit(inverse_dynamics)
    for mine, theirs in zip(torques(robot, *states), torques(twin, *states)):
        assert_close(mine, theirs, rtol=1e-12, atol=1e-11)  # rounding of some 100 N m


def test_bodies_of_fixed_links_count():
    """A gripper fixed to the flange is the payload of the file."""
    pose = '<origin xyz="0.5 0 0" rpy="0 0 0"/>\n  </joint>\n  <link name="flange"/>'
    gripper = pose + (
        '<joint name="g" type="fixed"><parent link="flange"/><child link="gripper"/>'
        '<origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/></joint>'
        '<link name="gripper"><inertial><mass value="10"/><inertia ixx="0.01" ixy="0" '
        'ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial></link>'
    )
    text = URDF.read_text(encoding="utf-8")
    assert pose in text
    loaded = CONTENT | {"payload": {"mass": 10.0, "com": [0.1, 0.0, 0.0]}}
    loaded["payload"]["inertia"] = [0.03, 0.02, 0.01]  # turned about y
    bare = {key: value for key, value in CONTENT.items() if key != "payload"}
    mine = robot_from_urdf(text.replace(pose, gripper), bare)
    twin = robot_from_urdf(text, loaded)
    assert mine.bodies.names[-1] == "gripper" and mine.payload.number == 0
    states = [jnp.linspace(-1, 1, 3) * k for k in range(1, 7)]
    torques = jax.jit(lambda robot, *x: inverse_dynamics(robot, *x))
    # rounding of some 1000 N m
    assert_close(torques(mine, *states), torques(twin, *states), rtol=1e-12, atol=1e-10)


def test_limits_of_a_negative_sign_swap():
    content = CONTENT | {"axes": [dict(axis) for axis in CONTENT["axes"]]}
    content["axes"][1] |= {"sign": -1, "zero_deg": 10.0}
    robot = robot_from_urdf(URDF, content)
    # the URDF allows -120 .. 60
    assert_close(np.rad2deg(robot.limits.lower[1]), -50.0, rtol=1e-13)
    assert_close(np.rad2deg(robot.limits.upper[1]), 130.0, rtol=1e-13)


# keys of the robot file that the URDF replaces, and of cylinders, shown there
ELSEWHERE = {"theta_deg", "alpha_deg", "d", "a", "base", "body", "lower", "upper"}
ELSEWHERE |= {"velocity", "pressure", "volume", "piston_diameter", "rod_diameter"}
# flexible links, which a URDF has no place for
ELSEWHERE |= {"flexible", "modes", "damping_ratio", "dialect"}


def test_example_shows_every_key():
    text = BESIDE.read_text(encoding="utf-8")
    keys = [
        key
        for module in (_urdf_schema, _robot_schema)
        for key in re.findall(r'"(\w+)": Key\(', inspect.getsource(module))
    ]
    assert len(keys) > 65
    keys = set(keys) - ELSEWHERE
    assert not [key for key in keys if not re.search(rf"\b{key}\b", text)]


# ------------------------------------------------------------------------ what is told


def told(source, **options) -> str:
    with pytest.warns(UrdfWarning) as caught:
        arm_from_urdf(source, **options)
    assert len(caught) == 1
    return str(caught[0].message)


def edited(*changes: tuple[str, str]) -> str:
    """Text of the example, each `old` replaced once."""
    text = URDF.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_a_clean_file_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for path in (UR10E, IIWA, URDF):
            arm_from_urdf(path)


BRANCH = """
  <joint name="finger" type="prismatic"><parent link="base_link"/><child link="tip"/>
    <limit lower="0" upper="1" velocity="1" effort="0"/></joint>
  <link name="tip"/>
  <joint name="nail" type="revolute"><parent link="tip"/><child link="nail link"/>
    <limit lower="0" upper="1" velocity="1" effort="0"/></joint>
  <link name="nail link"/>
  <transmission name="t"/> <gazebo/> <gazebo/>
</robot>"""
SHAPES = (
    '<link name="flange"><visual><geometry><mesh filename="http://nowhere/a.stl"/>'
    "</geometry></visual><collision/></link>"
)
TENSOR = '<inertia ixx="0.15" ixy="0" ixz="0" iyy="0.9" iyz="0" izz="0.9"/>'


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            [("</robot>", BRANCH)],
            ("joint `finger` (line 60) starts a branch", "tip, nail link"),
        ),
        ([("</robot>", BRANCH)], ("1 <transmission>, 2 <gazebo>",)),
        (
            [('<link name="flange"/>', SHAPES)],
            ("1 <visual>, 1 <collision> (with 1 meshes, never loaded)",),
        ),
        (
            [
                (
                    '<joint name="A2" type="revolute">',
                    '<joint name="A2" type="continuous">',
                )
            ],
            ("joint `A2` (line 23) is continuous", "two turns"),
        ),
        (
            [
                (
                    '<joint name="flange fixed" type="fixed">',
                    '<joint name="flange fixed" type="continuous">',
                )
            ],
            ("`flange fixed` (line 53) is continuous", "and a speed of pi rad/s"),
        ),
        (
            [
                (
                    'velocity="3.141592653589793" effort="0"/>',
                    'velocity="3" effort="9"/>'
                    '<mimic joint="A1"/><dynamics damping="0.5"/>',
                )
            ],
            ("`A3` (line 38) mimics `A1`", "<dynamics> of A3", "`effort` limits"),
        ),
        (
            [('<mass value="25"/>', '<mass value="0"/>')],
            ("`link arm` (line 30) has no",),
        ),
        (
            [(TENSOR, TENSOR.replace('"0.15"', '"0"'))],
            ("must be positive definite", "0, 0.9, 0.9"),
        ),
        (
            [(TENSOR, TENSOR.replace('izz="0.9"', 'izz="1.2"'))],
            ("link `link arm` (line 30): no body has", "0.15, 0.9, 1.2"),
        ),
        (
            [('<axis xyz="0 0 1"/>', '<axis xyz="0 0 2"/>')],
            ("length 2 and was scaled",),
        ),
        ([("0.6 0 0", "600 0 0")], ("600", "millimetres", "mixed")),
    ],
)
def test_one_warning_tells(changes, words):
    text = told(edited(*changes))
    for word in words:
        assert word in text


def test_equal_tips_are_told():
    other = """<joint name="f" type="fixed"><parent link="forearm"/><child link="eye"/>
    </joint><link name="eye"/></robot>"""
    text = told(edited(("</robot>", other)))
    assert "the chain ends at `flange`; as many joints move to `eye`" in text
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_close(
            arm_from_urdf(edited(("</robot>", other)), tip="eye").chain.tool,
            np.eye(4),
            rtol=0,
        )
        # a tip behind more fixed joints is meant, nobody needs to be asked
        hand = other.replace("eye", "hand").replace('"f"', '"g"')
        longer = hand.replace('parent link="forearm"', 'parent link="flange"')
        arm_from_urdf(edited(("</robot>", longer)))


def test_base_behind_a_joint():
    arm = arm_from_urdf(URDF, base="carousel")
    assert arm.axis_names == ("A2", "A3")


# --------------------------------------------------------------------- what is refused


def test_named(tmp_path):
    assert_close(named_robot(URDF), robot_from_urdf(URDF, BESIDE), rtol=0)
    assert named_model(URDF).elastic == 3
    assert named_model(UR10E).axis_names[0] == "shoulder_pan_joint"
    assert named_model(URDF, tip="forearm").chain.number == 3
    with pytest.raises(ValueError, match="a URDF holds no gears"):
        named_robot(UR10E)
