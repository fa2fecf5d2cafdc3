"""Pictures of what bends: mode shapes, the deformed robot, deflection, animation."""

import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from .._taylor import leading
from ..dynamics import ElasticRobot
from ..kinematics import forward_kinematics, moving_frames
from ..structure import ModalBody
from ._style import CYCLE, INK, new_figure


def skeleton(robot: ElasticRobot, q, eta):
    """Points along the robot, from base to tool, shape (points, 3) [m].

    Origins of the joints, and the nodes of flexible bodies in between, moved by the
    modes to second order.

    Args:
        robot: the robot.
        q: joint angles [rad], shape (axes,).
        eta: elastic coordinates, shape (elastic,).
    """
    coordinates = robot.joint_coordinates(q, eta)
    frames = moving_frames(robot.chain, coordinates)
    rotation, position = leading(frames.rotation), leading(frames.position)
    points = [jnp.zeros(3)]
    for k in range(robot.chain.number):
        points.append(position[k])
        for link in robot.modal_links:
            if link.joint != k:
                continue
            nodes = link.body.nodes
            order = np.argsort(np.linalg.norm(np.asarray(nodes.position), axis=1))
            for node in order:
                moved = nodes.position[node]
                moved = moved + nodes.displacement(int(node), link.of(eta))
                points.append(position[k] + rotation[k] @ moved)
    points.append(forward_kinematics(robot.chain, coordinates)[:3, 3])
    return jnp.stack(points)


def plot_deformed(robot: ElasticRobot, q, eta, *, magnification: float = 1.0) -> Figure:
    """The robot with its deformations enlarged, above the undeformed one.

    Args:
        robot: the robot.
        q: joint angles [rad].
        eta: elastic coordinates.
        magnification: factor of the deformations that are drawn.
    """
    q, eta = jnp.asarray(q), jnp.asarray(eta)
    bent = np.asarray(skeleton(robot, q, magnification * eta))
    plain = np.asarray(skeleton(robot, q, 0.0 * eta))
    title = f"{robot.name}: deformations {magnification:g} times enlarged"
    figure, _ = new_figure(title, 1, 1, 7.0, width=8.0, subplot_kw={"projection": "3d"})
    (axes,) = figure.axes
    _draw(axes, plain, color="#aaaaaa", label="undeformed")
    _draw(axes, bent, color=CYCLE[0], label="deformed")
    axes.legend(fontsize=9)
    _frame(axes, np.concatenate([plain, bent]))
    return figure


def plot_modes(body: ModalBody, *, number: int = 4) -> Figure:
    """Displacements and rotations of a body's nodes in its first modes.

    Args:
        body: a body with nodes along its longest direction.
        number: of modes.

    Raises:
        ValueError: the body has fewer than three nodes.
    """
    if body.nodes.number < 3:
        raise ValueError(
            f"`{body.name}` has {body.nodes.number} nodes: a picture of its modes "
            "needs three at least, such as `modal_beam(..., nodes=(0.25, 0.5, 0.75))`"
        )
    position = np.asarray(body.nodes.position)
    axis = int(np.argmax(np.ptp(position, axis=0)))
    order = np.argsort(position[:, axis])
    x = position[order, axis]
    shapes = {"displacement": body.nodes.phi, "rotation": body.nodes.psi}
    number = min(number, body.modes)
    figure, panels = new_figure(
        f"Modes of {body.name}", number, 2, 1.2 + 1.6 * number, sharex=True
    )
    panels = np.reshape(panels, (number, 2))
    hertz = np.sqrt(np.maximum(np.diag(np.asarray(body.K_e)), 0.0))
    hertz = hertz / np.sqrt(np.diag(np.asarray(body.M_e))) / (2 * np.pi)
    for mode in range(number):
        for column, (what, values) in enumerate(shapes.items()):
            axes = panels[mode, column]
            for a, letter in enumerate("xyz"):
                curve = np.asarray(values)[order, a, mode]
                axes.plot(x, curve, ".-", label=letter if mode == 0 else None)
            unit = "m" if what == "displacement" else "rad"
            axes.set_ylabel(f"{what}\n[{unit} per unit]", fontsize=8.5)
            name = f"{body.mode_names[mode]}: {hertz[mode]:.4g} Hz"
            axes.set_title(name, fontsize=9.5, loc="left", color=INK)
    for axes in panels[-1]:
        axes.set_xlabel(f"{'xyz'[axis]} along the body [m]")
    panels[0, 0].legend(fontsize=8)
    return figure


