"""Tool and mounting poses from few measurements, in closed form and refined."""

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import Scalar, Transform, Vector3, require_float64
from ._calibration_problem import CalibrationProblem
from ._chain import SerialChain
from ._estimate import Estimate, NoiseVariance, estimate_parameters
from ._instruments import PointInstrument
from ._measurements import Measurements
from ._parameters import ChainParameters
from ._registration import PointFit, RotationFit, _require, fit_points, mean_rotation
from ._se3 import inverse_transform, transform


class ToolCentre(eqx.Module):
    """Tool centre point from poses in which it touched one fixed point.

    Attributes:
        position: of the tool centre point in the flange frame [m], shape (3,).
        point: the fixed point in the base frame [m], shape (3,).
        covariance: of both, one behind the other, shape (6, 6) [m^2].
        residuals: fixed point minus tool centre point of each pose, in the base frame
            [m], shape (poses, 3).
    """

    position: Vector3
    point: Vector3
    covariance: Float[Array, "6 6"]
    residuals: Float[Array, "poses 3"]

    def standard_deviation(self) -> Vector3:
        """Of the tool centre point along x, y, z of the flange [m]."""
        return jnp.sqrt(jnp.diagonal(self.covariance)[:3])


class Mounting(eqx.Module):
    """Pose of an arm's first frame in the frame of a measuring system.

    Attributes:
        pose: the refined one, shape (4, 4) [m].
        fit: the closed form with which the refinement began.
        estimate: the refinement; its deviations `base_x` to `base_rz` are those from
            the closed form, in the arm's frame, and have its uncertainty.
    """

    pose: Transform
    fit: PointFit
    estimate: Estimate


def tool_centre_point(
    flange_poses: Float[Array, "poses 4 4"],
    *,
    deviation: Scalar | float | None = None,
    smallest_turn: float = 0.05,
) -> ToolCentre:
    r"""Tool centre point from poses in which it touched one fixed point.

    The four-point method, for three poses or more: $R_i\,t + p_i = c$ in the sense of
    least squares for the tool centre point t and the fixed point c.

    Args:
        flange_poses: poses of the flange in the base frame [m], shape (poses, 4, 4).
        deviation: standard deviation of touching and of the arm together, per axis
            [m]; from the residuals unless given.
        smallest_turn: root mean square of the angle by which the poses must be turned
            against one another, about any axis [rad]. Errors of t are about those of
            touching over this angle.

    Raises:
        ValueError: fewer than three poses, poses of one orientation, or poses that are
            turned about one axis only.
    """
    require_float64("a tool centre point")
    number = flange_poses.shape[0]
    if number < 3:
        raise ValueError(
            "`flange_poses` must hold three poses at least, four are usual, but hold "
            f"{number}: two leave the coordinate along their common axis open"
        )
    rotation, position = flange_poses[:, :3, :3], flange_poses[:, :3, 3]
    # the fixed point is eliminated by taking everything minus its mean
    turns = rotation - jnp.mean(rotation, axis=0)[None]
    stacked = turns.reshape(-1, 3)
    values = jnp.linalg.svd(stacked, compute_uv=False) / np.sqrt(number)
    stacked = _require(
        stacked,
        values[0] > smallest_turn,
        "`flange_poses` must have different orientations, but have one: turn the tool "
        "about the fixed point",
    )
    stacked = _require(
        stacked,
        values[2] > smallest_turn,
        "`flange_poses` must be turned about different axes, but are turned about one: "
        "the coordinate of the tool centre point along it is not determined",
    )
    shift = position - jnp.mean(position, axis=0)[None]
    basis, upper = jnp.linalg.qr(stacked)
    # one solution for the tool and for the inverse, of which the covariance is made
    identity = jnp.eye(3, dtype=upper.dtype)
    right = jnp.concatenate([-(basis.T @ shift.reshape(-1))[:, None], identity], axis=1)
    solved = jsl.solve_triangular(upper, right)
    tool, root = solved[:, 0], solved[:, 1:]
    tips = jnp.einsum("kij,j->ki", rotation, tool) + position
    point = jnp.mean(tips, axis=0)
    residuals = point[None] - tips
    if deviation is None:
        variance = jnp.sum(residuals**2) / (3 * number - 6)
    else:
        variance = jnp.asarray(deviation, tool.dtype) ** 2
    # c = mean(R) t + mean(p), whose parts are independent
    turned = jnp.mean(rotation, axis=0)
    own = root @ root.T
    cross = own @ turned.T
    covariance = variance * jnp.block(
        [[own, cross], [cross.T, turned @ cross + identity / number]]
    )
    return ToolCentre(tool, point, covariance, residuals)


