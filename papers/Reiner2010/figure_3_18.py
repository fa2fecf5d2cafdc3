"""Figure 3.18: poles and transmission zeros of a flexible arm. [Reiner2010], p. 76.

The three-axis arm of figure 3.16, inputs the angles of axes 1 to 3, outputs x, y, z of
its load, for (3.72) in full and for the five variants of the text, of which the first
is (3.73). The text gives no parameters: those of `robots.three_axis_arm` are assumed,
the figure is reproduced in shape.

The text's findings: the nominal system has zeros in the right half-plane, (3.73) has
none; zeroth-order terms of $C_t$ and $C_r$ (variant 5) do not suffice for a stable
inverse, so these matrices are to blame.
"""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import MotorAngles, RobotChannel, linear_robot
from elastax.plotting import plot_poles_and_zeros, save_figure
from elastax.robots import three_axis_arm
from elastax.structure import BODY_DETAILS


THEIRS = {"nominal": "some", "variant 1": "none", "variant 5": "some"}
POSE = np.array([0.0, 0.5, -0.9])  # [rad]


def main(
    path: pathlib.Path | None = None, names: tuple[str, ...] = tuple(BODY_DETAILS)
) -> dict[str, int]:
    """Number of zeros in the right half-plane, by variant.

    Args:
        path: of a PNG to write, with nominal, variant 1 and variant 5.
        names: of the variants.
    """
    robot = three_axis_arm()
    models = {
        name: linear_robot(
            robot.with_body_detail(BODY_DETAILS[name]),
            jnp.asarray(POSE),
            RobotChannel(MotorAngles()),
        )
        for name in names
    }
    found = {}
    print(f"{'right zeros':<20} {'ours':>10} {'theirs':>8} {'largest [1/s]':>14}")
    for name, model in models.items():
        zeros = model.zeros()
        right = int(np.sum(zeros.real > 1e-9 * np.abs(zeros).max()))
        found[name] = right
        of = f"{right} of {len(zeros)}"
        theirs = THEIRS.get(name, "-")
        print(f"{name:<20} {of:>10} {theirs:>8} {zeros.real.max():14.3f}")
    if path is not None:
        shown = ("nominal", "variant 1", "variant 5")
        figure = plot_poles_and_zeros(
            {name: models[name] for name in shown},
            limit=2500.0,
            title="Figure 3.18: poles and transmission zeros (parameters assumed)",
        )
        save_figure(figure, path)
    return found


if __name__ == "__main__":
    import sys

    jax.config.update("jax_enable_x64", True)
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None)
