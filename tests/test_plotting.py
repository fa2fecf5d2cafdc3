"""Figures: what they draw, with what labels, and what they refuse."""

import functools

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from elastax import plotting
from elastax.analysis import judge
from elastax.control import Run
from elastax.drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    LinearStiffness,
    Motor,
)
from elastax.dynamics import (
    Axis,
    Body,
    ElasticJoint,
    ElasticRobot,
    JointLimits,
    MotorCommand,
    Offset,
    SimulationResult,
    assemble,
)
from matplotlib.figure import Figure


TIMES = np.linspace(0.0, 1.5, 151)
ELASTIC = ("tilt 1 x", "tilt 1 y", "link arm torsion", "link arm lateral")
SIZES = {"rigid": 3e-3, "flexible_joint": 1e-3, "asim": 1e-4}
PATH = np.stack([0.1 * np.sin(TIMES), 0.1 * np.cos(TIMES), 0.0 * TIMES], axis=1)


@functools.cache
def plant() -> ElasticRobot:
    """Two axes, each with two elastic coordinates behind it."""
    parts = []
    for k in range(2):
        parts.append(Axis(f"A{k + 1}"))
        for name, axis in zip(ELASTIC[2 * k : 2 * k + 2], np.eye(3)[:2]):
            parts.append(ElasticJoint(name, tuple(axis), 1e5, 1e2))
        parts.append(Body(f"link {k + 1}", 10.0, (0.5, 0.0, 0.0), np.eye(3)))
        parts.append(Offset((1.0, 0.0, 0.0)))
    drives = DriveTrain(
        ratio=np.array([-100.0, 50.0]),
        motor=Motor(np.ones(2)),
        stiffness=LinearStiffness(np.full(2, 1e5)),
        damping=np.ones(2),
        motor_friction=CoulombViscousFriction(np.zeros(2), np.zeros(2), np.ones(2)),
        joint_friction=CoulombViscousFriction(np.zeros(2), np.zeros(2), np.ones(2)),
    )
    two = np.ones(2)
    limits = JointLimits(-two, two, two, two, two)
    return assemble(
        "two axes", parts, drives, limits, axis_signs=two, axis_zeros=0 * two, poses={}
    )


def run(size: float, elastic: bool = True) -> Run:
    """A run whose tool is off by a decaying oscillation of a given size [m]."""
    wave = np.exp(-3.0 * TIMES) * np.cos(20.0 * TIMES)
    per_axis = jnp.asarray(np.stack([wave, 2.0 * wave], axis=1))
    eta = jnp.asarray(1e-3 * np.outer(wave, np.arange(1.0, 5.0)))
    pose = np.tile(np.eye(4), (len(TIMES), 1, 1))
    pose[:, :3, 3] = PATH + size * wave[:, None]
    six = jnp.zeros((len(TIMES), 6))
    simulation = SimulationResult(
        jnp.asarray(TIMES), per_axis, eta, 0.9 * per_axis, per_axis, eta, per_axis,
        per_axis, eta, per_axis, 1e3 * per_axis, 1e4 * per_axis, jnp.asarray(pose),
        six, six, jnp.asarray(100.0 * size * np.stack([wave] * 3, 1)),
        jnp.zeros((), int),
    )  # fmt: skip
    command = MotorCommand(
        jnp.asarray(TIMES), 0.9 * per_axis, per_axis, per_axis, per_axis, per_axis,
        per_axis, eta if elastic else eta[:, :0],
    )  # fmt: skip
    judgement = judge(plant(), simulation, jnp.asarray(PATH), jnp.asarray(0.5))
    return Run(command, simulation, judgement)


@pytest.fixture(scope="module")
def runs():
    return {name: run(size, name == "asim") for name, size in SIZES.items()}


def texts(figure: Figure) -> str:
    found = figure.findobj(matplotlib.text.Text)
    return "\n".join(text.get_text() for text in found)


def drawn(axes, colour: str) -> list[np.ndarray]:
    """Ordinates of the lines of one colour."""
    return [
        np.asarray(line.get_ydata())
        for line in axes.lines
        if line.get_color() == colour and len(line.get_ydata()) > 2
    ]


