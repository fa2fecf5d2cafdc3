"""Pictures of what bends: points, labels, films, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax import plotting
from elastax.kinematics import forward_kinematics
from elastax.robots import three_axis_arm
from elastax.structure import (
    BeamSection,
    Material,
    ModeCounts,
    UniformBeam,
    modal_beam,
)

from tests.helpers import assert_close


BEAM = UniformBeam(
    Material(young=7e10, shear=2.6e10, density=2700.0),
    BeamSection.circular_tube(diameter=0.06, wall=0.003),
    0.9,
)


@pytest.fixture(scope="module")
def robot():
    return three_axis_arm(ModeCounts(1, 1, 1))


def test_skeleton_runs_from_base_to_tool(robot):
    q, eta = jnp.array([0.2, 0.5, -0.9]), jnp.array([0.01, -0.02, 0.001])
    points = np.asarray(plotting.skeleton(robot, q, eta))
    tool = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))[:3, 3]
    assert_close(points[0], np.zeros(3), rtol=0.0)
    assert_close(points[-1], tool, rtol=1e-13)
    # the tip of the beam is where the next joint begins, to second order
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.min(gaps[2:]) < 1e-3


def test_deformed_robot(robot):
    figure = plotting.plot_deformed(
        robot, [0.2, 0.5, -0.9], [0.01, -0.02, 0.001], magnification=20.0
    )
    (axes,) = figure.axes
    assert axes.get_xlabel() == "x [m]"
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["undeformed", "deformed"]
    assert "20 times" in figure._suptitle.get_text()


@pytest.mark.slow
def test_mode_shapes():
    body = modal_beam(BEAM, ModeCounts(2, 1, 1), nodes=(0.25, 0.5, 0.75))
    figure = plotting.plot_modes(body, number=4)
    assert len(figure.axes) == 8
    assert figure.axes[0].get_title(loc="left").startswith("xy 1: ")
    assert "[m]" in figure.axes[-1].get_xlabel()
    with pytest.raises(ValueError, match="needs three at least"):
        plotting.plot_modes(modal_beam(BEAM, ModeCounts(1)))


def test_deflection_and_film(robot, tmp_path):
    times = np.linspace(0.0, 1.0, 30)
    q = np.array([0.2, 0.5, -0.9])[None] * times[:, None]
    eta = 0.01 * np.sin(20.0 * times)[:, None] * np.ones((1, 3))
    figure = plotting.plot_deflection(robot, times, q, eta)
    assert figure.axes[0].get_ylabel() == "deflection [mm]"
    path = tmp_path / "arm.gif"
    plotting.animate(robot, times, q, eta, path, magnification=10.0, frames=3)
    assert path.read_bytes()[:6] == b"GIF89a"
    with pytest.raises(ValueError, match="must end in .gif or .html"):
        plotting.animate(robot, times, q, eta, tmp_path / "arm.mp4")
