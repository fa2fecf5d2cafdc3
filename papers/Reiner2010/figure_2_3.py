"""Figure 2.3: piecewise friction characteristic. [Reiner2010], section 2.2.

The figure shows (2.5), normalised to the friction at 1 rad/s, and the smooth zero
crossing enlarged. The text prints no parameters. Those below are a choice that gives
such a curve; with them the four conditions of continuous value and slope have the
coefficients p of the test vectors, solved there as a linear system of equations.
"""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import PiecewiseFriction
from elastax.plotting._style import CYCLE, new_figure, save_figure


REFERENCE = {
    "p1": 0.04046289408440477,
    "p2": -0.2407336942583197,
    "p3": 0.6400787062634251,
    "p4": 0.5601920939104897,
    "torque at 0.35 rad/s": 0.7564646101399132,
    "torque at 1 rad/s": 1.0,
}


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Coefficients and torques, ours beside the reference; the figure if asked.

    Args:
        path: of the PNG; none is written without it.
    """
    law = PiecewiseFriction(
        coulomb=0.62,
        steepness=60.0,
        step_speed=0.08,
        break_speed=1.0,
        break_torque=1.0,
        break_slope=0.28,
    )
    torque = lambda speed: float(law.torque(jnp.asarray(speed)))
    slope = lambda speed: float(jax.grad(law.torque)(jnp.asarray(speed)))
    ours = {f"p{k + 1}": float(p) for k, p in enumerate(law.coefficients())}
    ours["torque at 0.35 rad/s"] = torque(0.35)
    ours["torque at 1 rad/s"] = torque(1.0)
    ours["torque at the step speed"] = torque(0.08)
    ours["slope at rest"] = slope(0.0)
    inside = jnp.linspace(0.08, 1.0, 4001)
    ours["least slope of the cubic"] = float(
        jnp.min(jax.vmap(jax.grad(law.torque))(inside))
    )
    # Rounding aside, both transitions are smooth to first order.
    nearly = 1.0 - 1e-12
    ours["jump of the slope at the step speed"] = abs(
        slope(0.08) - slope(0.08 * nearly)
    )
    ours["jump of the slope at 1 rad/s"] = abs(slope(1.0 / nearly) - slope(nearly))

    print(f"{'normalised (2.5)':<36} {'ours':>12} {'reference':>12} {'difference':>11}")
    for name, value in ours.items():
        line = f"{name:<36} {value:12.8f}"
        if name in REFERENCE:
            line += f" {REFERENCE[name]:12.8f} {value - REFERENCE[name]:11.1e}"
        print(line)
    if path is not None:
        save_figure(_figure(law), path)
    return ours


def _figure(law):
    figure, (whole, crossing) = new_figure(
        "Friction characteristic (2.5), normalised to the friction at 1 rad/s",
        1,
        2,
        3.6,
    )
    step, end = float(law.step_speed), float(law.break_speed)
    sections = (
        ("zero crossing", 0.0, step),
        ("cubic", step, end),
        ("straight line", end, 2.0 * end),
    )
    for panel in (whole, crossing):
        for (label, first, last), colour in zip(sections, CYCLE, strict=False):
            speed = np.linspace(first, last, 400)
            torque = np.asarray(law.torque(jnp.asarray(speed)))
            style = {"color": colour, "linewidth": 1.8}
            panel.plot(speed, torque, label=label, **style)
            panel.plot(-speed, -torque, **style)
        panel.set_xlabel("speed [rad/s]")
    whole.set_ylabel("normalised friction torque [-]")
    whole.set_title("(a) whole range", fontsize=10)
    whole.plot([end], [float(law.break_torque)], "o", color="#333333", markersize=4)
    whole.legend(loc="upper left", fontsize=9, frameon=False)
    crossing.set_title("(b) zero crossing", fontsize=10)
    crossing.set_xlim(-0.2, 0.2)
    crossing.set_ylim(-0.8, 0.8)
    for side in (-step, step):
        crossing.axvline(side, color="#8a8468", linewidth=0.9, linestyle=(0, (3, 2)))
    crossing.annotate(
        r"$v_{step}$",
        (step, 0.72),
        (3, 0),
        textcoords="offset points",
        fontsize=9,
        color="#6b664f",
    )
    crossing.legend(
        *[part[:2] for part in crossing.get_legend_handles_labels()],
        loc="lower right",
        fontsize=9,
        facecolor="white",
        edgecolor="none",
        framealpha=1.0,
    )
    return figure


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
