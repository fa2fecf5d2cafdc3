"""Figures of workspace and branches: what they draw, with what labels; the gallery."""

import importlib.util
import pathlib

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from elastax import plotting
from elastax.kinematics import forward_kinematics, moving_frames
from elastax.robots import kr210


SCRIPT = pathlib.Path(__file__).parents[1] / "examples" / "gallery_kinematics.py"


def texts(figure) -> str:
    found = figure.findobj(matplotlib.text.Text)
    return "\n".join(text.get_text() for text in found)


@pytest.fixture(scope="module")
def gallery():
    spec = importlib.util.spec_from_file_location("gallery_kinematics", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def robot():
    return kr210().rigid()


def test_reach_section():
    radius, angle = np.meshgrid(np.linspace(1, 2, 5), np.linspace(0, 3, 7))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    edge, stick = points[:, -1], np.array([[0.0, 0.0], [0.0, 3.0]])
    figure = plotting.plot_reach_section(
        points, {"stretched": edge}, sticks={"arm": stick}, point="tool"
    )
    (axes,) = figure.axes
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_array_equal(lines["stretched"], edge)
    np.testing.assert_array_equal(lines["arm"], stick)
    # everything is inside, the stick as well
    assert axes.get_ylim()[1] > 3.0 and axes.get_xlim()[0] < edge[:, 0].min()
    assert axes.get_aspect() == 1.0
    assert all(w in texts(figure) for w in ("x [m]", "z [m]", "Reach of the tool"))


def test_dexterity_section():
    x, z = np.linspace(-1, 1, 9), np.linspace(0, 1, 6)
    value = np.where(np.hypot(*np.meshgrid(x, z)) < 0.9, 0.5, np.nan)
    value[2, 4] = 0.8
    figure = plotting.plot_dexterity_section(
        x, z, value, notes={"here": (0.0, 0.4)}, label="measure [-]", title="Map"
    )
    axes, bar = figure.axes
    drawn = axes.collections[0].get_array()
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn), np.isnan(value))
    assert drawn.max() == 0.8 and bar.get_ylim() == (0.0, 0.8)
    assert all(w in texts(figure) for w in ("measure [-]", "here", "Map"))
    # nothing is reached: an empty map, no failure
    nothing = np.full_like(value, np.nan)
    plotting.plot_dexterity_section(x, z, nothing, label="a", title="b")


def test_branches_and_path(tmp_path):
    generator = np.random.default_rng(0)
    points = generator.uniform(-1, 1, (3, 5, 3))
    angles = np.deg2rad([[10.0, -0.2, 20], [30, 40, 50], [-10, -20, -30]])
    names = ["first", "second", "third"]
    figure = plotting.plot_branches(
        points, np.eye(3), angles, [True, False, True], names=names
    )
    written = texts(figure)
    assert all(name in written for name in names)
    assert "10°  0°  20°" in written and written.count("beyond a limit") == 1
    assert [panel.get_visible() for panel in figure.axes] == [True] * 3 + [False]
    way = np.linspace(0, 2, 4)
    along = np.repeat(angles[:, None], 4, axis=1) + way[:, None] * 0.1
    allowed = np.ones((3, 4), bool)
    allowed[1, 2:] = False
    limits = np.deg2rad([[-90.0, -90, -90], [90, 90, 90]])
    figure = plotting.plot_branch_path(
        way,
        along,
        allowed,
        limits,
        axis_names=["A1", "A2", "A3"],
        branch_names=names,
    )
    panel = figure.axes[1]
    solid = panel.lines[3].get_ydata()
    np.testing.assert_allclose(solid[:2], np.rad2deg(along[1, :2, 1]), rtol=1e-14)
    assert np.all(np.isnan(solid[2:]))
    assert all(w in texts(figure) for w in ("A3", "angle [deg]", "limit", "second"))
    plotting.save_figure(figure, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000


@pytest.mark.slow
def test_gallery(gallery, tmp_path):
    """Everything at low resolution; what is printed is what is known."""
    figures = gallery.main(tmp_path / "out", samples=24)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {
        "reach.png",
        "dexterity.png",
        "branches.png",
        "branch_path.png",
    }
    # 350 + 1150 + hypot(1200, 41) mm; the sweep passes it by some degrees
    reach = 0.35 + 1.15 + np.hypot(1.2, 0.041)
    assert 0.99 * reach < figures["farthest wrist centre from axis 1 [m]"] <= reach
    assert figures["branches within the limits [-]"] == 4
    assert 0.4 < figures["part of the section that is reached [-]"] < 0.8
    # 2.3 m in 23 steps without a jump
    assert figures["largest step along the path [deg]"] < 20


def test_gallery_stretched_angle(gallery, robot):
    """The arm is longest there: no angle beside it reaches farther."""
    angle = gallery.stretched_angle(robot)
    around = angle + np.deg2rad([-0.01, 0.0, 0.01])
    far = gallery.sweep(robot, np.zeros(1), around)[0]
    shoulder = np.array([0.35, 0.2256 + 0.4494])
    lengths = np.linalg.norm(far - shoulder, axis=1)
    assert lengths[1] > max(lengths[0], lengths[2])


@pytest.mark.slow
def test_gallery_branches_hold_the_pose(gallery, robot):
    points, axes, angles, allowed = gallery.branches(robot)
    q = jax.vmap(robot.from_maker)(jnp.asarray(angles))
    poses = jax.jit(jax.vmap(forward_kinematics, (None, 0)))(robot.chain, q)
    # rounding of the inverse
    np.testing.assert_allclose(
        poses, np.broadcast_to(poses[:1], poses.shape), atol=1e-12
    )
    np.testing.assert_allclose(points[:, -1], poses[:, :3, 3], atol=1e-14)
    # shared by all branches up to the sense of axis 5
    np.testing.assert_allclose(np.abs(axes @ axes[0]), 1.0, atol=1e-12)
    wrist = jax.jit(lambda x: moving_frames(robot.chain, x).position[robot.wrist])(q[0])
    np.testing.assert_allclose(points[:, -2], np.tile(wrist, (8, 1)), atol=1e-12)
    assert allowed.sum() == 4
