"""Rotational.Examples.ElasticBearing: a gear whose housing stands on a spring.

Modelica Standard Library 4.1.0, Modelica.Mechanics.Rotational.Examples.ElasticBearing,
whose parameters these are: shaft 1, housing 5, load 50 kg m^2, ratio 3, springs 1 kN
m/rad to the load and 100 kN m/rad with 5 N m s/rad under the housing, torque rising to
100 N m in 5 s. With the angles a of the shaft and h of the housing, the output of the
gear stands at a/3 + 2 h/3.
"""

import pathlib
import sys

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import LinearStiffness


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import _reference as reference


RATIO = 3.0
INERTIAS = np.array([1.0, 5.0, 50.0])  # shaft, housing, load [kg m^2]


def main(
    path: pathlib.Path | None = None, data: pathlib.Path | None = None
) -> dict[str, float]:
    """Deviations over the range of each signal.

    Args:
        path: folder of the figure; none is drawn without.
        data: folder that holds `modelica_reference`.
    """
    theirs = reference.load(data, "Rotational_ElasticBearing")
    times, index = reference.grid(theirs["time"])
    spring, bearing = LinearStiffness(1e3), LinearStiffness(1e5)

    def field(t, x, _):
        (shaft, housing, load), speed = x[:3], x[3:]
        output = shaft / RATIO + housing * (1 - 1 / RATIO)
        torque = spring.torque(load - output)
        ground = bearing.torque(housing) + 5.0 * speed[1]
        forces = jnp.stack(
            [
                jnp.minimum(20.0 * t, 100.0) + torque / RATIO,
                torque * (1 - 1 / RATIO) - ground,
                -torque,
            ]
        )
        return jnp.concatenate([speed, forces / INERTIAS])

    solve = lambda x0: (
        dfx.diffeqsolve(
            dfx.ODETerm(field),
            dfx.Tsit5(),
            0.0,
            float(times[-1]),
            1e-4,
            x0,
            saveat=dfx.SaveAt(ts=jnp.asarray(times)),
            stepsize_controller=dfx.PIDController(rtol=1e-9, atol=1e-12),
            max_steps=200_000,
        ).ys
    )
    x = np.asarray(jax.jit(solve)(jnp.zeros(6)))[index].T
    ours = {
        "load.phi": x[2],
        "load.w": x[5],
        "shaft.phi": x[0],
        "shaft.w": x[3],
        "springDamper.phi_rel": x[1],
        "springDamper.w_rel": x[4],
    }
    figures = {name: reference.deviation(ours[name], theirs[name]) for name in ours}
    print(f"{'signal':<22} {'deviation':>10}")
    for name, value in figures.items():
        print(f"{name:<22} {value:10.2e}")
    if path is not None:
        pick = lambda *names: {name: (theirs[name], ours[name]) for name in names}
        panels = [
            ("angle [rad]", pick("load.phi", "shaft.phi")),
            ("speed [rad/s]", pick("load.w", "shaft.w")),
            ("bearing [rad]", pick("springDamper.phi_rel")),
            ("bearing [rad/s]", pick("springDamper.w_rel")),
        ]
        path.mkdir(parents=True, exist_ok=True)
        reference.draw(
            path / "elastic_bearing.png",
            "Rotational.Examples.ElasticBearing",
            panels,
            theirs["time"],
            float(times[-1]),
        )
    return figures


if __name__ == "__main__":
    reference.command_line(main, __doc__)
