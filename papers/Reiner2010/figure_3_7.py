"""Figure 3.7: nonlinear inverse with outputs inside of the beams. [Reiner2010], p. 52.

Two beams in a vertical plane (figure 3.6). The inverse model has one bending mode per
beam and as outputs the tangential displacements at xi = 0.9 of both; its torques drive
a plant with three modes per beam, without any feedback, from the start angles of the
inverse. A ramp through a Bessel filter, turned into displacements by the rigid
kinematics, is what the outputs follow exactly.

The text gives no parameters: those of `robots.two_beams` are assumed, and the figure is
reproduced in shape. Its findings: the end follows closely with a slight tremble, drifts
off after the motion as no rest position is held, and there is no stable inverse for
xi > 0.9. Tangential displacement is here the absolute angle of the line from the joint
to the point, times the distance: with it the first right zero appears between 0.91 and
0.92 for our numbers; with angles relative to the first beam's end there would be none.
"""

import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import (
    AbstractSensor,
    MotorTorques,
    NodePoint,
    RobotChannel,
    linear_robot,
    transmission_zeros,
)
from elastax.dynamics import forward_dynamics, static_equilibrium
from elastax.kinematics import forward_kinematics
from elastax.plotting import save_figure
from elastax.robots import two_beams
from elastax.signals import BesselFilter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


PLACE, BEYOND = 0.9, 0.95
PLACES = (0.85, 0.9, 0.91, 0.92, 0.95)
START, CHANGE = np.array([-0.3, 0.1]), np.array([0.5, 0.4])  # absolute angles [rad]
RAMP, END, STEP = 0.4, 1.5, 1e-4  # [s]
FILTER = BesselFilter(4, 6.0)  # order, [Hz]


class TangentialDisplacements(AbstractSensor):
    """Angles of the lines from the joints to a node of both beams, times the distance.

    Attributes:
        node: index of the node.
    """

    node: jax.Array

    def measure(self, robot, q, eta, theta):
        at = lambda node, link: NodePoint(node, link, (0, 1)).measure(
            robot, q, eta, theta
        )
        nodes = robot.modal_links[0].body.nodes
        hinge = at(nodes.index("tip"), 0)
        first, second = at(self.node, 0), at(self.node, 1) - hinge
        reach = nodes.position[self.node, 0]
        angles = [jnp.arctan2(p[1], p[0]) for p in (first, second)]
        return reach * jnp.stack(angles)

    def names(self, robot):
        return ("tangential 1 [m]", "tangential 2 [m]")


def node_at(robot, place: float) -> jax.Array:
    """Index of the node at a fraction of the length."""
    position = np.asarray(robot.modal_links[0].body.nodes.position)[:, 0]
    return jnp.asarray(int(np.argmin(np.abs(position - place * position.max()))))


def reference(times: np.ndarray) -> np.ndarray:
    """Absolute angles and their first two derivatives, (times, 3, 2)."""
    ramp = START + CHANGE * np.clip((times - 0.1) / RAMP, 0.0, 1.0)[:, None]
    return np.moveaxis(np.asarray(FILTER.apply(ramp, STEP, 2)), 0, 1)


def rate(robot, x, torque):
    """Rate of the state (q, eta, q', eta')."""
    n, m = robot.axes, robot.elastic
    q, eta, qd, etad = jnp.split(x, [n, n + m, 2 * n + m])
    qdd, etadd, _ = forward_dynamics(robot, q, eta, q, qd, etad, qd, torque)
    return jnp.concatenate([qd, etad, qdd, etadd])


def outputs(robot, sensor, x):
    """Displacements of a state."""
    n, m = robot.axes, robot.elastic
    return sensor.measure(robot, x[:n], x[n : n + m], x[:n])


