"""Figure 2.6 and table 2.1: smooth plays, hysteresis undone. [Reiner2010], pp. 25-26.

The text prints neither the input of its figure nor the width of the play in part (a).
Here the input is a triangle of falling height, held at the end, behind four lags of
20 ms, and the play has r = 0.25. Table 2.1 calls the third play P*_2 again and the
sharpness of H once s; it gives the smallest threshold of H as 0.1, which is a dead zone
of this width and has no inverse. The figures of the text are curves without numbers, so
what ours are compared with are exact results: the bias on a ramp, the dead zone, the
soft corner.

With the sharpness and the delay of the table the inverse undoes little of H: slower
input loses the memory, faster one feels the delay. A sharper play does it; what the
text calls high accuracy must rest on an input of another size or speed.
"""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import (
    AbstractSmoothPlay,
    DelayedPlay,
    PadeDelay,
    PrandtlIshlinskii,
    RateIndependentPlay,
)
from elastax.plotting import save_figure
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


# Table 2.1: delay [s], sharpness, order of the Pade approximant
TABLE = {"P*_1": (0.01, 50.0, 6), "P*_2": (0.01, 25.0, 3), "P*_3": (0.1, 25.0, 3)}
WEIGHTS = np.full(5, 0.2)
PRINTED = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
ZERO_FIRST = PRINTED - 0.1
WIDTH = 0.25  # of the play in (a)
CORNERS = np.array([0.0, 1.0, 3.0, 4.7, 6.1, 7.2, 8.0])  # [s]
HEIGHTS = np.array([0.0, 1.0, -1.0, 0.7, -0.7, 0.4, 0.4])
LAG = 0.02  # [s], four times
STEP = 2.5e-4  # [s]
TIMES = STEP * np.arange(round(CORNERS[-1] / STEP) + 1)
SPEED = 1.0  # of the first two sides of the triangle


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Deviations of the smooth plays and of the undone hysteresis.

    Args:
        path: of a PNG to write.
    """
    smooth: dict[str, AbstractSmoothPlay] = {
        name: DelayedPlay([[WIDTH]], [psi], PadeDelay(delay, order))
        for name, (delay, psi, order) in TABLE.items()
    }
    smooth["ours"] = RateIndependentPlay([[WIDTH]], [50.0], [1e-3])
    curves = {name: follow(play) for name, play in smooth.items()}
    u = next(iter(curves.values()))[0]
    curves = {name: outputs[:, 0] for name, (_, outputs) in curves.items()}
    exact = np.asarray(PrandtlIshlinskii([1.0], [WIDTH], [0.0]).apply(jnp.asarray(u)))
    ours, theirs = plays_in_numbers(curves, exact)
    undone, more, expected = compensation(u)
    ours |= more
    theirs |= expected

    print(f"{'deviation':<38} {'ours':>10} {'theirs':>10} {'difference':>11}")
    for name, value in ours.items():
        if name in theirs:
            difference = value - theirs[name]
            print(f"{name:<38} {value:10.5f} {theirs[name]:10.5f} {difference:11.1e}")
        else:
            print(f"{name:<38} {value:10.5f} {'-':>10} {'-':>11}")
    if path is not None:
        save_figure(plot(u, exact, curves, undone), path)
    return ours


@jax.jit
def follow(play, pace=1.0):
    """Input, and outputs of `play` along it, by Runge-Kutta's fourth order.

    Everything of the input happens `pace` times as fast.
    """
    step = STEP / pace

    def rates(t, state):
        lags, memory = state
        raw = jnp.interp(pace * t, CORNERS, HEIGHTS)
        lag_rates = (jnp.concatenate([raw[None], lags[:-1]]) - lags) * pace / LAG
        return lag_rates, play.rates(lags[-1:], lag_rates[-1:], memory)

    def moved(state, length, change):
        return jax.tree.map(lambda a, b: a + length * b, state, change)

    def advance(state, t):
        first = rates(t, state)
        second = rates(t + 0.5 * step, moved(state, 0.5 * step, first))
        third = rates(t + 0.5 * step, moved(state, 0.5 * step, second))
        fourth = rates(t + step, moved(state, step, third))
        mean = jax.tree.map(
            lambda a, b, c, d: (a + 2.0 * b + 2.0 * c + d) / 6.0,
            *(first, second, third, fourth),
        )
        lags, memory = state
        return moved(state, step, mean), (lags[-1], play.outputs(lags[-1:], memory))

    start = jnp.zeros(4), play.rest(jnp.zeros(1))
    _, (u, outputs) = jax.lax.scan(advance, start, jnp.asarray(TIMES) / pace)
    return u, outputs[..., 0]


def plays_in_numbers(curves, exact):
    """Deviations of part (a), and those that exact results give."""
    ours, theirs = {}, {}
    late = TIMES > 0.3
    for name, curve in curves.items():
        error = np.asarray(curve) - exact
        ours[f"(a) largest, {name}"] = float(np.max(np.abs(error[late])))
        # on the long falling side, past the corner and before the next turn
        ours[f"(a) on a ramp, {name}"] = float(-error[round(2.8 / STEP)])
        theirs[f"(a) on a ramp, {name}"] = 0.0
        if name in TABLE:
            delay, psi, _ = TABLE[name]
            bias = -np.log1p(-np.exp(-psi * SPEED * delay)) / psi
            theirs[f"(a) on a ramp, {name}"] = float(bias)
    theirs["(a) largest, ours"] = float(np.log(2.0) / 50.0)
    return ours, theirs


def compensation(u):
    """Input behind inverse and hysteresis, deviations, and what they must be."""
    proper = PrandtlIshlinskii(WEIGHTS, ZERO_FIRST, np.zeros(5))
    printed = PrandtlIshlinskii(WEIGHTS, PRINTED, np.zeros(5))
    inverse = proper.inverse()
    delay, psi, order = TABLE["P*_2"]
    widths = np.asarray(inverse.thresholds)[1:, None]
    inner = {
        "P*, psi = 25": DelayedPlay(widths, [psi], PadeDelay(delay, order)),
        "P*, psi = 250": DelayedPlay(widths, [10.0 * psi], PadeDelay(delay, order)),
        "ours, psi = 250": RateIndependentPlay(widths, [10.0 * psi], [1e-3]),
    }
    before = {"exact": inverse.apply(u)}
    for name, play in inner.items():
        _, outputs = follow(play)
        before[name] = inverse.weights[0] * u + outputs @ inverse.weights[1:]
    undone, ours = {"none": proper.apply(u)}, {}
    for name, x in before.items():
        undone[name] = proper.apply(x)
        ours[f"(b) zero first, {name}"] = largest(undone[name] - u)
        ours[f"(b) as printed, {name}"] = largest(printed.apply(x) - u)
    ours["(b) zero first, none"] = largest(undone["none"] - u)
    for name, pace in (("ten times as fast", 10.0), ("fifty times as fast", 50.0)):
        _, outputs = follow(inner["P*, psi = 25"], pace)
        x = inverse.weights[0] * u + outputs @ inverse.weights[1:]
        ours[f"(b) {name}, P*, psi = 25"] = largest(proper.apply(x) - u)
    theirs = {"(b) zero first, exact": 0.0, "(b) as printed, exact": 0.1}
    return undone, ours, theirs


def largest(error) -> float:
    return float(jnp.max(jnp.abs(error)))


def plot(u, exact, curves, undone) -> Figure:
    """The two parts of the figure: plays above, compensation below."""
    figure = Figure((9.6, 8.4), facecolor="white")
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    panels = figure.subplots(2, 2, width_ratios=(1.6, 1.0))
    colours = dict(zip(undone, ("#aa3377", "black", "C1", "C0", "C3"), strict=True))
    styles = {"P*_1": "-", "P*_2": "--", "P*_3": "-.", "ours": ":"}
    above, left = panels[0]
    above.plot(TIMES, u, color="#bbbbbb", label="input u")
    above.plot(TIMES, exact, color="black", linewidth=2.2, label="exact play")
    left.plot(u, exact, color="black", linewidth=2.2)
    for name, curve in curves.items():
        above.plot(TIMES, curve, styles[name], label=name)
        left.plot(u, curve, styles[name])
    below, right = panels[1]
    below.axhline(0.0, color="#bbbbbb", linewidth=1.0)
    for name, y in undone.items():
        if name != "none":
            below.plot(TIMES, y - u, color=colours[name], label=f"inverse: {name}")
        right.plot(u, y, color=colours[name], label=name)
    above.set(title="(a) smooth plays, r = 0.25", xlabel="t [s]", ylabel="y [-]")
    left.set(xlabel="u [-]", ylabel="y [-]")
    below.set(
        title="(b) hysteresis behind its inverse, thresholds from zero",
        xlabel="t [s]",
        ylabel="output - u [-]",
    )
    right.set(xlabel="u [-]", ylabel="output [-]")
    below.set_ylim(-0.21, 0.21)
    for axes, place in ((above, "lower left"), (below, "upper right"), (right, "best")):
        axes.legend(fontsize=8, framealpha=0.85, edgecolor="none", loc=place)
    for axes in panels.ravel():
        axes.grid(color="#e6e6e6", linewidth=0.7)
        axes.margins(x=0.01)
    return figure


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