def plot_deflection(robot: ElasticRobot, times, q, eta) -> Figure:
    """Displacement of the tool by the deformations, over time.

    Args:
        robot: the robot.
        times: [s], shape (times,).
        q: joint angles, shape (times, axes).
        eta: elastic coordinates, shape (times, elastic).
    """

    def off(q, eta):
        tool = lambda eta: forward_kinematics(
            robot.chain, robot.joint_coordinates(q, eta)
        )[:3, 3]
        return tool(eta) - tool(0.0 * eta)

    moved = 1e3 * np.asarray(jax.vmap(off)(jnp.asarray(q), jnp.asarray(eta)))
    figure, panels = new_figure(f"Deflection of the tool of {robot.name}", 1, 1, 3.6)
    axes = np.ravel(panels)[0]
    for a, letter in enumerate("xyz"):
        axes.plot(np.asarray(times), moved[:, a], label=f"{letter}, base frame")
    axes.set_ylabel("deflection [mm]")
    axes.set_xlabel("time [s]")
    axes.legend(fontsize=8.5)
    return figure


def animate(
    robot: ElasticRobot,
    times,
    q,
    eta,
    path: str | pathlib.Path,
    *,
    magnification: float = 1.0,
    frames: int = 60,
    rate: float = 20.0,
) -> None:
    """The moving robot with enlarged deformations, as GIF or HTML.

    Args:
        robot: the robot.
        times: [s], shape (times,).
        q, eta: joint angles and elastic coordinates, (times, axes), (times, elastic).
        path: ends in `.gif` or `.html`.
        magnification: factor of the deformations that are drawn.
        frames: number of pictures.
        rate: pictures per second.

    Raises:
        ValueError: another ending.
    """
    path = pathlib.Path(path)
    if path.suffix not in (".gif", ".html"):
        raise ValueError(f"`path` must end in .gif or .html, not `{path.suffix}`")
    chosen = np.linspace(0, len(times) - 1, frames).round().astype(int)
    q, eta = jnp.asarray(q)[chosen], jnp.asarray(eta)[chosen]
    points = jax.vmap(lambda q, eta: skeleton(robot, q, eta))
    bent = np.asarray(points(q, magnification * eta))
    plain = np.asarray(points(q, 0.0 * eta))
    figure, _ = new_figure(
        f"{robot.name}: deformations {magnification:g} times enlarged",
        1,
        1,
        5.5,
        width=6.5,
        subplot_kw={"projection": "3d"},
    )
    axes: Any = figure.axes[0]
    _frame(axes, np.concatenate([*plain, *bent]))
    lines = [
        _draw(axes, plain[0], color="#aaaaaa", label="undeformed"),
        _draw(axes, bent[0], color=CYCLE[0], label="deformed"),
    ]
    axes.legend(fontsize=8)
    clock = axes.text2D(0.02, 0.94, "", transform=axes.transAxes, fontsize=9)

    def show(k):
        for line, states in zip(lines, (plain, bent)):
            line.set_data_3d(*states[k].T)
        clock.set_text(f"t = {float(times[chosen[k]]):.3f} s")
        return [*lines, clock]

    film = FuncAnimation(figure, show, frames=frames, interval=1000.0 / rate)
    if path.suffix == ".gif":
        film.save(str(path), writer=PillowWriter(fps=round(rate)))
    else:
        path.write_text(film.to_jshtml(fps=round(rate)))


def _draw(axes, points: np.ndarray, **style) -> Any:
    (line,) = axes.plot(*points.T, ".-", lw=2.0, ms=4.0, **style)
    return line


def _frame(axes, points: np.ndarray) -> None:
    """Equal scales around all points."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = 0.5 * (low + high), 0.55 * float(np.max(high - low))
    for a, letter in enumerate("xyz"):
        getattr(axes, f"set_{letter}lim")(middle[a] - size, middle[a] + size)
        getattr(axes, f"set_{letter}label")(f"{letter} [m]", fontsize=8.5)
    axes.set_box_aspect((1, 1, 1))
