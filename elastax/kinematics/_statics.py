r"""Forces at the tool against torques of the joints, and the compliance between them.

A wrench is a force [N] above a moment [N m], shape (6,), that the tool exerts on its
surroundings, about the origin of the tool frame. Friction and weight are left out: the
power at the tool is that of the joints, $F^T v = \tau^T \dot q$.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._custom_types import PerJoint, Scalar, Transform, Vector3
from .._kernel import kernel
from ._angle_rates import rpy_rate_matrix, rpy_rates
from ._chain import SerialChain
from ._ik_dls import row_weights
from ._jacobian import jacobian


Wrench = Float[Array, "6"]


@kernel
def joint_torques(chain: SerialChain, q: PerJoint, wrench: Wrench) -> PerJoint:
    r"""Torques with which the joints hold a wrench of the tool, $\tau = J^T F$.

    The text writes F for the pose in roll-pitch-yaw angles, whose moment part is
    $E^T m$: `wrench_from_generalised` converts it. For wrenches in the tool frame see
    `wrench_to_base`.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).
        wrench: force and moment in the base frame [N, N m], shape (6,).

    Returns:
        Torques [N m] of revolute and forces [N] of prismatic joints, shape (joints,).

    References:
        [KinModell] (3-114) to (3-118), (3-124).
    """
    return jacobian(chain, q).T @ wrench


class WrenchEstimate(eqx.Module):
    """Wrench at the tool from torques of the joints.

    Attributes:
        value: force and moment in the base frame [N, N m], shape (6,): of all wrenches
            that fit the one of least scaled length.
        undetermined: shape (6, 6): multiplied by any wrench, it gives a part that the
            structure carries without the joints. Zero away from singular poses of arms
            with six joints or more.
        rank: number of independent components that the torques determine.
        residual: torques that no wrench at the tool explains [N m], shape (joints,).
    """

    value: Wrench
    undetermined: Float[Array, "6 6"]
    rank: Int[Array, ""]
    residual: PerJoint


def wrench_from_joint_torques(
    chain: SerialChain,
    q: PerJoint,
    torques: PerJoint,
    *,
    characteristic_length: Scalar | float = 1.0,
    tolerance: float = 1e-6,
) -> WrenchEstimate:
    r"""Wrench at the tool that the torques of the joints hold, by least squares.

    The text inverts $J^T$ (3-129); the pseudo-inverse that stands here instead covers
    redundant arms, arms with fewer than six joints, and singular poses.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).
        torques: of the joints, without friction and weight [N m] or [N].
        characteristic_length: length that makes a moment comparable to a force [m].
        tolerance: singular values of the scaled Jacobian below this share of the
            largest one count as zero.

    References:
        [KinModell] (3-129).
    """
    scale = row_weights(jnp.asarray(characteristic_length, q.dtype))
    # of the scaled wrench, whose moments are forces at the characteristic length
    matrix = (scale[:, None] * jacobian(chain, q)).T
    inverse = jnp.linalg.pinv(matrix, rtol=tolerance)
    determined = inverse @ matrix
    scaled = inverse @ torques
    free = jnp.eye(6, dtype=q.dtype) - determined
    return WrenchEstimate(
        value=scale * scaled,
        undetermined=scale[:, None] * free / scale[None],
        rank=jnp.round(jnp.trace(determined)).astype(int),
        residual=torques - matrix @ scaled,
    )


@kernel
def wrench_to_base(pose: Transform, wrench: Wrench) -> Wrench:
    """Wrench in base coordinates from one in tool coordinates, about the same point.

    Args:
        pose: of the tool in the base frame, shape (4, 4).
        wrench: force and moment in the tool frame [N, N m].
    """
    rotation = pose[:3, :3]
    return jnp.concatenate([rotation @ wrench[:3], rotation @ wrench[3:]])


@kernel
def wrench_to_tool(pose: Transform, wrench: Wrench) -> Wrench:
    """Wrench in tool coordinates from one in base coordinates, about the same point.

    Args:
        pose: of the tool in the base frame, shape (4, 4).
        wrench: force and moment in the base frame [N, N m].
    """
    rotation = pose[:3, :3]
    return jnp.concatenate([wrench[:3] @ rotation, wrench[3:] @ rotation])


@kernel
def wrench_about(wrench: Wrench, point: Vector3, other: Vector3) -> Wrench:
    """The same load with its moment about another point.

    Args:
        wrench: force and moment about `point` [N, N m].
        point, other: in the frame of the wrench [m], shape (3,).
    """
    force, moment = wrench[:3], wrench[3:]
    return jnp.concatenate([force, moment + jnp.cross(point - other, force)])


def generalised_wrench(rpy: Vector3, wrench: Wrench) -> Wrench:
    r"""Generalised force of a pose in roll-pitch-yaw angles, $(f, E^T m)$.

    Args:
        rpy: angles of the tool [rad], shape (3,).
        wrench: force and moment in the base frame [N, N m].

    Returns:
        Force [N] above the generalised moment [N m], shape (6,).

    References:
        [KinModell] (3-114) to (3-118), with the precondition of the errata: the text
        takes F for force and moment, which hold for the geometric Jacobian.
    """
    moment = rpy_rate_matrix(rpy).T @ wrench[3:]
    return jnp.concatenate([wrench[:3], moment])


def wrench_from_generalised(
    rpy: Vector3, generalised: Wrench, *, throw: bool = True
) -> Wrench:
    r"""Force and moment of a generalised force, $(f, E^{-T}\mu)$.

    Args:
        rpy: angles of the tool [rad], shape (3,).
        generalised: force [N] above the generalised moment $\mu$ [N m].
        throw: raise an error in gimbal lock, where a generalised moment may have no
            moment of its own; otherwise see `rpy_rates`.

    Returns:
        Force and moment in the base frame [N, N m], shape (6,).
    """
    inverse = rpy_rates(rpy, jnp.eye(3, dtype=rpy.dtype), throw=throw)
    return jnp.concatenate([generalised[:3], inverse.T @ generalised[3:]])


def tool_compliance(
    chain: SerialChain,
    q: PerJoint,
    stiffness: PerJoint,
    wrench: Wrench | None = None,
) -> Float[Array, "6 6"]:
    r"""Displacement of the tool per wrench on it, $C = J K^{-1} J^T$.

    Under a load F that is constant in the base frame the lever arms change as the
    joints give way, $C = J (K - \partial(J^TF)/\partial q)^{-1} J^T$; both hold at the
    deflected joint coordinates.

    Args:
        chain: the chain.
        q: joint coordinates behind the springs [rad] or [m], shape (joints,).
        stiffness: of the joints [N m/rad] or [N/m]; infinite for a rigid one.
        wrench: load on the tool in the base frame [N, N m], none unless given. It must
            be below the one under which the arm buckles.

    Returns:
        Shape (6, 6), in the base frame: [m] and [rad] per [N] and [N m].
    """
    matrix = jacobian(chain, q)
    compliance = 1 / stiffness
    if wrench is None:
        return _through_springs(matrix, compliance)
    softening = jax.jacfwd(lambda x: joint_torques(chain, x, wrench))(q)
    # (K - S)^-1 = (1 - K^-1 S)^-1 K^-1, finite for rigid joints
    spring = jnp.eye(chain.number, dtype=q.dtype) - compliance[:, None] * softening
    return matrix @ jnp.linalg.solve(spring, compliance[:, None] * matrix.T)


@kernel
def _through_springs(
    matrix: Float[Array, "6 joints"], compliance: PerJoint
) -> Float[Array, "6 6"]:
    return (matrix * compliance[None]) @ matrix.T


def tool_stiffness(
    chain: SerialChain,
    q: PerJoint,
    stiffness: PerJoint,
    wrench: Wrench | None = None,
    *,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
    tolerance: float = 1e-9,
) -> Float[Array, "rows rows"]:
    """Wrench per displacement of the tool: the inverse of `tool_compliance`.

    Args:
        chain, q, stiffness, wrench: as for `tool_compliance`.
        rows: displacements that count; in the other directions the tool is free of
            load. (0, 1, 2) is what a force on the tip meets.
        characteristic_length: length that makes rotations comparable to translations
            [m].
        tolerance: least share of the largest compliance that all directions must have.

    Returns:
        Shape (rows, rows), in the base frame.

    Raises:
        RuntimeError: in some direction the tool cannot give way at all: the pose is
            singular, or `rows` has more entries than the arm has joints.
    """
    counted = np.array(rows)
    compliance = tool_compliance(chain, q, stiffness, wrench)[counted][:, counted]
    weights = row_weights(jnp.asarray(characteristic_length, q.dtype), rows)
    scaled = jax.lax.stop_gradient(weights[:, None] * compliance * weights[None])
    values = jnp.linalg.svd(scaled, compute_uv=False)
    compliance = eqx.error_if(
        compliance,
        ~(values[-1] > tolerance * values[0]),
        "the tool gives way in every direction of `rows` only away from singular "
        "poses: use `tool_compliance`, or fewer `rows`",
    )
    return jnp.linalg.inv(compliance)
