"""Figure 3.18: poles and transmission zeros of a flexible arm. [Reiner2010], p. 76.

The three-axis arm of figure 3.16, inputs the angles of axes 1 to 3, outputs x, y, z of
its load, for (3.72) in full and for the five variants of the text, of which the first
is (3.73). The text gives no parameters: those of `robots.three_axis_arm` are assumed,
the figure is reproduced in shape.

The text's findings: the nominal system has zeros in the right half-plane, (3.73) has
none; zeroth-order terms of $C_t$ and $C_r$ (variant 5) do not suffice for a stable
inverse, so these matrices are to blame.
"""

import dataclasses
import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import MotorAngles, RobotChannel, linear_robot
from elastax.dynamics import ElasticRobot
from elastax.plotting import plot_poles_and_zeros, save_figure
from elastax.robots import three_axis_arm
from elastax.structure import (
    NOMINAL,
    VARIANT_1,
    VARIANT_2,
    VARIANT_3,
    VARIANT_4,
    VARIANT_5,
    BodyDetail,
)


VARIANTS = {
    "nominal": NOMINAL,
    "variant 1, (3.73)": VARIANT_1,
    "variant 2": VARIANT_2,
    "variant 3": VARIANT_3,
    "variant 4": VARIANT_4,
    "variant 5": VARIANT_5,
}
THEIRS = {"nominal": "some", "variant 1, (3.73)": "none", "variant 5": "some"}
POSE = np.array([0.0, 0.5, -0.9])  # [rad]


def with_detail(robot: ElasticRobot, detail: BodyDetail) -> ElasticRobot:
    """The robot with other terms in the equations of its beam."""
    (link,) = robot.modal_links
    link = dataclasses.replace(link, body=link.body.with_detail(detail))
    return dataclasses.replace(robot, modal_links=(link,))


def main(path: pathlib.Path | None = None) -> dict[str, int]:
    """Number of zeros in the right half-plane, by variant.

    Args:
        path: of a PNG to write.
    """
    robot = three_axis_arm()
    linear = eqx.filter_jit(linear_robot)
    models = {
        name: linear(
            with_detail(robot, detail), jnp.asarray(POSE), RobotChannel(MotorAngles())
        )
        for name, detail in VARIANTS.items()
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
        shown = ("nominal", "variant 1, (3.73)", "variant 5")
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
