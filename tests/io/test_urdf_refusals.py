"""URDF: what is refused, with the line or the file named."""

import re
import sys

import pytest
from elastax.io import arm_from_urdf, robot_from_urdf
from elastax.robots import named_robot

from tests.io.test_urdf import BESIDE, CONTENT, TENSOR, URDF, edited


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("<axis xyz", "<axis")], "line 12: is no valid XML"),
        ([("</robot>", "")], "is no valid XML"),
        ([("<robot", "<sdf"), ("</robot>", "</sdf>")], "line 6: must hold <robot>"),
        ([('name="example arm"', "")], "line 6: <robot> must have a name"),
        (
            [('xyz="0 0 0.2"', 'xyz="0 0.2"')],
            "line 11: joint `A1`: `xyz` of <origin> must"
            ' be three numbers, but is "0 0.2"',
        ),
        (
            [('rpy="0 0 0"', 'rpy="0 ${pi} 0"')],
            r"`rpy` of <origin> must be three numbers",
        ),
        ([('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>')], "the axis must not be zero"),
        (
            [('type="revolute"', 'type="hinge"')],
            "line 8: joint `A1`: the type must be one",
        ),
        ([('<parent link="base_link"/>', "")], "line 8: joint `A1` must have <parent"),
        (
            [('<child link="forearm"/>', '<child link="arm"/>')],
            "line 40: joint `A3`: the child link `arm` is not there",
        ),
        (
            [('<link name="flange"/>', '<link name="forearm"/>')],
            "`forearm` is there twice",
        ),
        ([('name="A2"', 'name="A1"')], "line 23: the joint `A1` is there twice"),
        (
            [('<child link="forearm"/>', '<child link="link arm"/>')],
            "line 38: joint `A3` "
            "must not have the child `link arm`, which joint `A2` has already",
        ),
        ([("</robot>", '<link name="alone"/></robot>')], "base_link, alone"),
        ([('<parent link="carousel"/>', '<parent link="flange"/>')], "form a ring"),
        (
            [('<mass value="40"/>', "")],
            "line 16: link `carousel`: <inertial> must have <m",
        ),
        (
            [('<mass value="40"/>', '<mass value="-1"/>')],
            "line 18: link `carousel`: the ma",
        ),
        (
            [('ixx="0.8"', "")],
            "line 19: link `carousel`: `ixx` of <inertia> must be a num",
        ),
        (
            [('iyy="0.9"', 'iyy="inf"')],
            '`iyy` of <inertia> must be a number, but is "inf"',
        ),
        (
            [('lower="-2.0943951023931953"', 'lower="2"')],
            "line 23: joint `A2` must have an "
            "upper limit above the lower one, but has 1.0472 and 2",
        ),
        (
            [('velocity="3.141592653589793"', "")],
            "`A3` must have a positive limit `vel",
        ),
        (
            [('velocity="3.141592653589793"', 'velocity="0"')],
            "`velocity` [rad/s] or [m/s], but has 0",
        ),
        ([('type="revolute"', 'type="planar"')], "joint `A1` is planar"),
        ([("<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot')], "DOCTYPE"),
        (
            [("</robot>", '<x:a xmlns:x="http://www.ros.org/wiki/xacro"/></robot>')],
            "xacro",
        ),
    ],
)
def test_refusal_names_the_line(changes, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        arm_from_urdf(edited(*changes))
    assert str(error.value).startswith("URDF text, line ")


def test_refusal_names_the_file(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(edited(("<axis xyz", "<axis")), encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(f"{path}, line 12: ")):
        arm_from_urdf(path)
    with pytest.raises(ValueError, match="cannot be read: No such file"):
        arm_from_urdf(tmp_path / "absent.urdf")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"base": "x"}, "`base` must be one of the links base_link, carousel"),
        ({"base": "flange"}, "no joint lies behind `flange`"),
        (
            {"base": "forearm", "tip": "carousel"},
            "`carousel` must lie behind `forearm`",
        ),
        ({"base": "forearm", "tip": "flange"}, "no joint moves between"),
    ],
)
def test_chain_must_be_there(options, message):
    with pytest.raises(ValueError, match=message):
        arm_from_urdf(URDF, **options)


def replaced(**changes):
    return CONTENT | changes


ONE, TWO, THREE = CONTENT["axes"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (replaced(axes=[ONE, TWO]), "must hold all moving joints .* `A3` is missing"),
        (replaced(axes=[ONE, TWO, THREE, THREE]), "must hold every joint once"),
        (replaced(axes=[ONE, TWO, THREE | {"name": "A4"}]), "but one is `A4`"),
        (replaced(axes=[ONE, TWO, THREE | {"d": 1.0}]), r"`axes\[3\].d` is unknown"),
        (replaced(axes=[ONE, TWO, {"name": "A3"}]), "`axes.3..limits_deg` is missing"),
        (replaced(tip_link="x"), "`tip` must be one of the links"),
        (replaced(colour="red"), "`colour` is unknown"),
    ],
)
def test_content_is_refused(content, message):
    with pytest.raises(ValueError, match=message):
        robot_from_urdf(URDF, content)


def test_robot_refuses(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(
        BESIDE.read_text(encoding="utf-8").replace("ratio = 80.0", "ratio = 0")
    )
    with pytest.raises(ValueError, match=re.escape(f"{path}: `axes[3].gear.ratio`")):
        robot_from_urdf(URDF, path)
    sliding = edited(
        ('<joint name="A3" type="revolute">', '<joint name="A3" type="prismatic">')
    )
    with pytest.raises(ValueError, match="line 38: joint `A3` is prismatic"):
        robot_from_urdf(sliding, CONTENT)
    negative = edited((TENSOR, TENSOR.replace('ixx="0.15"', 'ixx="-0.15"')))
    with pytest.raises(
        ValueError, match="line 30: link `link arm` must not have negative"
    ):
        robot_from_urdf(negative, CONTENT)


def test_without_yourdfpy(monkeypatch):
    monkeypatch.setitem(sys.modules, "yourdfpy", None)
    with pytest.raises(ImportError, match=re.escape("pip install 'elastax[urdf]'")):
        arm_from_urdf(URDF)
    with pytest.raises(ValueError, match=re.escape("pip install 'elastax[urdf]'")):
        named_robot(URDF)
