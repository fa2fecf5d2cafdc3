r"""Pose corrections of a chain that structural deformations move: Newton's method.

The number of steps is fixed, so that the cost is known beforehand and everything maps
over batches. Derivatives come from the implicit function theorem, not from the steps.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._checks import check_fields
from .._custom_types import PerElastic, PerJoint, Scalar, Transform, as_real
from .._kernel import kernel
from .._taylor import leading
from ._chain import SerialChain, moving_frames
from ._ik_dls import damped_least_squares, pose_error, row_weights
from ._jacobian import tool_jacobian
from ._safe_angles import root
from ._se3 import transform


PerAxis = Float[Array, " axes"]
_ALL_ROWS = (0, 1, 2, 3, 4, 5)


class DeformableArm(eqx.Module):
    r"""A chain whose joints follow driven axes and elastic coordinates.

    $s = G\,(q, \eta)$: G has one column per axis, then one per elastic coordinate. The
    record of an elastic robot makes one by its method `deformable_arm`.

    Attributes:
        chain: all joints, driven and elastic ones in their order.
        coupling: G, shape (joints, axes + elastic).
        axis_joints: the chain's joint of every axis.
    """

    chain: SerialChain
    coupling: Float[Array, "joints coordinates"] = eqx.field(converter=as_real)
    axis_joints: tuple[int, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        rows, columns = self.coupling.shape
        if rows != self.chain.number or columns < self.axes:
            raise ValueError(
                "`coupling` must have one row per joint and a column for every axis: "
                f"there are {self.chain.number} joints and {self.axes} axes, but its "
                f"shape is {(rows, columns)}"
            )

    @staticmethod
    def rigid(chain: SerialChain) -> "DeformableArm":
        """The chain itself, every joint an axis, without elastic coordinates."""
        number = chain.number
        identity = np.eye(number, dtype=chain.base.dtype)
        return DeformableArm(chain, identity, tuple(range(number)))

    @property
    def axes(self) -> int:
        """Number of driven axes."""
        return len(self.axis_joints)

    def coordinates(self, q: PerAxis, eta: PerElastic) -> PerJoint:
        """Coordinates of all joints of the chain [rad] or [m]."""
        return self.coupling @ jnp.concatenate([q, eta])

    def tool(
        self, q: PerAxis, eta: PerElastic
    ) -> tuple[Transform, Float[Array, "6 axes"]]:
        """Pose of the tool [m] and its geometric Jacobian by the axes [m/rad]."""
        return _tool(self, q, eta if eta.size else None)


class PoseCorrection(eqx.Module):
    """Corrected axes of an arm, and what is left of the error.

    Attributes:
        value: angles of the axes [rad], shape (axes,).
        reached: whether the remaining error is within the tolerance.
        position_error: distance from the target [m].
        rotation_error: remaining rotation [rad], its sine for large ones.
    """

    value: PerAxis
    reached: Bool[Array, ""]
    position_error: Scalar
    rotation_error: Scalar


def correct_pose(
    arm: DeformableArm,
    target: Transform,
    q: PerAxis,
    eta: PerElastic,
    *,
    axes: tuple[int, ...] | None = None,
    rows: tuple[int, ...] = _ALL_ROWS,
    steps: int = 4,
    largest_step: Scalar | float = 0.1,
    characteristic_length: Scalar | float = 1.0,
    tolerance: float = 1e-9,
) -> PoseCorrection:
    r"""Axes at which the tool has a pose, whatever the deformations are.

    $\Delta\varphi = J_f^{-1}\Delta r$, a fixed number of times; where the largest
    change would exceed the limit, all changes are divided by one common factor, which
    keeps their direction. The text divides each by a factor of its own. With fewer axes
    than rows the weighted error is made as small as it gets: [Reiner2010] 3.6.1 keeps
    axis 2 or axis 3 at the rigid solution and moves the two other base axes, that is
    `rows=(0, 1, 2)` with `axes=(0, 2)` or `(0, 1)`.

    Near a singular pose the solution that is nearest in angles may be far, or may not
    exist: the steps then stop at the limit and `reached` is false. The value and its
    derivatives stay finite.

    Args:
        arm: the arm.
        target: pose of the tool in the base frame, shape (4, 4) [m].
        q: start [rad], such as the rigid arm's solution, shape (axes,).
        eta: elastic coordinates [rad], shape (elastic,), held.
        axes: which axes move; all unless given.
        rows: rows of the error that count; (0, 1, 2) leaves the orientation free.
        steps: number of corrections.
        largest_step: largest change of any axis in one correction [rad].
        characteristic_length: length that turns 1 rad into a distance [m]; matters
            where the target cannot be met.
        tolerance: largest error of a reached pose [m] and [rad].

    Returns:
        Angles, whether they are right, and the errors left in the rows that count. The
        derivative with respect to the arm, target, deformations and resting axes is
        that of the implicit function.

    Raises:
        ValueError: `axes` or `rows` are not distinct indices, or `steps` is negative.

    References:
        [Reiner2010] (3.54) to (3.58), with the relative rotation error of
        `rotation_error`.
    """
    axes = tuple(range(arm.axes)) if axes is None else tuple(axes)
    for name, indices, number in (("axes", axes, arm.axes), ("rows", rows, 6)):
        if len(set(indices)) != len(indices) or not set(indices) <= set(range(number)):
            raise ValueError(
                f"`{name}` must be distinct indices from 0 to {number - 1}, but is "
                f"{indices}"
            )
    if steps < 0:
        raise ValueError(f"`steps` must not be negative, but is {steps}")
    length = jnp.asarray(characteristic_length, q.dtype)
    largest = jnp.asarray(largest_step, q.dtype)
    some = eta if eta.size else None
    value = _newton(
        arm, target, q, some, length, largest, axes=axes, rows=rows, steps=steps
    )
    reported = jax.lax.stop_gradient((arm, target, value, eta))
    error, near = _remaining(*reported, rows)
    position = root(jnp.sum(error[:3] ** 2), 0.0)
    rotation = root(jnp.sum(error[3:] ** 2), 0.0)
    reached = near & (position <= tolerance) & (rotation <= tolerance)
    return PoseCorrection(value, reached, position, rotation)


@kernel
def _tool(arm: DeformableArm, q: PerAxis, eta: PerElastic | None):
    stacked = q if eta is None else jnp.concatenate([q, eta])
    frames = moving_frames(arm.chain, arm.coupling @ stacked)
    pose = transform(leading(frames.tool_rotation), leading(frames.tool_position))
    matrix = leading(tool_jacobian(arm.chain, frames))
    return pose, matrix @ arm.coupling[:, : arm.axes]


def _remaining(arm, target, q, eta, rows):
    """Error in the rows that count, zero elsewhere; whether half a turn is excluded."""
    actual, _ = arm.tool(q, eta)
    counted = np.isin(np.arange(6), rows).astype(q.dtype)
    error = pose_error(target, actual) * counted
    # the rotation error vanishes at half a turn as well
    near = jnp.sum(target[:3, :3] * actual[:3, :3]) > 1
    return error, near if set(rows) >= {3, 4, 5} else jnp.array(True)


def _solve(matrix, error):
    """Least squares with a damping that only a singular matrix feels."""
    size = jnp.sqrt(jnp.sum(matrix**2))
    # the squares of both must be told apart from rounding
    rounding = float(np.sqrt(jnp.finfo(matrix.dtype).eps))
    return leading(damped_least_squares(matrix, error, 10 * rounding * size))


def _selection(indices: tuple[int, ...], number: int, dtype) -> np.ndarray:
    """Rows of the identity: products with it are read by index in a kernel."""
    return np.eye(number, dtype=dtype)[list(indices)]


@kernel
def _step(arm, target, q, eta, length, largest, axes, rows):
    """One correction, (3.57) and (3.58)."""
    actual, matrix = _tool(arm, q, eta)
    counted = row_weights(length)[:, None] * _selection(rows, 6, q.dtype).T
    moving = _selection(axes, arm.axes, q.dtype)
    error = counted.T @ pose_error(target, actual)
    change = _solve(counted.T @ matrix @ moving.T, error)
    # [Reiner2010] (3.58) with the largest of the factors c_lim for all
    factor = jnp.maximum(1.0, jnp.max(jnp.abs(change)) / largest)
    return q + moving.T @ (change / factor)


@eqx.filter_custom_jvp
def _newton(arm, target, q, eta, length, largest, *, axes, rows, steps):
    def step(_, q):
        return _step(arm, target, q, eta, length, largest, axes, rows)

    return jax.lax.fori_loop(0, steps, step, q)


@_newton.def_jvp
def _newton_jvp(primals, tangents, *, axes, rows, steps):
    arm, target, q, eta, length, largest = primals
    arm_t, target_t, q_t, eta_t, *_ = tangents
    value = _newton(*primals, axes=axes, rows=rows, steps=steps)
    actual, matrix = _tool(arm, value, eta)
    # what moves the tool with the moving axes at rest, and what moves the target
    tool_t = jnp.zeros_like(actual)
    if jax.tree.leaves((arm_t, eta_t)):
        pose = lambda arm, eta: _tool(arm, value, eta)[0]
        _, tool_t = eqx.filter_jvp(pose, (arm, eta), (arm_t, eta_t))
    target_t = jnp.zeros_like(target) if target_t is None else target_t
    _, error_t = jax.jvp(pose_error, (target, actual), (target_t, tool_t))
    resting = np.isin(np.arange(arm.axes), axes, invert=True).astype(q.dtype)
    resting_t = jnp.zeros_like(q) if q_t is None else resting * q_t
    error_t = error_t - matrix @ resting_t
    counted = row_weights(length)[:, None] * _selection(rows, 6, q.dtype).T
    moving = _selection(axes, arm.axes, q.dtype)
    change = _solve(counted.T @ matrix @ moving.T, counted.T @ error_t)
    return value, resting_t + moving.T @ change
