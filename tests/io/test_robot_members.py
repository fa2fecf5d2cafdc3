"""Flexible links of robot files: SID data in place of a rigid link, and refusals."""

import copy
import pathlib
import tomllib

import numpy as np
import pytest
from elastax.io import load_robot, load_sid, robot_from_table, save_sid
from elastax.kinematics import forward_kinematics
from elastax.structure import (
    BeamSection,
    Material,
    ModeCounts,
    UniformBeam,
    modal_beam,
)

from tests.helpers import assert_close


ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "robot.toml"
CONTENT = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
MEMBER = {"file": "link.SID_FEM", "base": "1", "tip": "2", "damping_ratio": 0.01}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the SID file of a beam as long as the link of axis 2."""
    beam = UniformBeam(
        Material(7e10, 2.6e10, 2700.0), BeamSection.circular_tube(0.1, 0.006), 0.6
    )
    place = tmp_path_factory.mktemp("members")
    save_sid(place / "link.SID_FEM", modal_beam(beam, ModeCounts(2, 1, 1)))
    return place


def with_member(rigid_body=True, **changes):
    content = copy.deepcopy(CONTENT)
    axis = content["axes"][1]
    axis["hinges"] = []
    axis["flexible"] = {**MEMBER, **changes}
    axis["flexible"] = {k: v for k, v in axis["flexible"].items() if v is not None}
    if not rigid_body:
        del axis["body"]
    return content


def test_link_of_sid_data(folder):
    robot = robot_from_table(with_member(rigid_body=False), folder)
    (link,) = robot.modal_links
    body = load_sid(folder / "link.SID_FEM").modal_body()
    assert_close(link.body.K_e, body.K_e, rtol=1e-12)
    ratio = np.diag(link.body.D_e) / (2 * np.sqrt(np.diag(link.body.K_e)))
    assert_close(ratio, np.full(4, 0.01), rtol=1e-9)
    # undeformed, the tool is where the rigid links lead it
    plain = load_robot(EXAMPLE)
    q = np.array([0.3, -0.4, 0.8])
    place = lambda r: forward_kinematics(r.rigid().chain, q)
    assert_close(place(robot), place(plain), rtol=1e-12, atol=1e-12)
    masses = np.sum(robot.bodies.mass) - np.sum(plain.bodies.mass)
    assert_close(masses, -CONTENT["axes"][1]["body"]["mass"], rtol=1e-12)


def test_from_a_file_beside_it(folder):
    text = EXAMPLE.read_text(encoding="utf-8")
    start = text.index('name = "A2"')
    end = text.index("[[axes.hinges]]", start)
    stop = text.index("[[axes]]", end)
    table = """
[axes.flexible]
file = "link.SID_FEM"
base = "1"
tip = "2"
modes = 2
damping_ratio = 0.02

"""
    path = folder / "arm.toml"
    path.write_text(text[:end] + table + text[stop:], encoding="utf-8")
    robot = load_robot(path)
    assert [link.body.modes for link in robot.modal_links] == [2]
    with pytest.raises(ValueError, match="cannot be read") as error:
        path.write_text(
            text[:end] + table.replace("link.", "absent.") + text[stop:],
            encoding="utf-8",
        )
        load_robot(path)
    assert "`axes[2].flexible.file`" in str(error.value)


REFUSALS = [
    ({"tip": "7"}, r"`axes\[2\].flexible.tip` must name a node of link.SID_FEM"),
    ({"base": "2", "tip": "1"}, "must reach by a along x"),
    ({"modes": 5}, "must be 1 to 4, but is 5"),
    ({"modes": 1.5}, "must be a whole number"),
    ({"dialect": "FEM"}, "must be one of FEMBS"),
    ({"file": None}, "is missing: add the path of the SID file"),
    ({"damping_ratio": -0.1}, "must be positive"),
]


@pytest.mark.parametrize(("change", "message"), REFUSALS)
def test_refusals(folder, change, message):
    with pytest.raises(ValueError, match=message):
        robot_from_table(with_member(**change), folder)


def test_link_in_millimetres(folder):
    content = with_member()
    content["axes"][1]["a"] = 600.0
    with pytest.raises(ValueError, match="the unit of length"):
        robot_from_table(content, folder)
