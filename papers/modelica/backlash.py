"""Rotational.Examples.Backlash: an inertia on spring and damper, with and without play.

Modelica Standard Library 4.1.0, Modelica.Mechanics.Rotational.Examples.Backlash, whose
parameters these are: 5 kg m^2, 20 kN m/rad, 50 N m s/rad, play of 45 degrees, released
at 90 degrees.
"""

import pathlib
import sys

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import Backlash, LinearStiffness


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import _reference as reference


INERTIA, STIFFNESS, DAMPING = 5.0, 20e3, 50.0  # kg m^2, N m/rad, N m s/rad
PLAY, START = np.pi / 4, np.pi / 2  # rad


def main(
    path: pathlib.Path | None = None, data: pathlib.Path | None = None
) -> dict[str, float]:
    """Deviations over the range of each signal.

    Args:
        path: folder of the figure; none is drawn without.
        data: folder that holds `modelica_reference`.
    """
    theirs = reference.load(data, "Rotational_Backlash")
    times, index = reference.grid(theirs["time"])
    gear = Backlash(LinearStiffness(STIFFNESS), PLAY, 0.0)

    def field(t, x, _):
        angle, speed = x[:2], x[2:]
        free = gear.torque(angle[0], speed[0], jnp.asarray(DAMPING))
        tight = STIFFNESS * angle[1] + DAMPING * speed[1]
        return jnp.concatenate([speed, -jnp.stack([free, tight]) / INERTIA])

    # the corners of the law are left to the control of the step size
    solve = lambda x0: (
        dfx.diffeqsolve(
            dfx.ODETerm(field),
            dfx.Tsit5(),
            0.0,
            float(times[-1]),
            1e-4,
            x0,
            saveat=dfx.SaveAt(ts=jnp.asarray(times)),
            stepsize_controller=dfx.PIDController(rtol=1e-9, atol=1e-11),
            max_steps=100_000,
        ).ys
    )
    x = np.asarray(jax.jit(solve)(jnp.array([START, START, 0.0, 0.0])))[index].T
    ours = {
        "elastoBacklash.phi_rel": x[0],
        "elastoBacklash.w_rel": x[2],
        "springDamper.phi_rel": x[1],
        "springDamper.w_rel": x[3],
    }
    figures = {name: reference.deviation(ours[name], theirs[name]) for name in ours}
    print(f"{'signal':<24} {'deviation':>10}")
    for name, value in figures.items():
        print(f"{name:<24} {value:10.2e}")
    if path is not None:
        pair = lambda name: (theirs[name], ours[name])
        panels = [
            (label, {f"{n}.{what}": pair(f"{n}.{what}") for n in
                     ("elastoBacklash", "springDamper")})
            for label, what in (("angle [rad]", "phi_rel"), ("speed [rad/s]", "w_rel"))
        ]  # fmt: skip
        path.mkdir(parents=True, exist_ok=True)
        reference.draw(
            path / "backlash.png",
            "Rotational.Examples.Backlash",
            panels,
            theirs["time"],
            float(times[-1]),
        )
    return figures


if __name__ == "__main__":
    reference.command_line(main, __doc__)