def torques(robot, sensor, x, wanted):
    """Torques under which the outputs follow `wanted`, (3, 2), with an error's decay.

    (3.12), (3.16): the outputs have relative degree two.
    """
    value = lambda x: outputs(robot, sensor, x)
    still = jnp.zeros((2,))
    speed = lambda x: jax.jvp(value, (x,), (rate(robot, x, still),))[1]
    drift = jax.jvp(speed, (x,), (rate(robot, x, still),))[1]
    slope = jax.jacfwd(speed)(x)
    gain = slope @ jax.jacfwd(lambda u: rate(robot, x, u))(still)
    pull = 200.0 * (wanted[1] - speed(x)) + 1e4 * (wanted[0] - value(x))
    return jnp.linalg.solve(gain, wanted[2] + pull - drift)


def start_state(robot, sensor, y):
    """The state at rest with given outputs, by Newton's method on the angles."""

    def settled(q):
        q, eta = static_equilibrium(robot, q)
        return jnp.concatenate([q, eta, jnp.zeros_like(q), jnp.zeros_like(eta)])

    q = jnp.asarray([START[0], START[1] - START[0]])
    for _ in range(6):
        off = lambda q: outputs(robot, sensor, settled(q)) - y
        q = q - jnp.linalg.solve(jax.jacfwd(off)(q), off(q))
    return settled(q)


def runge_kutta(function, x, step, inputs):
    """One step, with inputs at its start, middle and end.

    Its four stages are a loop: one copy of the function to compile.
    """

    def stage(carry, how):
        slope, total = carry
        ahead, weight, u = how
        slope = function(x + ahead * step * slope, u)
        return (slope, total + weight * slope), None

    ahead = jnp.array([0.0, 0.5, 0.5, 1.0])
    weight = jnp.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    at = inputs[np.array([0, 1, 1, 2])]
    none = jnp.zeros_like(x)
    (_, total), _ = jax.lax.scan(stage, (none, none), (ahead, weight, at))
    return x + step * total


@eqx.filter_jit
def invert(robot, sensor, wanted):
    """States of the inverse model and its torques at every other time of `wanted`."""
    x = start_state(robot, sensor, wanted[0, 0])
    held = lambda x, y: rate(robot, x, torques(robot, sensor, x, y))

    def step(x, three):
        return runge_kutta(held, x, 2.0 * STEP, three), (
            x,
            torques(robot, sensor, x, three[0]),
        )

    windows = jnp.stack([wanted[:-2:2], wanted[1:-1:2], wanted[2::2]], axis=1)
    return jax.lax.scan(step, x, windows)[1]


@eqx.filter_jit
def drive(plant, start, torque):
    """States of the plant under torques that are linear between the samples."""

    # small steps for the fast modes
    share = (jnp.arange(4.0)[:, None] + jnp.array([0.0, 0.5, 1.0])[None]) / 4.0

    def small(x, inputs):
        return runge_kutta(lambda x, u: rate(plant, x, u), x, 0.5 * STEP, inputs), None

    def step(x, pair):
        first, change = pair[0][None, None], (pair[1] - pair[0])[None, None]
        inputs = first + share[..., None] * change
        x, _ = jax.lax.scan(small, x, inputs)
        return x, x

    return jax.lax.scan(step, start, jnp.stack([torque[:-1], torque[1:]], axis=1))[1]


@eqx.filter_jit
def tool(robot, x):
    """Position of the end [m]."""
    n, m = robot.axes, robot.elastic
    coordinates = robot.joint_coordinates(x[:n], x[n : n + m])
    return forward_kinematics(robot.chain, coordinates)[:2, 3]


