"""Figures 3.4 and 3.5: zeros over the place of the output. [Reiner2010], p. 49.

A beam on one joint, driven by a torque, with a point mass at its end; output is the
lateral displacement of a point of the beam, at 200 places from the joint to the tip,
with three bending modes (figure 3.4) and with one (figure 3.5). The text gives no
parameters: those of `robots.beam_on_joint` are assumed. Modes of the bare beam, as the
text's library has them, and a tip mass of a quarter of the beam's.

The text reads 0.3 (three modes) and 0.9 (one) off its plots. Our figures depend on the
ratio of the masses only: 0.384, 0.390, 0.391 and 0.798, 0.891, 0.954 for ratios of 0,
0.25 and 1.
"""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import zeros_along_link
from elastax.plotting import plot_zeros_along_link, save_figure
from elastax.robots import beam_on_joint


RATIOS = (0.0, 0.25, 1.0)
ROD_MASS = 7850.0 * np.pi * 0.01**2  # of 1 m [kg]
PLACES = tuple(np.arange(1, 200) / 200.0)
THEIRS = {3: 0.3, 1: 0.9}


def along(modes: int, ratio: float):
    """Zeros for outputs along the beam."""
    robot = beam_on_joint(
        modes, tip_mass=ratio * ROD_MASS, loaded_modes=False, outputs=PLACES
    )
    return zeros_along_link(robot, jnp.zeros(1))


def main(path: pathlib.Path | None = None) -> dict[str, float]:
    """Places over the length at which the first right zero appears.

    Args:
        path: of a PNG to write; the second figure stands beside it.
    """
    found = {}
    print(f"{'first right zero at':<28} {'ours':>8} {'theirs':>8} {'difference':>11}")
    for modes in (3, 1):
        for ratio in RATIOS:
            zeros = along(modes, ratio)
            place = zeros.critical_position()
            found[f"{modes} modes, mass ratio {ratio:g}"] = place
            off = place - THEIRS[modes]
            name = f"{modes} mode{'s' * (modes > 1)}, mass ratio {ratio:g}"
            print(f"{name:<28} {place:8.4f} {THEIRS[modes]:8.1f} {off:11.4f}")
            if path is not None and ratio == 0.25:
                figure = plot_zeros_along_link(
                    zeros,
                    title="Figure 3.4: three modes"
                    if modes == 3
                    else "Figure 3.5: one mode",
                )
                here = path if modes == 3 else path.with_stem(path.stem + "_one_mode")
                save_figure(figure, here)
    return found


if __name__ == "__main__":
    import sys

    jax.config.update("jax_enable_x64", True)
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)
