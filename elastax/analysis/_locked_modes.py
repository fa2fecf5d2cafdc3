"""Eigenfrequencies of the elastic robot with its motors locked."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from ..dynamics import ElasticRobot, equations_of_motion, static_equilibrium


def locked_frequencies(
    robot: ElasticRobot, theta: PerJoint
) -> Float[Array, " coordinates"]:
    r"""Undamped eigenfrequencies at the static equilibrium on locked motors.

    $\det(K - \omega^2 M) = 0$ of the joints and the structure, with the stiffness
    $K = \partial h / \partial(q, \eta)$ of springs, gravity and counterbalance.

    Args:
        robot: the robot, with elastic gears.
        theta: motor angles on the output side [rad], shape (axes,).

    Returns:
        Frequencies in ascending order [Hz], shape (axes + elastic,); NaN where the
        equilibrium is unstable.

    Raises:
        ValueError: the gears are rigid.
    """
    if not robot.has_elastic_gears:
        raise ValueError("locked motors need elastic gears; `rigid()` took them away")
    n = robot.axes
    zero, rest = jnp.zeros_like(theta), jnp.zeros((robot.elastic,), theta.dtype)
    q, eta = static_equilibrium(robot, theta)

    def blocks(x):
        return equations_of_motion(robot, x[:n], x[n:], theta, zero, rest, zero)

    def forces(x):
        eom = blocks(x)
        return jnp.concatenate([eom.h_a, eom.h_e])

    x = jnp.concatenate([q, eta])
    eom = blocks(x)
    mass = jnp.block([[eom.M_aa, eom.M_ae], [eom.M_ae.T, eom.M_ee]])
    stiffness = jax.jacfwd(forces)(x)
    factor = jnp.linalg.cholesky(mass)
    half = jax.scipy.linalg.solve_triangular(factor, stiffness, lower=True)
    whole = jax.scipy.linalg.solve_triangular(factor, half.T, lower=True)
    squares = jnp.linalg.eigvalsh(0.5 * (whole + whole.T))
    return jnp.sqrt(squares) / (2 * jnp.pi)
