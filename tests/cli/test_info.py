"""What `elastax info` says about kinematics."""

import pathlib
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.cli import main
from elastax.cli._geometry import angle_between, distance, geometry, jacobian_of
from elastax.cli._info_arm import kinematics_text
from elastax.kinematics import Arm, forward_kinematics, jacobian, moving_frames
from elastax.robots import kr210

from tests.helpers import assert_close
from tests.kinematics.arms import mixed, planar


EXAMPLES = pathlib.Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch):
    # the tests' own compilation cache stays in place
    monkeypatch.setenv(
        "JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir)
    )


@pytest.fixture(scope="module")
def arm():
    return kr210().arm()


def test_geometry_is_that_of_the_kinematics():
    """The second route in NumPy: sliding joints, base and tool included."""
    chain = mixed()
    q = np.random.default_rng(5).uniform(-1, 1, chain.number)
    here = geometry(chain, q)
    functions = (forward_kinematics, jacobian, moving_frames)
    pose, columns, frames = jax.jit(lambda c, x: [f(c, x) for f in functions])(chain, q)
    # rounding
    # two orders of summation over six joints of a few metres: rounding of both
    assert_close(here.tool, pose, rtol=0, atol=1e-14)
    assert_close(jacobian_of(chain, here), columns, rtol=0, atol=1e-14)
    assert_close(here.axes, frames.axis, rtol=0, atol=1e-14)


def test_lines_and_angles():
    x, y, z = np.eye(3)
    assert_close(distance(0 * x, x, 2 * z + y, y), 2.0, rtol=0)
    assert_close(distance(0 * x, x, 3 * x + 2 * z, x), 2.0, rtol=0)
    # what lies along the axis does not count
    # one arctangent
    assert_close(angle_between(x + 5 * z, y - z, z), np.pi / 2, rtol=1e-15)


def test_kr210(arm):
    text = kinematics_text(arm)
    # 350 + 1150 + hypot(1200, 41) mm: an R2700
    assert "reach of the wrist centre from axis 1: 2.7007 m" in text
    assert "spherical" in text and "eight branches" in text
    assert "axes 4 and 6 in line, at A5 = 0 deg" in text
    stretched = -np.rad2deg(np.arctan2(0.041, 1.2))
    assert f"stretched at A3 = {stretched:.4f} deg" in text
    assert "folded at no angle of A3 within its limits" in text
    row, denavit = re.findall(r"^A1 .*", text, flags=re.MULTILINE)
    assert denavit.split()[1:] == ["0", "0.675", "0.35", "-90"]
    assert row.split()[2:9] == [
        "0.0000",
        "0.0000",
        "0.2256",
        *"0.000 0.000 1.000 -1".split(),
    ]
    assert "-185 .. 185" in row and row.endswith("123")


def test_arm_of_a_robot_has_limits_of_the_chain(arm):
    robot = kr210()
    # one product and one sum: four roundings
    assert_close(arm.from_maker(robot.limits.lower)[0], arm.upper[0], rtol=1e-15)
    assert_close(arm.from_maker(robot.limits.lower)[1:], arm.lower[1:], rtol=1e-15)
    q = jnp.linspace(-1, 1, 6)
    assert_close(arm.to_maker(q), robot.to_maker(q), rtol=1e-15)


def test_singular_angles_are_singular(arm):
    """The angles that are printed make the Jacobian lose rank."""
    found = re.search(r"stretched at A3 = (\S+) deg", kinematics_text(arm))
    assert found is not None
    general = np.array([0.3, -0.7, 0.9, 0.4, 0.8, -0.5])
    for axis, angle in ((2, np.deg2rad(float(found[1]))), (4, 0.0)):
        angles = general.copy()
        angles[axis] = angle
        smallest = lambda x: np.linalg.svd(
            jacobian_of(arm.chain, geometry(arm.chain, arm.from_maker(jnp.asarray(x)))),
            compute_uv=False,
        )[-1]
        # four decimals of a degree
        assert smallest(angles) < 1e-5 < 1e-2 < smallest(general)


def test_file_without_gears_is_an_arm(capsys):
    assert main(["info", str(EXAMPLES / "ur10e.urdf"), "--quiet"]) == 0
    printed = capsys.readouterr().out
    assert "ur10e: 6 joints, kinematics only" in printed
    assert "parallel axes: shoulder_lift_joint, elbow_joint, wrist_1_joint" in printed
    assert "the last three axes do not meet in one point" in printed
    assert "the outer two at 0.1198 m" in printed  # d5
    assert "axes 4, 5 and 6 of the arm must meet in one point" in printed
    assert "roll pitch yaw 90 0 -180 deg" in printed


def test_remarks_are_shown(tmp_path, capsys):
    text = (EXAMPLES / "iiwa14.urdf").read_text(encoding="utf-8")
    file = tmp_path / "arm.urdf"
    file.write_text(
        text.replace("0 0 0.2155", "0 0 215.5").replace("revolute", "continuous", 1)
    )
    assert main(["info", str(file), "--quiet", "--tip", "link_7"]) == 0
    printed = capsys.readouterr().out
    assert f"Left out of {file}, or doubtful:" in printed
    assert "joint `joint_1`" in printed and "continuous" in printed
    assert printed.count("may be mixed") == 2  # in the arm's and in the file's list
    assert "the arm has 7 joints" in printed


@pytest.mark.parametrize(
    ("text", "words"),
    [("<robot>", ("line 1", "no valid XML")), ("<robot/>", ("line 1", "name"))],
)
def test_bad_file_is_one_line(tmp_path, capsys, text, words):
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    assert main(["info", str(file), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert all(word in line for word in (str(file), *words))


def test_small_and_sliding_arms():
    """Nothing is asked of arms that they do not have."""
    found = []
    for chain in (planar(0.5, 0.4), mixed()):
        n = chain.number
        one, zero = np.ones(n), np.zeros(n)
        names = tuple(f"J{k}" for k in range(n))
        poses = {"zero": jnp.zeros(n)}
        small = Arm(chain, -one, one, one, one, zero, poses, "a", names)
        found.append(kinematics_text(small))
        assert "none of three turning axes" in found[-1] and "iterative" in found[-1]
    assert "parallel axes: J0, J1" in found[0]
    assert "prismatic" in found[1] and "[deg; m]" in found[1]
