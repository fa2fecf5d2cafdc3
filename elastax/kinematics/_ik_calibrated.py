"""Inverse kinematics of calibrated arms: all branches, from those of the ideal arm.

Measured parameters leave no axes parallel or perpendicular, hence no closed form. They
deviate by little, hence a few Newton steps from the closed form of the nominal arm.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Scalar, Transform
from ._chain import SerialChain
from ._ik_analytic import SphericalWrist, inverse_kinematics
from ._pose_correction import DeformableArm, PoseCorrection, correct_pose
from ._wrist_weights import WristWeights


def calibrated_inverse_kinematics(
    nominal: SphericalWrist,
    chain: SerialChain,
    pose: Transform,
    previous: Float[Array, "6"] | None = None,
    *,
    steps: int = 3,
    largest_step: Scalar | float = 0.1,
    tolerance: float = 1e-9,
    wrist_weights: WristWeights | None = None,
) -> PoseCorrection:
    """All joint angles at which the tool of a calibrated arm has a pose.

    With errors of 0.5 mm and 0.1 degrees in all parameters of an arm of 3 m, three
    steps reach rounding where the smallest singular value of the Jacobian exceeds 0.1
    (metres and radians mixed); below 0.03 more and more rows fall short of it. Next to
    a singular pose the number of solutions of the calibrated arm differs from that of
    the nominal one: two rows may end in the same solution, a row may end nowhere, and a
    pose that only the calibrated arm reaches may be missed. `reached` tells what a row
    is worth by its remaining error alone, also where the nominal arm falls short of the
    pose.

    Args:
        nominal: the ideal arm.
        chain: the calibrated one, with the same axes and zeros.
        pose: of the tool in the base frame, shape (4, 4) [m].
        previous, wrist_weights: as for `inverse_kinematics`.
        steps: number of Newton steps.
        largest_step: largest change of any axis in one step [rad].
        tolerance: largest error of a reached pose [m] and [rad].

    Returns:
        Eight rows in the order of `inverse_kinematics`: angles within the steps of the
        nominal ones [rad], shape (8, 6), and errors, shape (8,). Derivatives with
        respect to `chain` and `pose` are those of the implicit function.

    Raises:
        ValueError: `chain` has not six joints, or `steps` is negative.
    """
    if chain.number != 6:
        raise ValueError(f"`chain` must have six joints, but has {chain.number}")
    starts, _ = inverse_kinematics(nominal, pose, previous, wrist_weights=wrist_weights)
    arm, nothing = DeformableArm.rigid(chain), jnp.zeros((0,), pose.dtype)

    def correct(start):
        return correct_pose(
            arm,
            pose,
            start,
            nothing,
            steps=steps,
            largest_step=largest_step,
            tolerance=tolerance,
        )

    return jax.vmap(correct)(jax.lax.stop_gradient(starts))
