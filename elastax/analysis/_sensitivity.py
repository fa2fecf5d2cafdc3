"""How zeros and frequencies depend on every parameter of a robot."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._custom_types import PerJoint
from ..dynamics import ElasticRobot
from ._robot_model import RobotChannel
from ._zero_map import pose_figures


# entries of rotation matrices and directions, which are no parameters one by one
_FRAMES = ("chain.base", "chain.joints.rotation", "axis_signs", "flange")


class Sensitivity(NamedTuple):
    """What a parameter changes.

    Attributes:
        name: of the parameter, by its place in the robot, with axis or coordinate.
        value: of the parameter, in its unit.
        frequency: relative change of the first locked eigenfrequency per relative
            change of the parameter: one means proportional.
        zero: the same of the right zero that is nearest to the origin; NaN without one.
    """

    name: str
    value: float
    frequency: float
    zero: float


def sensitivities(
    robot: ElasticRobot,
    theta: PerJoint,
    channel: RobotChannel = RobotChannel(),
    *,
    degrees: tuple[int, ...],
) -> list[Sensitivity]:
    r"""Relative sensitivities $\frac{p}{f}\frac{\partial f}{\partial p}$, sorted.

    One reverse pass per figure gives those by all parameters. A parameter that is zero
    has none.

    Args:
        robot: the robot.
        theta: motor angles at rest [rad].
        channel: inputs and outputs.
        degrees: relative degrees of the outputs.

    Raises:
        ValueError: nothing in the robot is elastic.
    """
    if not robot.has_elastic_gears and not robot.elastic:
        raise ValueError("a rigid robot has no eigenfrequencies and no zeros")
    parameters, rest = eqx.partition(robot, eqx.is_inexact_array)
    figures, slopes = _slopes(parameters, rest, theta, channel, tuple(degrees))
    values = np.asarray(figures)
    found = []
    leaves, _ = jax.tree_util.tree_flatten_with_path(parameters)
    for (path, leaf), slope in zip(leaves, jax.tree.leaves(slopes)):
        place = jax.tree_util.keystr(path).lstrip(".")
        if place.startswith(_FRAMES):
            continue
        numbers = np.asarray(leaf)
        relative = np.asarray(slope) * numbers[None]
        relative = relative / values.reshape(-1, *([1] * numbers.ndim))
        for index in np.ndindex(numbers.shape):
            name = place + _label(robot, place, index)
            frequency, zero = (float(x) for x in relative[(slice(None), *index)])
            zero = zero if np.isfinite(values[1]) else float("nan")
            if frequency or (zero and np.isfinite(zero)):
                found.append(Sensitivity(name, float(numbers[index]), frequency, zero))
    size = lambda s: np.nanmax([abs(s.frequency), abs(s.zero)])
    return sorted(found, key=size, reverse=True)


@eqx.filter_jit
def _slopes(parameters, rest, theta, channel, degrees):
    def figures(parameters):
        robot = eqx.combine(parameters, rest)
        found = pose_figures(robot, theta, channel, degrees)
        both = jnp.stack([found.frequency, found.slowest_right])
        return both, both

    slopes, values = jax.jacrev(figures, has_aux=True)(parameters)
    return values, slopes


def _label(robot: ElasticRobot, place: str, index: tuple[int, ...]) -> str:
    """Axis, elastic coordinate or body that an entry belongs to."""
    if not index:
        return ""
    names: tuple[str, ...] = ()
    if place.startswith("drives"):
        names = robot.axis_names
    elif place.startswith("structure"):
        names = robot.elastic_names
    elif place.startswith("bodies"):
        names = robot.bodies.names
    elif place.startswith("payload"):
        names = robot.payload.names
    first = names[index[0]] if index[0] < len(names) else str(index[0])
    return "[" + ", ".join([first, *(str(k) for k in index[1:])]) + "]"
