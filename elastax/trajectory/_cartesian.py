"""Straight Cartesian paths with corners, and their way into joint space."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import Scalar, Vector3, as_real
from ._ptp import SevenSegments, check_limits


class StraightPath(eqx.Module):
    """Straight edges between waypoints, each run from rest to rest.

    The corners are met exactly and without blending. Every edge is the fastest
    motion under the limits along the path. Before the start and after the end the
    point rests.

    Attributes:
        waypoints: corners in the base frame, shape (corners, 3) [m], at least two;
            equal neighbours make an edge of no duration.
        max_velocity: limit of the speed along the path [m/s], positive.
        max_acceleration: limit of the acceleration [m/s^2], positive.
        max_jerk: limit of the jerk [m/s^3], positive.

    Raises:
        ValueError: wrong shapes, fewer than two waypoints, waypoints that are not
            finite, or limits that are not positive and finite.

    References:
        [Reiner2010] section 6.2.2, figure 6.5: a rectangular path of this kind.
    """

    waypoints: Float[Array, "corners 3"] = eqx.field(converter=as_real)
    max_velocity: Scalar = eqx.field(converter=as_real)
    max_acceleration: Scalar = eqx.field(converter=as_real)
    max_jerk: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        if self.waypoints.shape[0] < 2:
            raise ValueError(
                "`waypoints` must hold at least two points, but has the shape "
                f"{self.waypoints.shape}"
            )
        finite = jnp.isfinite(self.waypoints)
        check_values("`waypoints` must be finite", self.waypoints, finite)
        check_limits(self)

    def profile(self) -> SevenSegments:
        """Motion along all edges, each from 0 to 1; arrays of shape (corners - 1,)."""
        squares = jnp.sum(jnp.diff(self.waypoints, axis=0) ** 2, axis=1)
        # The root of zero has no finite derivative.
        safe = jnp.where(squares > 0, squares, jnp.ones_like(squares))
        length = jnp.where(squares > 0, jnp.sqrt(safe), jnp.zeros_like(squares))
        return SevenSegments.from_limits(
            length / self.max_velocity,
            length / self.max_acceleration,
            length / self.max_jerk,
        )

    @property
    def corner_times(self) -> Float[Array, " corners"]:
        """Times at which the waypoints are met [s], the first one zero."""
        ends = jnp.cumsum(self.profile().duration)
        return jnp.concatenate([jnp.zeros_like(ends[:1]), ends])

    @property
    def duration(self) -> Scalar:
        """Time from the first to the last waypoint [s]."""
        return self.corner_times[-1]

    def position(self, t: ArrayLike) -> Vector3:
        """Point on the path [m] at the time `t` [s]."""
        edge, time, profile = self._edge(t)
        done, left = profile.position(time)
        first, last = self.waypoints[edge], self.waypoints[edge + 1]
        # From the nearer corner, so that corners are met to the last digit.
        return jnp.where(
            done < left,
            first + done * (last - first),
            last - left * (last - first),
        )

    def velocity(self, t: ArrayLike) -> Vector3:
        """Velocity of the point [m/s] at the time `t` [s]."""
        edge, time, profile = self._edge(t)
        edge_vector = self.waypoints[edge + 1] - self.waypoints[edge]
        return profile.velocity(time) * edge_vector

    def acceleration(self, t: ArrayLike) -> Vector3:
        """Acceleration of the point [m/s^2] at the time `t` [s]."""
        edge, time, profile = self._edge(t)
        edge_vector = self.waypoints[edge + 1] - self.waypoints[edge]
        return profile.acceleration(time) * edge_vector

    def _edge(self, t: ArrayLike) -> tuple[Array, Array, SevenSegments]:
        """Number of the edge at `t`, the time since its start, and its profile."""
        t, corners, profile = as_real(t), self.corner_times, self.profile()
        edge = jnp.sum(corners[1:-1] <= t)
        edge_profile = jax.tree.map(lambda leaf: leaf[edge], profile)
        return edge, t - corners[edge], edge_profile


def rectangle(
    origin: ArrayLike, width: ArrayLike, height: ArrayLike, axes: ArrayLike
) -> Float[Array, "5 3"]:
    """Waypoints of a rectangle, back to its start, as in figure 6.5.

    Args:
        origin: first and last corner [m], shape (3,).
        width: length of the edge along `axes[0]`, which is run first [m].
        height: length of the edge along `axes[1]` [m].
        axes: two orthonormal directions in the base frame, shape (2, 3).

    Raises:
        ValueError: wrong shapes, or axes that are not orthonormal.

    References:
        [Reiner2010] section 6.2.2, figure 6.5 (the dimensions are not printed).
    """
    origin, axes = as_real(origin), as_real(axes)
    if origin.shape != (3,) or axes.shape != (2, 3):
        raise ValueError(
            "`origin` must have the shape (3,) and `axes` (2, 3), but they have "
            f"{origin.shape} and {axes.shape}"
        )
    gram = axes @ axes.T
    straight = jnp.abs(gram - jnp.eye(2, dtype=gram.dtype)) < 1e-6
    check_values("`axes` must be orthonormal", axes, jnp.all(straight))
    across, up = as_real(width) * axes[0], as_real(height) * axes[1]
    return jnp.stack(
        [origin, origin + across, origin + across + up, origin + up, origin]
    )


def path_to_joints(
    path: StraightPath,
    times: ArrayLike,
    solve: Callable,
    *,
    initial: ArrayLike | None = None,
) -> Float[Array, "times joints"]:
    """Joint angles along a Cartesian path, by an inverse kinematics of the user.

    Args:
        path: anything with `position(t)`.
        times: at which the angles are wanted, shape (times,) [s].
        solve: inverse kinematics: `solve(position)` -> joint angles (joints,), asked
            at all times at once; with `initial`, `solve(position, previous)`, one
            time after the other, `previous` being the angles at the time before.
        initial: joint angles from which the first solution is sought [rad].

    Returns:
        Joint angles, shape (times, joints) [rad].

    Raises:
        ValueError: angles that are not finite, as at points out of reach.
    """
    times = as_real(times)
    points = jax.vmap(path.position)(times)
    if initial is None:
        joints = jax.vmap(solve)(points)
    else:

        def follow(previous, point):
            angles = solve(point, previous)
            return angles, angles

        _, joints = jax.lax.scan(follow, as_real(initial), points)
    if is_concrete(times, joints):
        reached = np.all(np.isfinite(joints), axis=1)
        if not np.all(reached):
            k = int(np.argmin(reached))
            raise ValueError(
                "the path must stay within reach of `solve`, but has no solution at "
                f"{np.asarray(points)[k]} m (sample {k}, t = {float(times[k]):.6g} s); "
                "move or shorten the path"
            )
    return joints