def is_picture(path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 5000


def test_path_error(runs, tmp_path):
    before = dict(matplotlib.rcParams)
    figure = plotting.plot_path_error(runs)
    linear, log = figure.axes
    for name, run in runs.items():
        (line,) = drawn(linear, plotting._style.COLOURS[name])
        np.testing.assert_allclose(line, 1e3 * np.asarray(run.judgement.path_error))
    assert log.get_yscale() == "log"
    written = texts(figure)
    for word in ("[mm]", "[s]", "$t_0$", "0.9 s", "rigid", "RLFJ", "ASIM", "mm s"):
        assert word in written
    marks = {round(float(line.get_xdata()[0]), 9) for line in linear.lines[3:]}
    assert marks == {0.5, 1.4}
    plotting.save_figure(figure, tmp_path / "figure.png")
    assert is_picture(tmp_path / "figure.png")
    assert dict(matplotlib.rcParams) == before


def test_wrist_acceleration_shows_the_window(runs):
    figure = plotting.plot_wrist_acceleration(runs)
    assert len(figure.axes) == 3
    inside = TIMES >= 0.5
    for k, axes in enumerate(figure.axes):
        largest = np.asarray(runs["rigid"].simulation.wrist_acceleration)[inside, k]
        low, high = axes.get_ylim()
        assert low < largest.min() < largest.max() < high
        assert axes.get_xlim()[0] == pytest.approx(0.4)
    assert "C = " in texts(figure)
    assert "[m/s²]" in texts(figure)


def test_tool_deviation(runs):
    figure = plotting.plot_tool_deviation(runs, PATH)
    wave = np.exp(-3.0 * TIMES) * np.cos(20.0 * TIMES)
    (line,) = drawn(figure.axes[1], plotting._style.COLOURS["asim"])
    np.testing.assert_allclose(line, 0.1 * wave, atol=1e-12)  # rounding of 0.1 m
    with pytest.raises(ValueError, match="`tool_path` must have the shape"):
        plotting.plot_tool_deviation(runs, PATH[1:])


def test_cartesian_path_names_the_magnification(runs):
    figure = plotting.plot_cartesian_path(runs, PATH, magnification=20)
    assert "magnified 20 times" in texts(figure)
    path = figure.axes[0]
    assert (path.get_xlabel(), path.get_ylabel()) == ("x [m]", "y [m]")
    wave = np.exp(-3.0 * TIMES) * np.cos(20.0 * TIMES)
    (line,) = drawn(path, plotting._style.COLOURS["rigid"])
    np.testing.assert_allclose(line, PATH[:, 1] + 20 * 3e-3 * (wave - 1), rtol=1e-9)
    automatic = plotting.plot_cartesian_path(runs, PATH)
    # the largest deviation is sqrt(3) 3 mm * about 1.7, the extent 100 mm
    assert "magnified 1 times" in texts(automatic)


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 2.0, 0.5)])
def test_plane_holds_the_path(normal):
    normal = np.array(normal) / np.linalg.norm(normal)
    basis = np.linalg.svd(normal[None])[2][1:]
    angle = np.linspace(0, 6, 50)
    path = np.stack([np.cos(angle), 0.7 * np.sin(angle)], 1) @ basis + 3.0
    plane, names = plotting._paths._plane(path)
    np.testing.assert_allclose(plane @ plane.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(plane @ normal, 0, atol=1e-12)
    assert len(names) == 2


@pytest.mark.parametrize(
    ("value", "rounded"), [(7.3, 5), (0.21, 0.2), (1.0, 1), (999.0, 500), (np.inf, 1)]
)
def test_round_down(value, rounded):
    assert plotting._paths._round_down(value) == pytest.approx(rounded)


def test_deformations(runs):
    figure = plotting.plot_deformations(plant(), runs)
    written = texts(figure)
    for word in (
        "tilt",
        "link arm",
        "wind-up",
        "plant",
        "[mrad]",
        "relative",
        *ELASTIC,
    ):
        assert word in written
    wave = np.exp(-3.0 * TIMES) * np.cos(20.0 * TIMES)
    lines = drawn(figure.axes[1], plotting._style.CYCLE[0])
    for line in lines:
        np.testing.assert_allclose(line, 3.0 * wave, rtol=1e-12)
    assert len(lines) == 2
    windup = drawn(figure.axes[2], plotting._style.CYCLE[1])
    np.testing.assert_allclose(windup[0], 1e3 * 0.2 * wave, rtol=1e-9, atol=1e-12)
    with pytest.raises(ValueError, match='"rigid" does not'):
        plotting.plot_deformations(plant(), runs, inverse="rigid")


def test_torques_are_on_their_sides(runs):
    figure = plotting.plot_torques(plant(), runs)
    assert len(figure.axes) == 4
    wave = np.exp(-3.0 * TIMES) * np.cos(20.0 * TIMES)
    (motor,) = drawn(figure.axes[0], plotting._style.COLOURS["asim"])
    (gear,) = drawn(figure.axes[3], plotting._style.COLOURS["asim"])
    np.testing.assert_allclose(motor, -10.0 * wave, rtol=1e-12)
    np.testing.assert_allclose(gear, 20.0 * wave, rtol=1e-12)


def grid(number: int):
    angles = np.linspace(-1.0, 1.0, number)
    poses = np.array([[0.0, a, b] for a in angles for b in angles])
    moves = np.deg2rad([[5.0, 5.0, 5.0], [20.0, 0.0, -10.0]])
    base = 1.0 + np.stack([poses[:, 1] ** 2, poses[:, 2] ** 2])
    return poses, moves, {"flexible_joint": base, "asim": 0.1 * base}


def test_pose_grid(tmp_path):
    poses, moves, criterion = grid(3)
    criterion["asim"][0, 4] = np.nan  # a pose without result is left out
    figure = plotting.plot_pose_grid(poses, moves, criterion)
    written = texts(figure)
    for word in (
        "A2 [deg]",
        "A3 [deg]",
        "A1 to A3: +5°",
        "A1 +20°, A3 -10°",
        "C [m/s]",
    ):
        assert word in written
    assert written.count("0.10") >= 17
    circles = figure.axes[1].collections[-1].get_offsets()
    assert circles.shape == (8, 2)
    assert np.max(circles) == pytest.approx(np.rad2deg(1.0))
    plotting.save_figure(figure, tmp_path / "grid.png")
    assert is_picture(tmp_path / "grid.png")


@pytest.mark.parametrize("number", [1, 2, 7])
def test_pose_grid_of_any_size(number, tmp_path):
    poses, moves, criterion = grid(number)
    criterion["asim"] = 30.0 * criterion["asim"]  # worse than the flexible joint
    plotting.save_figure(
        plotting.plot_pose_grid(poses, moves, criterion), tmp_path / "grid.png"
    )
    assert is_picture(tmp_path / "grid.png")


def test_pose_grid_on_a_line_and_of_one_inverse(tmp_path):
    poses, moves, criterion = grid(3)
    line = {"asim": criterion["asim"][:, :3]}
    figure = plotting.plot_pose_grid(poses[:3], moves, line)
    plotting.save_figure(figure, tmp_path / "grid.png")
    assert is_picture(tmp_path / "grid.png")
    assert "over" not in figure.axes[0].get_title()


def test_pose_grid_refuses_other_shapes():
    poses, moves, criterion = grid(3)
    with pytest.raises(ValueError, match=r"\(moves, poses\) = \(1, 9\)"):
        plotting.plot_pose_grid(poses, moves[:1], criterion)
    with pytest.raises(ValueError, match="at least one inverse"):
        plotting.plot_pose_grid(poses, moves, {})


def test_recording():
    times = np.linspace(0, 5, 100)
    torque = np.sin(times)[:, None] * np.array([[1.0, 2.0, 3.0]])
    figure = plotting.plot_recording(
        times,
        torque,
        0.9 * torque,
        stored_torque=0.5 * torque,
        measured_windup=1e-3 * torque,
        predicted_windup=1.1e-3 * torque,
        torque_r2=[0.9, 0.8, 0.7],
        windup_r2=[0.6, 0.5, 0.4],
    )
    written = texts(figure)
    for word in ("measured", "predicted", "stored", "[mrad]", "R² = 0.800", "0.400"):
        assert word in written
    (line,) = drawn(figure.axes[5], plotting._style.COLOURS["asim"])
    np.testing.assert_allclose(line, 3.3 * np.sin(times), rtol=1e-12)
    alone = plotting.plot_recording(times, torque, torque)
    assert len(alone.axes) == 3
    assert "wind-up" not in texts(alone)


def test_perturbations():
    ratios = {"nominal": 0.11, "stiffness +20 %": 0.31, "payload -20 %": 1.2}
    figure = plotting.plot_perturbations(ratios, limit=0.15)
    (axes,) = figure.axes
    assert [bar.get_width() for bar in axes.patches] == list(ratios.values())
    assert axes.get_xlim()[1] > 1.2
    for word in (*ratios, "limit 0.15", "RLFJ = 1"):
        assert word in texts(figure)