@eqx.filter_jit
def worst_zero(robot, node):
    """Largest real part of a zero of the inverse model at the start [1/s]."""
    channel = RobotChannel(MotorTorques((0, 1)), TangentialDisplacements(node))
    theta = jnp.asarray([START[0], START[1] - START[0]])
    model = linear_robot(robot, theta, channel)
    zeros = transmission_zeros(model.A, model.B, model.C, model.D, (2, 2))
    return jnp.max(zeros.real)


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Tracking of the plant, and where the inverse turns unstable.

    Args:
        path: of a PNG to write.
    """
    inverse = two_beams(1, loaded_modes=False, outputs=PLACES)
    plant = two_beams(3, loaded_modes=False)
    times = STEP * np.arange(round(END / STEP) + 1)
    angles = reference(times)
    found, runs = {}, {}
    for place in PLACES:
        zero = float(worst_zero(inverse, node_at(inverse, place)))
        found[f"largest real part of a zero, xi = {place:g} [1/s]"] = zero
    for place in (PLACE, BEYOND):
        sensor = TangentialDisplacements(node_at(inverse, place))
        states, torque = invert(inverse, sensor, jnp.asarray(place * angles))
        runs[place] = np.asarray(states), np.asarray(torque)
        size = np.abs(runs[place][1])
        found[f"largest torque, xi = {place:g} [N m]"] = float(
            np.nanmax(np.where(np.isfinite(size), size, np.inf))
        )
    states, torque = runs[PLACE]
    n = inverse.axes
    q, eta = jax.jit(static_equilibrium)(plant, jnp.asarray(states[0, :n]))
    start = jnp.concatenate([q, eta, 0.0 * q, 0.0 * eta])
    driven = np.asarray(drive(plant, start, jnp.asarray(torque)))
    ends = np.asarray(jax.vmap(lambda x: tool(plant, x))(jnp.asarray(driven)))
    later = angles[2 : 2 * len(driven) + 1 : 2, 0]
    ideal = np.cumsum(np.stack([np.cos(later), np.sin(later)], axis=2), axis=1)[:, 1]
    error = np.linalg.norm(ends - ideal, axis=1)
    moving = np.arange(len(error)) * 2 * STEP < 0.1 + RAMP + 0.2
    found["length of the motion of the end [m]"] = float(
        np.sum(np.linalg.norm(np.diff(ideal, axis=0), axis=1))
    )
    found["largest error of the end during the motion [m]"] = float(error[moving].max())
    found["error of the end 1.5 s after the start [m]"] = float(error[-1])
    for name, value in found.items():
        print(f"{name:<52} {value:12.5g}")
    print("theirs: follows closely, drifts afterwards, no stable inverse for xi > 0.9")
    if path is not None:
        save_figure(plot(times[2::2][: len(ends)], runs, ends, ideal), path)
    return found


def plot(times, runs, ends, ideal) -> Figure:
    """Torques of both inverses, the end of the plant, and its error."""
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    first, beyond, end, error = figure.subplots(4, 1, sharex=True)
    for axes, place in ((first, PLACE), (beyond, BEYOND)):
        torque = runs[place][1]
        for k in range(2):
            axes.plot(
                2 * STEP * np.arange(len(torque)), torque[:, k], label=f"joint {k + 1}"
            )
        axes.set_ylabel(f"torque [N m]\noutputs at {place:g}")
    size = 3.0 * np.abs(runs[PLACE][1]).max()
    beyond.set_ylim(-size, size)
    for k, name in enumerate("xy"):
        end.plot(times, ends[:, k], label=f"plant, {name}")
        end.plot(times, ideal[:, k], "k:", lw=1.0)
    end.plot([], [], "k:", label="wanted")
    end.set_ylabel("end [m]")
    error.plot(times, 1e3 * np.linalg.norm(ends - ideal, axis=1))
    error.set_ylabel("error of the end [mm]")
    error.set_xlabel("time [s]")
    for axes in (first, beyond, end, error):
        axes.grid(alpha=0.3)
    first.legend(fontsize=9)
    end.legend(fontsize=9)
    figure.suptitle(
        "Figure 3.7: inverse with one mode drives three (parameters assumed)"
    )
    return figure


if __name__ == "__main__":
    import sys

    jax.config.update("jax_enable_x64", True)
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)
