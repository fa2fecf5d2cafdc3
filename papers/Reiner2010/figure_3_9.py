"""Figure 3.9: zeros of the two-link example over the length of its tip. p. 56.

The plane example of figure 3.8, (3.36) and (3.37), with the parameters of the caption:
l = 2 m, xi = 0.2, m = 100 kg, c = 1e6 N m/rad, d = 150 N m s/rad, J_z = 10 kg m^2. A
pair of zeros becomes real and one of it passes through infinity at
x_l = J_z / (m l (1 - xi)) = 0.0625 m. The printed closed form (3.40) has the wrong sign
under its root; the zeros of section 3.5.3, -292.1857 and 305.5786 at x_l = 0.5 m, are
those of these parameters, not of the c = 1e5 that is printed beside them.
"""

import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import ControlSystem, SignalNames, linearise
from elastax.plotting import save_figure
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


L, XI, M, C, D, J_Z = 2.0, 0.2, 100.0, 1e6, 150.0, 10.0
THEIRS = (-292.1857, 305.5786)
NAMES = SignalNames(
    ("phi_a", "phi_a'", "phi_e", "phi_e'"), ("tau_a [N m]",), ("y of the tip [m]",)
)


def example(x_l) -> ControlSystem:
    """The example with a tip of length x_l [m]."""

    def rate(x, u):
        _, w, phi, v = x
        co, si, ml2 = jnp.cos(phi), jnp.sin(phi), M * L**2
        M_11 = ml2 * (1 - 2 * XI + 2 * XI**2 + 2 * XI * (1 - XI) * co) + J_Z
        M_21 = ml2 * ((1 - XI) ** 2 + XI * (1 - XI) * co) + J_Z
        M_22 = ml2 * (1 - XI) ** 2 + J_Z
        h_1 = -ml2 * XI * (1 - XI) * (v**2 + 2 * w * v) * si
        h_2 = C * phi + D * v + ml2 * XI * (1 - XI) * w**2 * si
        mass = jnp.array([[M_11, M_21], [M_21, M_22]])
        a = jnp.linalg.solve(mass, jnp.array([u[0] - h_1, -h_2]))
        return jnp.array([w, a[0], v, a[1]])

    def output(x):
        reach = x_l + L * (1 - XI)
        return jnp.array([reach * jnp.sin(x[0] + x[2]) + L * XI * jnp.sin(x[0])])

    return ControlSystem(rate, output, NAMES)


@eqx.filter_jit
def linear(x_l):
    """Linear model at rest."""
    return linearise(example(x_l), jnp.zeros(4), jnp.zeros(1))


def at(x_l) -> np.ndarray:
    """Zeros; an array as length, so that one program serves all."""
    return linear(jnp.asarray(x_l)).zeros()


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Zeros at 0.5 m and the critical length.

    Args:
        path: of a PNG to write.
    """
    zeros = at(0.5).real
    limit = J_Z / (M * L * (1 - XI))
    before, beyond = at(0.999 * limit), at(1.001 * limit)
    found = {
        "zero 1 at x_l = 0.5 m [1/s]": float(zeros[0]),
        "zero 2 at x_l = 0.5 m [1/s]": float(zeros[1]),
        "right zeros before 0.0625 m": float(np.sum(before.real > 0)),
        "right zeros beyond 0.0625 m": float(np.sum(beyond.real > 0)),
    }
    print(f"{'':<30} {'ours':>12} {'theirs':>12} {'difference':>11}")
    for (name, value), theirs in zip(found.items(), (*THEIRS, 0.0, 1.0)):
        print(f"{name:<30} {value:12.5f} {theirs:12.5f} {value - theirs:11.5f}")
    if path is not None:
        save_figure(plot(), path)
    return found


def plot() -> Figure:
    """Zeros in the complex plane, and their real parts over the length of the tip."""
    lengths = np.concatenate(
        [np.linspace(0.0, 0.0624, 60), np.linspace(0.0626, 0.5, 60)]
    )
    zeros = np.stack([at(x) for x in lengths])
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    plane, over = figure.subplots(1, 2)
    colour = np.repeat(lengths[:, None], 2, axis=1)
    image = plane.scatter(zeros.real, zeros.imag, c=colour, cmap="turbo", s=10)
    plane.set_xlim(-6000, 3000)
    plane.set_xlabel("real part [1/s]")
    plane.set_ylabel("imaginary part [rad/s]")
    figure.colorbar(image, ax=plane, label="$x_l$ [m]")
    for k in range(2):
        over.plot(lengths, zeros[:, k].real, ".", ms=4, label=f"$N_{k + 1}$")
    over.axvline(0.0625, color="black", ls=":", label="0.0625 m")
    over.set_ylim(-6000, 6000)
    over.set_xlabel("$x_l$ [m]")
    over.set_ylabel("real part [1/s]")
    over.legend(fontsize=9)
    for axes in (plane, over):
        axes.grid(alpha=0.3)
    figure.suptitle("Figure 3.9: zeros over the length of the tip")
    return figure


if __name__ == "__main__":
    import sys

    jax.config.update("jax_enable_x64", True)
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)
