r"""Inverse kinematics of the deformed arm without inverting a Jacobian.

Three corrections, one after another, each by the lever of an axis and the deviation
across it. The exact solution by iteration is `correct_pose`.
"""

from typing import NamedTuple

import jax.numpy as jnp

from .._custom_types import PerElastic, Scalar, Vector3
from .._kernel import kernel
from .._taylor import leading
from ._chain import moving_frames
from ._damping import attenuate
from ._pose_correction import DeformableArm, PerAxis
from ._safe_angles import angle, root


class _Points(NamedTuple):
    """Axes and origins of the joints of interest, and the tool, in the base frame."""

    rotation: tuple
    axis: tuple
    origin: tuple
    tool: Vector3


def geometric_correction(
    arm: DeformableArm,
    q: PerAxis,
    eta: PerElastic,
    *,
    steepness: Scalar | float = 1e3,
) -> PerAxis:
    r"""Axes 1 to 3 moved so that the tool of the deformed arm stays nearly in place.

    Each step measures, in the frame of an axis (z along the axis, x along its
    structure), the lever $l_x$ and the deviation $\Delta r_y$ from the undeformed arm,
    target minus actual, and turns the axis by $\arctan(\Delta r_y / l_x)$:

    1. axis 2, by the place of axis 3,
    2. axis 3, by the place of the tool with axis 2 corrected,
    3. axis 1, by the place of the tool, from the same forward kinematics.

    Only the position is corrected, to first order; the orientation keeps its error. The
    plain arctangent of the quotient is meant: a negative lever is no half turn. Near a
    vanishing lever the correction is faded out.

    Args:
        arm: with a spherical wrist behind its third axis; one axis per driven joint.
        q: the rigid arm's solution [rad], shape (axes,).
        eta: deformations [rad], shape (elastic,).
        steepness: $s_\varphi$ of the fading [1/m^2].

    Returns:
        Corrected angles [rad], shape (axes,).

    Raises:
        ValueError: `arm` has fewer than five axes.

    References:
        [Reiner2010] 3.6.2, (3.59). The text leaves the signs to its figure.
    """
    if arm.axes < 5:
        raise ValueError(f"`arm` must have an arm and a wrist, but has {arm.axes} axes")
    some = eta if eta.size else None
    return _corrected(arm, q, some, jnp.asarray(steepness, q.dtype))


@kernel
def _corrected(arm: DeformableArm, q: PerAxis, eta, steepness: Scalar):
    rigid = _points(arm, q, None if eta is None else jnp.zeros_like(eta))

    # the structure behind an axis, as it lies in the frame of the undeformed arm
    along = {
        1: rigid.origin[2] - rigid.origin[1],
        2: rigid.origin[4] - rigid.origin[2],
        # the plane of the arm, also where axis 2 meets axis 1
        0: jnp.cross(rigid.axis[1], rigid.axis[0]),
    }

    def turn(axis: int, points: _Points, actual: Vector3, target: Vector3):
        z = points.axis[axis]
        x = points.rotation[axis] @ (rigid.rotation[axis].T @ along[axis])
        x = x - (x @ z) * z
        x = x / root(x @ x, 0.0)
        lever = x @ (actual - points.origin[axis])
        deviation = jnp.cross(z, x) @ (target - actual)
        # the arctangent of the quotient, without dividing by the lever
        sign = jnp.where(lever < 0, -1.0, 1.0)
        correction = angle(sign * deviation, sign * lever, jnp.zeros_like(lever), 0.0)
        return attenuate(correction, lever, steepness)

    points = _points(arm, q, eta)
    q = q.at[1].add(turn(1, points, points.origin[2], rigid.origin[2]))
    points = _points(arm, q, eta)
    third = turn(2, points, points.tool, rigid.tool)
    first = turn(0, points, points.tool, rigid.tool)
    return q.at[2].add(third).at[0].add(first)


def _points(arm: DeformableArm, q: PerAxis, eta: PerElastic | None) -> _Points:
    stacked = q if eta is None else jnp.concatenate([q, eta])
    frames = moving_frames(arm.chain, arm.coupling @ stacked)
    pick = lambda x: tuple(leading(x)[k] for k in arm.axis_joints)
    return _Points(
        pick(frames.rotation),
        pick(frames.axis),
        pick(frames.position),
        leading(frames.tool_position),
    )
