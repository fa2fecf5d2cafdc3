r"""Figure 2.4: two inertias and a gear with losses. [Reiner2010], section 2.3.3.

The gear (2.11) has no elasticity, so that both inertias share the speed $\omega$ and
the acceleration $a$ solves

$$\Theta_B a = \tau_B(\tau - \Theta_A a,\ \omega)$$

with the torque $\tau_B$ that the gear hands on. The text prints the inertias, the
efficiencies and the friction, but neither the ramp of the torque nor the steepness of
the two smooth zero crossings: those below are our choice, and so are the floor under
the efficiencies and the rounding of $|\omega|$. The curves of the text can thus be
compared in kind only; references are an equilibrium in closed form and the balance of
power. The viscous friction is in N m s/rad, not in N m/rad as printed.
"""

import pathlib

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import (
    CoulombViscousFriction,
    DirectionalEfficiency,
    FallingEfficiency,
)
from elastax.plotting._style import CYCLE, new_figure, save_figure


INERTIA_A, INERTIA_B = 1.0, 5.0  # kg m^2
COULOMB, VISCOUS = 5.0, 5.0  # N m, N m s/rad
DECLINE = 0.1  # s/rad
AT_REST = {"driving": 0.9, "driven": 0.8}

# our choice: up, held, quickly down to the other sign, held, back to zero
CORNERS = np.array([0.0, 0.5, 2.0, 8.0, 9.0, 15.0, 16.0, 20.0])  # s
LEVELS = np.array([0.0, 0.0, 30.0, 30.0, -30.0, -30.0, 0.0, 0.0])  # N m
STEEPNESS = 100.0  # 1/W of the direction of the power, s/rad of the friction
FLOOR = 0.05

STEADY = 2.75  # rad/s: (0.9 - 0.1 w) 30 = 5 + 5 w
NEWTON_STEPS = 8
STEP = 2e-3  # s, of the samples

FRICTION = CoulombViscousFriction(VISCOUS, COULOMB, STEEPNESS)


def gear() -> DirectionalEfficiency:
    """The gear of the text."""
    efficiency = lambda level: FallingEfficiency(
        at_rest=level, decline=DECLINE, floor=FLOOR, sharpness=100.0, rounding=1e-4
    )
    return DirectionalEfficiency(
        efficiency(AT_REST["driving"]),
        efficiency(AT_REST["driven"]),
        STEEPNESS,
        FRICTION,
        FRICTION,
    )


def ramp(t):
    """Torque on the first inertia [N m]."""
    return jnp.interp(t, CORNERS, LEVELS)


def acceleration(mesh, torque, speed):
    """Acceleration [rad/s^2] of both inertias.

    The balance rises with it by 5 kg m^2 and between 0.9 and about 2 more, so that each
    of Newton's steps leaves less than a third of the error even across the bend where
    the power changes its direction.
    """

    def balance(a):
        return INERTIA_B * a - mesh.load_torque(torque - INERTIA_A * a, speed)

    a = torque / (INERTIA_A + INERTIA_B)
    for _ in range(NEWTON_STEPS):
        value, slope = jax.jvp(balance, (a,), (jnp.ones_like(a),))
        a = a - value / slope
    return a


