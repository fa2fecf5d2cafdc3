r"""Propagation of systematic and random deviations, to first order.

A model $f_I(y, x') = 0$ with the inputs and parameters $x' = (x, p)$ has the
sensitivity $Q = -J_y^{-1} J_{x'}$; an explicit one $y = f(x')$ has $Q = \partial
f/\partial x'$. Bounds of systematic deviations go through $|Q|$, covariances of random
ones through $Q S Q^T$. For a chain x are the joint coordinates and p its parameters.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint
from ._chain import forward_kinematics
from ._jacobian import jacobian
from ._logarithm import pose_difference
from ._parameters import ChainParameters, parameter_jacobian


def explicit_sensitivity(
    function: Callable[[Float[Array, " inputs"]], Float[Array, " outputs"]],
    inputs: Float[Array, " inputs"],
) -> Float[Array, "outputs inputs"]:
    """Sensitivity of an explicit model y = f(x').

    Args:
        function: the model.
        inputs: x' at which it is taken.

    References:
        [KinModell] (3-100).
    """
    return jax.jacfwd(function)(inputs)


def implicit_sensitivity(
    residual: Callable[
        [Float[Array, " outputs"], Float[Array, " inputs"]], Float[Array, " outputs"]
    ],
    outputs: Float[Array, " outputs"],
    inputs: Float[Array, " inputs"],
) -> Float[Array, "outputs inputs"]:
    r"""Sensitivity $-J_y^{-1}J_{x'}$ of an implicit model $f_I(y, x') = 0$.

    The text omits the sign, which neither bounds nor covariances see.

    Args:
        residual: the model, of y and x'.
        outputs: y, a solution at which $J_y$ is regular; not checked.
        inputs: x'.

    References:
        [KinModell] (3-135), (3-137).
    """
    by_outputs, by_inputs = jax.jacfwd(residual, (0, 1))(outputs, inputs)
    return -jnp.linalg.solve(by_outputs, by_inputs)


def worst_case(
    sensitivity: Float[Array, "outputs inputs"], bounds: Float[Array, " inputs"]
) -> Float[Array, " outputs"]:
    r"""Largest deviations that bounded ones can add up to, element by element.

    $|\Delta y|_{max} = |Q|\,|\Delta x'|_{max}$. The absolute value is taken behind the
    product $J_y^{-1}J_{x'}$; the product of absolute values that the text prints is
    larger in general, and equal for explicit models.

    Args:
        sensitivity: Q, shape (outputs, inputs).
        bounds: on the absolute deviations of the inputs, not negative.

    References:
        [KinModell] (3-136), corrected.
    """
    return jnp.abs(sensitivity) @ bounds


def propagated_covariance(
    sensitivity: Float[Array, "outputs inputs"],
    covariance: Float[Array, "inputs inputs"],
) -> Float[Array, "outputs outputs"]:
    r"""Covariance $S_y = Q S_{x'} Q^T$; the square roots of its diagonal are 1-sigma.

    Args:
        sensitivity: Q, shape (outputs, inputs).
        covariance: of the inputs, shape (inputs, inputs).

    References:
        [KinModell] (3-137), (3-138).
    """
    return sensitivity @ covariance @ sensitivity.T


class Quantisation(NamedTuple):
    """What is known of a reading to the nearest step.

    Attributes:
        bound: half a step.
        variance: of an error that is uniform over a step, its square over twelve.
    """

    bound: PerJoint
    variance: PerJoint


def quantisation(resolution: PerJoint) -> Quantisation:
    """Bound and variance from the resolution of the encoders.

    Args:
        resolution: one step of each joint [rad] or [m].
    """
    return Quantisation(resolution / 2, resolution**2 / 12)


def tool_sensitivity(
    parameters: ChainParameters, q: PerJoint
) -> Float[Array, "6 inputs"]:
    """Sensitivity of the tool's pose to joint coordinates and parameters.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Shape (6, joints + parameters): translation [m] above rotation [rad] in the base
        frame, per unit of each.

    References:
        [KinModell] (3-100).
    """
    moving = jacobian(parameters.chain, q)
    return jnp.concatenate([moving, parameter_jacobian(parameters, q)], axis=1)


def tool_worst_case(
    parameters: ChainParameters,
    q: PerJoint,
    joint_bounds: PerJoint,
    parameter_bounds: Float[Array, " parameters"],
) -> Float[Array, "6"]:
    """Largest first-order deviation of the tool under bounded deviations.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).
        joint_bounds: on the joint coordinates, such as `quantisation(...).bound`.
        parameter_bounds: on the parameters [m] or [rad], shape (parameters,).

    Returns:
        Translations [m] and rotations [rad] in the base frame, shape (6,).

    References:
        [KinModell] (3-136), corrected: see `worst_case`.
    """
    bounds = jnp.concatenate([joint_bounds, parameter_bounds])
    return worst_case(tool_sensitivity(parameters, q), bounds)


def tool_covariance(
    parameters: ChainParameters,
    q: PerJoint,
    joint_covariance: Float[Array, "joints joints"],
    parameter_covariance: Float[Array, "parameters parameters"],
) -> Float[Array, "6 6"]:
    """First-order covariance of the tool's pose.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).
        joint_covariance: such as `jnp.diag(quantisation(...).variance)`.
        parameter_covariance: such as the one of a calibration; independent of the
            former.

    Returns:
        Shape (6, 6), translation [m] above rotation [rad], in the base frame.

    References:
        [KinModell] (3-137).
    """
    moving = propagated_covariance(jacobian(parameters.chain, q), joint_covariance)
    fixed = parameter_jacobian(parameters, q)
    return moving + propagated_covariance(fixed, parameter_covariance)


def tool_deviation(
    parameters: ChainParameters,
    q: PerJoint,
    joint_deviation: PerJoint,
    parameter_deviation: Float[Array, " parameters"],
) -> Float[Array, "6"]:
    """Displacement of the tool under given deviations, without linearising.

    Under `vmap` over random deviations this is the Monte-Carlo check of
    `tool_covariance` and `tool_worst_case`.

    Args:
        parameters: of the chain, at their nominal values.
        q: joint coordinates [rad] or [m], shape (joints,).
        joint_deviation: of the joint coordinates.
        parameter_deviation: of the parameters [m] or [rad], shape (parameters,).

    Returns:
        Difference of the positions [m] and rotation vector [rad] in the base frame,
        shape (6,).
    """
    moved = parameters.moved(parameter_deviation)
    return pose_difference(
        forward_kinematics(moved, q + joint_deviation),
        forward_kinematics(parameters.chain, q),
    )