def frame_from_points(
    origin: Vector3, on_x: Vector3, in_xy: Vector3, *, smallest_lever: float = 1e-3
) -> Transform:
    """Frame from its origin, a point on its positive x axis and one with positive y.

    Args:
        origin, on_x, in_xy: positions [m], shape (3,).
        smallest_lever: least distance of `on_x` from `origin`, and of `in_xy` from the
            line through both [m].

    Returns:
        Pose of the frame, shape (4, 4).

    Raises:
        ValueError: the points coincide or lie on one line.
    """
    along, aside = on_x - origin, in_xy - origin
    length = jnp.linalg.norm(along)
    along = _require(
        along,
        length > smallest_lever,
        "`on_x` must not coincide with `origin`",
    )
    x = along / length
    aside = aside - x * (x @ aside)
    width = jnp.linalg.norm(aside)
    aside = _require(
        aside,
        width > smallest_lever,
        "`in_xy` must not lie on the line through `origin` and `on_x`",
    )
    y = aside / width
    return transform(jnp.stack([x, y, jnp.cross(x, y)], axis=1), origin)


def tool_frame(flange_poses: Float[Array, "3 4 4"], point: Vector3) -> Transform:
    """Tool frame from three poses that bring three of its points to a fixed point.

    The two-point method for the orientation: first the tool centre point touches the
    fixed point, then a point on the tool's positive x axis, then a point of its x-y
    plane with positive y.

    Args:
        flange_poses: poses of the flange in the base frame [m], in this order.
        point: the fixed point in the base frame [m], such as that of a `ToolCentre`.

    Returns:
        Pose of the tool in the flange frame, shape (4, 4).

    Raises:
        ValueError: the three points lie on one line of the tool.
    """
    touched = lambda pose: inverse_transform(pose)[:3] @ jnp.append(point, 1.0)
    origin, on_x, in_xy = jax.vmap(touched)(flange_poses)
    return frame_from_points(origin, on_x, in_xy)


def tool_orientation(
    flange_rotations: Float[Array, "poses 3 3"],
    tool_rotations: Float[Array, "poses 3 3"],
) -> RotationFit:
    """Orientation of the tool in the flange frame from measured orientations of both.

    Args:
        flange_rotations: of the flange in the base frame, shape (poses, 3, 3).
        tool_rotations: of the tool in the base frame, measured or aligned with an axis
            system that is known, shape (poses, 3, 3).

    Returns:
        Mean, residuals in the flange frame [rad] and their spread.

    Raises:
        ValueError: fewer than two poses, or orientations that contradict one another.
    """
    return mean_rotation(jnp.einsum("kji,kjl->kil", flange_rotations, tool_rotations))


def mounting_pose(
    chain: SerialChain,
    measurements: Measurements,
    *,
    noise: NoiseVariance = NoiseVariance.GIVEN,
    smallest_spread: float = 1e-3,
) -> Mounting:
    """Pose of an arm in the frame of a measuring system that reads points on the tool.

    The closed form needs no start and weighs all readings alike. From there the
    weighted readings are fitted, which also gives the uncertainty.

    Args:
        chain: the arm; its base pose may be anything.
        measurements: of a `PointInstrument`.
        noise: as for `estimate_parameters`.
        smallest_spread: of `fit_points` [m].

    Raises:
        TypeError: another instrument.
        ValueError: the points lie on one line.
    """
    instrument = measurements.instrument
    if not isinstance(instrument, PointInstrument):
        raise TypeError(
            "`measurements` must be those of a PointInstrument, but are those of a "
            f"{type(instrument).__name__}"
        )
    free = eqx.tree_at(lambda c: c.base, chain, jnp.eye(4, dtype=chain.base.dtype))
    points = jax.vmap(lambda q: instrument.predict(free, q))(measurements.q)
    fit = fit_points(
        points.reshape(-1, 3),
        measurements.readings.reshape(-1, 3),
        smallest_spread=smallest_spread,
    )
    placed = eqx.tree_at(lambda c: c.base, chain, fit.pose)
    names = [f"base_{c}" for c in ("x", "y", "z", "rx", "ry", "rz")]
    base = ChainParameters.of(placed, tool=False).select(names)
    estimate = estimate_parameters(CalibrationProblem(base, measurements), noise=noise)
    return Mounting(estimate.chain().base, fit, estimate)
