"""Where along a link the output may sit before the inverse turns unstable."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq

from .._custom_types import PerJoint
from ..dynamics import ElasticRobot
from ._channels import AbstractDrive, MotorTorques, NodePoint
from ._robot_model import RobotChannel, linear_robot
from ._transmission_zeros import transmission_zeros


class LinkZeros(eqx.Module):
    """Zeros for outputs at the nodes of a flexible link, one input and one output.

    Attributes:
        positions: of the nodes along the link, ascending [m], shape (nodes,).
        zeros: [1/s], shape (nodes, zeros).
        poles: [1/s], the same for every output, shape (states,).
        gain: high-frequency gain, the scalar decoupling matrix, shape (nodes,); where
            it changes its sign a pair of zeros passes through infinity.
    """

    positions: Float[Array, " nodes"]
    zeros: Complex[Array, "nodes zeros"]
    poles: Complex[Array, " states"]
    gain: Float[Array, " nodes"]

    @property
    def largest_real(self) -> Float[Array, " nodes"]:
        """Largest real part of the zeros of every output [1/s]."""
        return jnp.max(self.zeros.real, axis=1)

    def critical_position(self) -> float:
        """First position at which a zero lies in the right half-plane [m].

        Between two nodes it is interpolated: to the root of the gain, which is smooth,
        where the zeros pass through infinity, else to that of the largest real part.
        NaN if there is none.
        """
        worst, gain = np.asarray(self.largest_real), np.asarray(self.gain)
        place = np.asarray(self.positions)
        beyond = np.flatnonzero(worst > 0)
        if not beyond.size:
            return float("nan")
        k = int(beyond[0])
        if k == 0:
            return float(place[0])
        values, around = worst, slice(k - 1, k + 1)
        if gain[k] * gain[k - 1] < 0:
            values, around = gain, slice(max(k - 3, 0), k + 3)
        curve = BarycentricInterpolator(place[around], values[around])
        root: Any = brentq(curve, place[k - 1], place[k], xtol=1e-14)
        return float(root)


def zeros_along_link(
    robot: ElasticRobot,
    theta: PerJoint,
    *,
    inputs: AbstractDrive = MotorTorques((0,)),
    link: int = 0,
    direction: int = 1,
    degree: int = 2,
) -> LinkZeros:
    """Zeros from one motor to the place of every node of a flexible link.

    One program for all nodes. Nodes that lie in the origin of the link are left out:
    with torque as the input they do not move.

    Args:
        robot: with a flexible link whose nodes are the places looked at.
        theta: motor angles at rest [rad].
        inputs: one driven axis.
        link: index among the flexible links.
        direction: of the output, 0, 1, 2 for x, y, z of the base frame.
        degree: relative degree of these outputs.

    References:
        [Reiner2010] section 3.5.1, figures 3.3 to 3.5.
    """
    reach = np.linalg.norm(
        np.asarray(robot.modal_links[link].body.nodes.position), axis=1
    )
    order = np.argsort(reach)
    order = order[reach[order] > 1e-9 * reach.max()]

    nodes = jnp.asarray(order)
    figures = _at_nodes(
        robot, jnp.asarray(theta), nodes, inputs, link, direction, degree
    )
    zeros, poles, gain = figures
    return LinkZeros(jnp.asarray(reach[order]), zeros, poles[0], gain)


@eqx.filter_jit
def _at_nodes(robot, theta, nodes, inputs, link, direction, degree):
    def at(node):
        channel = RobotChannel(inputs, NodePoint(node, link, (direction,)))
        model = linear_robot(robot, theta, channel)
        A, B, C, D = model.A, model.B, model.C, model.D
        row = C
        for _ in range(degree - 1):
            row = row @ A
        gain = (row @ B)[0, 0] if degree else D[0, 0]
        return transmission_zeros(A, B, C, D, (degree,)), model.poles(), gain

    # one by one: on single matrices LAPACK never waits
    return jax.lax.map(at, nodes)
