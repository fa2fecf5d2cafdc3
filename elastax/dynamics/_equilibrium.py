"""Static equilibria of the elastic robot."""

import jax
import jax.numpy as jnp

from .._custom_types import PerElastic, PerJoint
from .._kernel import kernel
from ._gear_loads import resting_loads
from ._newton_euler import inverse_dynamics
from ._robot import ElasticRobot


_STEPS = 12  # Newton steps; the springs are nearly linear, four reach rounding


@kernel
def static_load(
    robot: ElasticRobot, q: PerJoint, eta: PerElastic
) -> tuple[PerJoint, PerElastic]:
    """`inverse_dynamics` at rest; the terms with speeds are not even formed."""
    still, rest = jnp.zeros_like(q), jnp.zeros_like(eta)
    return inverse_dynamics(robot, q, still, still, eta, rest, rest)


def static_equilibrium(
    robot: ElasticRobot, theta: PerJoint
) -> tuple[PerJoint, PerElastic]:
    """Joint angles and deformations at which the robot rests on locked motors.

    Newton's method from the undeformed robot, with a fixed number of steps; it is
    differentiated implicitly.

    Args:
        robot: the robot, with elastic gears.
        theta: motor angles on the output side [rad], shape (axes,).

    Returns:
        q (axes,) and eta (elastic,) [rad].
    """
    n = robot.axes
    rest = jnp.zeros((robot.elastic,), theta.dtype)

    def residual(x):
        q, eta = x[:n], x[n:]
        joint, structure = static_load(robot, q, eta)
        if robot.has_elastic_gears:
            joint = joint + resting_loads(robot, q, theta)[0]
        else:
            joint = q - theta
        return jnp.concatenate([joint, structure])

    def newton(function, start):
        def step(x, _):
            slope = jax.jacfwd(function)(x)
            return x - jnp.linalg.solve(slope, function(x)), None

        return jax.lax.scan(step, start, None, length=_STEPS)[0]

    def solve_linear(function, right):
        return jnp.linalg.solve(jax.jacfwd(function)(right), right)

    start = jnp.concatenate([theta, rest])
    x = jax.lax.custom_root(residual, start, newton, solve_linear)
    return x[:n], x[n:]


def holding_torque(
    robot: ElasticRobot, q: PerJoint, eta: PerElastic | None = None
) -> PerJoint:
    """Torques [N m] behind the gears that hold the robot at rest, shape (axes,)."""
    zero = jnp.zeros_like(q)
    return inverse_dynamics(robot, q, zero, zero, eta)[0]
