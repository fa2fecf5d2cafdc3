"""Figures 3.16 and 3.17: simplifications of a flexible beam. [Reiner2010], p. 74.

A three-axis arm with a flexible beam behind axis 3 and an eccentric load; all axes
follow the same filtered sine. The text gives no parameters: those of
`robots.three_axis_arm` and of the motion here are assumed, the figures are reproduced
in shape. Compared are the position of the load and the force and moment at the clamp of
the beam, for (3.72) in full, for the five variants of the text and for a rigid beam.

The text's findings: leaving $C_t$ and $C_r$ out has the strongest effect, their zeroth
order (variant 5) is very close to the nominal solution, variants 1 to 4 differ only in
detail, and the rigid solution is far from all.
"""

import pathlib

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import ElasticRobot, cut_forces, equations_of_motion
from elastax.kinematics import forward_kinematics
from elastax.plotting import save_figure
from elastax.robots import three_axis_arm
from elastax.structure import BODY_DETAILS
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


AMPLITUDE, FREQUENCY, LAG = 0.35, 1.5, 0.05  # [rad], [Hz], [s] of the filter
POSE = np.array([0.0, 0.5, -0.9])  # around which the axes move [rad]
STEP, DURATION, KEPT = 1e-4, 2.0, 10  # [s], [s], every so many steps


def angles(t):
    """The same filtered sine on all axes: four lags of `LAG` have settled at t < 0."""
    w = 2.0 * jnp.pi * FREQUENCY
    onset = 1.0 - jnp.exp(-((t / (4.0 * LAG)) ** 4))
    return jnp.asarray(POSE) + AMPLITUDE * onset * jnp.sin(w * t)


def motion(t):
    """Angles and their first two derivatives."""
    one = jnp.ones_like(t)
    rate = lambda t: jax.jvp(angles, (t,), (one,))[1]
    return angles(t), rate(t), jax.jvp(rate, (t,), (one,))[1]


def accelerations(robot, t, eta, etad):
    """Of the modes, under the prescribed motion of the axes."""
    q, qd, qdd = motion(t)
    zero = jnp.zeros_like(q)
    blocks = equations_of_motion(robot, q, eta, zero, qd, etad, zero)
    return -jnp.linalg.solve(blocks.M_ee, blocks.M_ae.T @ qdd + blocks.h_e)


@jax.jit
def simulate(robot: ElasticRobot):
    """Times, modal coordinates and rates, from the static equilibrium on."""
    start = jnp.zeros((robot.elastic,))
    for _ in range(3):
        forces = lambda eta: accelerations(robot, jnp.zeros(()), eta, 0.0 * eta)
        start = start - jnp.linalg.solve(jax.jacfwd(forces)(start), forces(start))

    times = STEP * KEPT * jnp.arange(float(round(DURATION / (STEP * KEPT))))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, x, _: (x[1], accelerations(robot, t, *x))),
        diffrax.Tsit5(),
        times[0],
        times[-1],
        STEP,
        (start, 0.0 * start),
        saveat=diffrax.SaveAt(ts=times),
        max_steps=round(DURATION / STEP) + 10,
    )
    eta, etad = solution.ys
    return times, eta, etad


@jax.jit
def outputs(robot: ElasticRobot, times, eta, etad):
    """Position of the load [m], force [N] and moment [N m] at the clamp."""
    joint = robot.axis_joint(2)

    def at(t, eta, etad):
        q, qd, qdd = motion(t)
        etadd = jnp.zeros_like(eta)
        if robot.elastic:
            etadd = accelerations(robot, t, eta, etad)
        pose = forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))
        force, moment = cut_forces(robot, joint, q, eta, qd, etad, qdd, etadd)
        return jnp.concatenate([pose[:3, 3], force, moment])

    return jax.vmap(at)(times, eta, etad)


def main(
    path: pathlib.Path | None = None, names: tuple[str, ...] = tuple(BODY_DETAILS)
) -> dict[str, float]:
    """Root-mean-square deviations from the nominal solution.

    Args:
        path: of a PNG to write.
        names: of the variants, "nominal" among them.
    """
    robot = three_axis_arm()
    curves = {}
    for name in names:
        plant = robot.with_body_detail(BODY_DETAILS[name])
        times, eta, etad = simulate(plant)
        curves[name] = np.asarray(outputs(plant, times, eta, etad))
    stiff = robot.flexible_joint()
    none = jnp.zeros((times.shape[0], 0))
    curves["rigid"] = np.asarray(outputs(stiff, times, none, none))
    found = {}
    print(f"{'deviation from nominal, rms':<26} {'load':>9} {'force':>9} {'moment':>9}")
    print(f"{'':<26} {'[mm]':>9} {'[N]':>9} {'[N m]':>9}")
    for name, curve in curves.items():
        if name == "nominal":
            continue
        off = curve - curves["nominal"]
        size = [
            float(np.sqrt(np.mean(np.sum(off[:, k : k + 3] ** 2, axis=1))))
            for k in (0, 3, 6)
        ]
        found |= {f"{name}: {x}": y for x, y in zip(("load", "force", "moment"), size)}
        print(f"{name:<26} {1e3 * size[0]:9.3f} {size[1]:9.3f} {size[2]:9.3f}")
    print("theirs: variant 5 nearly nominal, 1 to 4 alike, rigid far off; no numbers")
    if path is not None:
        save_figure(plot(np.asarray(times), curves), path)
    return found


COLOURS = {
    "nominal": "black",
    "variant 1": "tab:blue",
    "variant 2": "tab:cyan",
    "variant 3": "tab:green",
    "variant 4": "tab:olive",
    "variant 5": "tab:red",
    "rigid": "tab:gray",
}


def plot(times: np.ndarray, curves: dict[str, np.ndarray]) -> Figure:
    """Position of the load, forces and moments, and the deviations from nominal."""
    figure = Figure(figsize=(14.0, 12.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(4, 3, sharex=True)
    labels = [f"$r_{{m,{a}}}$ [m]" for a in "xyz"]
    labels += [f"$f_{a}$ at the clamp [N]" for a in "xyz"]
    labels += [f"$m_{a}$ at the clamp [N m]" for a in "xyz"]
    for k, label in enumerate(labels):
        ax = axes[k // 3 if k < 3 else k // 3 + 1, k % 3]
        for name, curve in curves.items():
            style = "--" if name in ("variant 5", "rigid") else "-"
            ax.plot(times, curve[:, k], style, color=COLOURS[name], lw=1.2, label=name)
        ax.set_ylabel(label)
        ax.grid(alpha=0.3)
    for k, letter in enumerate("xyz"):
        ax = axes[1, k]
        for name, curve in curves.items():
            off = 1e3 * (curve[:, k] - curves["nominal"][:, k])
            style = "--" if name in ("variant 5", "rigid") else "-"
            ax.plot(times, off, style, color=COLOURS[name], lw=1.2)
        ax.set_ylabel(f"$r_{{m,{letter}}}$ less nominal [mm]")
        ax.grid(alpha=0.3)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    axes[0, 0].legend(fontsize=8, ncol=2)
    figure.suptitle(
        "Figures 3.16 and 3.17: simplifications of a flexible beam (parameters assumed)"
    )
    return figure


if __name__ == "__main__":
    import sys

    jax.config.update("jax_enable_x64", True)
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)
