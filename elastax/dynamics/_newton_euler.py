"""Inverse dynamics: the torques that a motion of the links needs."""

from typing import Any

import jax.numpy as jnp

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from .._taylor import Series, leading
from ._forces import applied_forces
from ._recursion import generalised_forces
from ._robot import ElasticRobot


@kernel
def inverse_dynamics(
    robot: ElasticRobot,
    q: PerJoint | Series,
    qd: PerJoint | Series,
    qdd: PerJoint | Series,
    eta: PerElastic | Series | None = None,
    etad: PerElastic | Series | None = None,
    etadd: PerElastic | Series | None = None,
) -> tuple[Any, Any]:
    r"""Torques that the links need for a given motion, behind the gears.

    $\hat\tau_a = M_{aa}\ddot q + M_{ae}\ddot\eta + h_a$ with the gear's spring and
    damper left out of $h_a$ (motor angle equal to joint angle), and $\hat\tau_e$ alike
    for the elastic coordinates, which would have to act on the structure from outside:
    zero in free motion.

    Args:
        robot: the robot.
        q, qd, qdd: joint angles [rad], velocities, accelerations, shape (axes,).
        eta, etad, etadd: elastic coordinates and derivatives, shape (elastic,); zero
            unless given. All may be `Series` as well.

    Returns:
        Torques at the joints (axes,) [N m], positive where they drive the links, and at
        the elastic coordinates (elastic,).

    References:
        [Reiner2010] (2.31), (3.91) with the errata; for a rigid robot the textbook
        inverse dynamics with friction behind the gears and counterbalance.
    """
    zero = _zeros_like(q, robot.elastic)
    eta = zero if eta is None else eta
    etad = zero if etad is None else etad
    etadd = zero if etadd is None else etadd
    total = generalised_forces(robot, q, eta, qd, etad, qdd, etadd)
    joint, structure = applied_forces(robot, q, eta, qd, etad)
    n = robot.axes
    return total[:n] + joint, total[n:] + structure


def _zeros_like(q: Any, size: int) -> Any:
    if isinstance(q, Series):
        return Series(jnp.zeros((q.order + 1, size), leading(q).dtype))
    return jnp.zeros((size,), q.dtype)