def simulate(mesh, times):
    """Speed [rad/s] at the times, and energy put in, lost, lost by friction [J]."""

    def field(t, x, _):
        torque, speed = ramp(t), x[0]
        a = acceleration(mesh, torque, speed)
        drive = torque - INERTIA_A * a
        lost = (drive - mesh.load_torque(drive, speed)) * speed
        friction = FRICTION.torque(speed) * speed
        return jnp.stack([a, torque * speed, lost, friction])

    control = dfx.PIDController(rtol=1e-10, atol=1e-12)
    solution = dfx.diffeqsolve(
        dfx.ODETerm(field),
        dfx.Tsit5(),
        CORNERS[0],
        CORNERS[-1],
        1e-4,
        jnp.zeros(4),
        saveat=dfx.SaveAt(ts=jnp.asarray(times)),
        # no step runs over a corner of the ramp
        stepsize_controller=dfx.ClipStepSizeController(
            control, jump_ts=jnp.asarray(CORNERS[1:-1])
        ),
        max_steps=200_000,
    )
    assert solution.ys is not None
    return solution.ys.T


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Figures of the motion, and the figure itself if asked.

    Args:
        path: of the PNG; none is written without it.
    """
    mesh = gear()
    times = STEP * np.arange(round(CORNERS[-1] / STEP) + 1)
    speed, put_in, lost, by_friction = jax.jit(lambda: simulate(mesh, times))()
    torque = ramp(jnp.asarray(times))
    a = acceleration(mesh, torque, speed)
    drive = torque - INERTIA_A * a
    load = mesh.load_torque(drive, speed)
    share = mesh.share_driving(drive, speed)
    friction = FRICTION.torque(speed) * speed
    loss = (drive - load) * speed
    kinetic = 0.5 * (INERTIA_A + INERTIA_B) * speed**2
    power = torque * speed - (INERTIA_A + INERTIA_B) * a * speed - loss
    moving = jnp.abs(speed) > 1e-3
    in_motion = float(jnp.sum(moving))
    driving = float(jnp.sum(moving & (share > 0.5))) / in_motion
    printed = lambda name: AT_REST[name] - DECLINE * jnp.abs(speed)
    off = lambda name: jnp.abs(getattr(mesh, name).value(speed) - printed(name))
    steady = int(np.argmin(np.abs(times - 8.0)))
    ours = {
        "speed after 6 s of 30 N m [rad/s]": float(speed[steady]),
        "greatest speed [rad/s]": float(jnp.max(jnp.abs(speed))),
        "energy put in [J]": float(put_in[-1]),
        "energy lost [J]": float(lost[-1]),
        "energy lost by friction [J]": float(by_friction[-1]),
        "energy lost by efficiency [J]": float(lost[-1] - by_friction[-1]),
        "greatest loss [W]": float(jnp.max(loss)),
        "greatest gain [W]": float(jnp.max(-loss)),
        "greatest gain of the teeth alone [W]": float(jnp.max(friction - loss)),
        "time in motion [s]": in_motion * STEP,
        "share of it driving": driving,
        "share of it driven": 1.0 - driving,
        "balance of power [W]": float(jnp.max(jnp.abs(power))),
        "balance of energy [J]": float(jnp.max(jnp.abs(put_in - lost - kinetic))),
        "efficiencies off the printed lines": float(
            jnp.max(jnp.maximum(off("driving"), off("driven")))
        ),
    }
    reference = {
        "speed after 6 s of 30 N m [rad/s]": STEADY,
        "balance of power [W]": 0.0,
        "balance of energy [J]": 0.0,
    }
    print(f"{'(2.11), two inertias':<38} {'ours':>12} {'closed form':>11} {'diff.':>9}")
    for name, value in ours.items():
        line = f"{name:<38} {value:12.6g}"
        if name in reference:
            line += f" {reference[name]:11.6g} {value - reference[name]:9.1e}"
        print(line)
    if path is not None:
        save_figure(
            _figure(times, torque, drive, load, speed, share, friction, loss), path
        )
    return ours


def _figure(times, torque, drive, load, speed, share, friction, loss):
    figure, panels = new_figure(
        "Gear with losses (2.11) between two inertias: the text's figures, our ramp",
        2,
        2,
        6.4,
        sharex=True,
    )
    style = {"linewidth": 1.6}
    (torques, speeds), (shares, losses) = panels
    names = (
        r"$\tau$ on $\Theta_A$",
        r"$\tau_A$ into the gear",
        r"$-\tau_B$ on $\Theta_B$",
    )
    for name, signal, line in zip(
        names, (torque, drive, load), ("-", "-", (0, (4, 2))), strict=True
    ):
        torques.plot(times, signal, label=name, linestyle=line, **style)
    torques.set_ylabel("torque [N m]")
    speeds.plot(times, speed, color=CYCLE[3], **style)
    speeds.axhline(STEADY, color="#8a8468", linewidth=0.9, linestyle=(0, (3, 2)))
    speeds.annotate(
        "equilibrium at 30 N m",
        (19.9, STEADY),
        (0, 3),
        textcoords="offset points",
        fontsize=9,
        ha="right",
        color="#6b664f",
    )
    speeds.set_ylim(top=3.3)
    speeds.set_ylabel(r"speed $\omega_A$ [rad/s]")
    shares.plot(times, share, color=CYCLE[2], **style)
    shares.set_ylabel(r"direction of power $\xi$ [-]")
    shares.annotate(
        "the torque drives", (2.0, 0.97), fontsize=9, color="#6b664f", va="top"
    )
    shares.annotate("the load drives", (2.0, 0.03), fontsize=9, color="#6b664f")
    losses.plot(times, loss, label="all losses", color=CYCLE[0], **style)
    losses.plot(
        times,
        friction,
        label="friction",
        color=CYCLE[1],
        linestyle=(0, (4, 2)),
        **style,
    )
    losses.plot(times, loss - friction, label="efficiency", color=CYCLE[2], **style)
    losses.set_ylabel("power lost [W]")
    torques.legend(loc="upper right", fontsize=9, frameon=False)
    losses.set_ylim(top=98.0)
    losses.legend(loc="upper center", ncols=3, fontsize=9, frameon=False)
    for panel in (shares, losses):
        panel.set_xlabel("time [s]")
    return figure


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
