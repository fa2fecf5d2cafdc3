"""Point-to-point motion of all axes along one jerk-limited profile."""

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, as_real


class SevenSegments(eqx.Module):
    r"""Fastest rest-to-rest motion from 0 to 1 under speed, acceleration, jerk limits.

    Jerk $+j, 0, -j, 0, -j, 0, +j$ in seven segments, symmetric about the middle, with
    the peak acceleration $j\,t_j$ and the peak speed $j\,t_j (t_j + t_a)$. Segments
    that the limits leave no room for have zero length.

    Attributes:
        jerk_time: length $t_j$ of each of the four segments with jerk [s].
        acceleration_time: length $t_a$ of the two with constant acceleration [s].
        cruise_time: length of the one with constant speed [s].
        peak_jerk: $j$ [1/s^3].
    """

    jerk_time: Array
    acceleration_time: Array
    cruise_time: Array
    peak_jerk: Array

    @classmethod
    def from_limits(cls, speed: Array, acceleration: Array, jerk: Array):
        r"""Profile over the distance $D$ under the limits $v$, $a$, $j$.

        The limits are given relative to the distance, so that the motion over no
        distance is an ordinary case, of zero duration. Arrays of one shape.

        Args:
            speed: $D / v$ [s].
            acceleration: $D / a$ [s^2].
            jerk: $D / j$ [s^3].
        """
        # A distance this small counts as none: derivatives would overflow. Harmless
        # numbers in the dead branch keep the derivatives finite there, too.
        moves = jerk > float(jnp.finfo(jerk.dtype).tiny) ** 0.25
        one = jnp.ones_like(jerk)
        tv = jnp.where(moves, speed, one)
        ta = jnp.sqrt(jnp.where(moves, acceleration, one))
        tj = jnp.cbrt(jnp.where(moves, jerk, one))
        # With D = 1: v = 1 / tv, a = 1 / ta^2, j = 1 / tj^3. The jerk segment ends at
        # the acceleration limit, at the speed limit or halfway to the goal.
        rise = jnp.minimum(
            tj * (tj / ta) ** 2, jnp.minimum(tj * jnp.sqrt(tj / tv), tj / 2 ** (1 / 3))
        )
        # Constant acceleration up to the speed limit, or halfway to the goal:
        # (rise + hold) (2 rise + hold) = D / a. Both are negative if `rise` ended
        # before the acceleration limit was reached.
        to_speed = ta * (ta / tv) - rise
        to_goal = ta * jnp.sqrt(1 + (0.5 * rise / ta) ** 2) - 1.5 * rise
        hold = jnp.maximum(jnp.minimum(to_speed, to_goal), jnp.zeros_like(rise))
        # What is left of the distance at the peak speed j rise (rise + hold).
        at_peak = tj * ((tj / rise) * (tj / (rise + hold)))
        cruise = jnp.maximum(at_peak - 2 * rise - hold, jnp.zeros_like(rise))
        zero = jnp.zeros_like(one)
        return cls(
            jnp.where(moves, rise, zero),
            jnp.where(moves, hold, zero),
            jnp.where(moves, cruise, zero),
            jnp.where(moves, (1 / tj) ** 3, zero),
        )

    @property
    def duration(self) -> Array:
        """Length of the motion [s]."""
        return 4 * self.jerk_time + 2 * self.acceleration_time + self.cruise_time

    def position(self, t: ArrayLike) -> tuple[Array, Array]:
        """Distances from the start and to the goal, at the time `t` [s].

        They add up to one. Both are given since the smaller one is the accurate one.
        """
        near = self._motion(t)[0]
        late = self._late(t)
        return jnp.where(late, 1 - near, near), jnp.where(late, near, 1 - near)

    def velocity(self, t: ArrayLike) -> Array:
        """Speed [1/s] at the time `t` [s]."""
        return self._motion(t)[1]

    def acceleration(self, t: ArrayLike) -> Array:
        """Acceleration [1/s^2] at the time `t` [s]."""
        acceleration = self._motion(t)[2]
        return jnp.where(self._late(t), -acceleration, acceleration)

    def jerk(self, t: ArrayLike) -> Array:
        """Jerk [1/s^3] at the time `t` [s], the later value where it jumps."""
        t = as_real(t)
        knots = [jnp.zeros_like(self.jerk_time)]
        lengths = [self.jerk_time, self.acceleration_time, self.jerk_time]
        for length in [*lengths, self.cruise_time, *lengths]:
            knots.append(knots[-1] + length)
        jerk = jnp.zeros_like(knots[0])
        for sign, segment in [(1, 0), (-1, 2), (-1, 4), (1, 6)]:
            inside = (knots[segment] <= t) & (t < knots[segment + 1])
            jerk = jnp.where(inside, sign * self.peak_jerk, jerk)
        return jerk

    def _late(self, t: ArrayLike) -> Array:
        return as_real(t) > 0.5 * self.duration

    def _motion(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Distance from the nearer end, speed and acceleration away from it."""
        t = as_real(t)
        duration = self.duration
        zero = jnp.zeros_like(duration)
        time = jnp.where(t > 0.5 * duration, duration - t, t)
        time = jnp.where(time > 0, time, zero)
        spent = []
        lengths = [self.jerk_time, self.acceleration_time, self.jerk_time]
        for length in [*lengths, self.cruise_time]:
            spent.append(jnp.where(time < length, time, length))
            time = time - spent[-1]
        rising, holding, falling, cruising = spent
        jerk = self.peak_jerk
        peak = jerk * rising
        velocity = rising * (peak / 2)
        position = rising * (velocity / 3) + holding * (velocity + holding * (peak / 2))
        velocity = velocity + holding * peak
        position = position + falling * (
            velocity + falling * (peak / 2 - falling * (jerk / 6))
        )
        velocity = velocity + falling * (peak - falling * (jerk / 2))
        # The cruise starts without acceleration: a rounded one would add up over it.
        position = position + cruising * velocity
        return position, velocity, jerk * (rising - falling)


class PointToPoint(eqx.Module):
    r"""Synchronous point-to-point motion, $q(t) = q_0 + s(t)\,(q_1 - q_0)$.

    One path parameter $s$ from 0 to 1 moves all axes, so that they start and arrive
    together and the path in joint space is straight. $s$ is the fastest rest-to-rest
    motion under the limits of all axes: $\dot s \le \min_i v_i / |\Delta q_i|$ and so
    on. Before the start and after the end the axes rest.

    Attributes:
        start: joint angles at the start [rad], shape (joints,).
        end: joint angles at the end [rad].
        max_velocity: limits of the joint speeds [rad/s], positive.
        max_acceleration: limits of the joint accelerations [rad/s^2], positive.
        max_jerk: limits of the joint jerks [rad/s^3], positive.

    Raises:
        ValueError: wrong shapes, or limits that are not positive and finite.
    """

    start: PerJoint = eqx.field(converter=as_real)
    end: PerJoint = eqx.field(converter=as_real)
    max_velocity: PerJoint = eqx.field(converter=as_real)
    max_acceleration: PerJoint = eqx.field(converter=as_real)
    max_jerk: PerJoint = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("start", "end"):
            value = getattr(self, name)
            check_values(f"`{name}` must be finite", value, jnp.isfinite(value))
        check_limits(self)

    def profile(self) -> SevenSegments:
        """Motion of the path parameter."""
        distance = jnp.abs(self.end - self.start)
        return SevenSegments.from_limits(
            jnp.max(distance / self.max_velocity),
            jnp.max(distance / self.max_acceleration),
            jnp.max(distance / self.max_jerk),
        )

    @property
    def duration(self) -> Scalar:
        """Time from start to end [s]."""
        return self.profile().duration

    def position(self, t: ArrayLike) -> PerJoint:
        """Joint angles [rad] at the time `t` [s]."""
        done, left = self.profile().position(t)
        distance = self.end - self.start
        # From the nearer end, so that both ends are met to the last digit.
        return jnp.where(
            done < left, self.start + done * distance, self.end - left * distance
        )

    def velocity(self, t: ArrayLike) -> PerJoint:
        """Joint speeds [rad/s] at the time `t` [s]."""
        return self.profile().velocity(t) * (self.end - self.start)

    def acceleration(self, t: ArrayLike) -> PerJoint:
        """Joint accelerations [rad/s^2] at the time `t` [s]."""
        return self.profile().acceleration(t) * (self.end - self.start)

    def jerk(self, t: ArrayLike) -> PerJoint:
        """Joint jerks [rad/s^3] at the time `t` [s], the later value at a jump."""
        return self.profile().jerk(t) * (self.end - self.start)


def check_limits(motion: eqx.Module) -> None:
    """Raise unless the three limits of `motion` are positive and finite."""
    for name in ("max_velocity", "max_acceleration", "max_jerk"):
        value = getattr(motion, name)
        check_values(
            f"`{name}` must be positive and finite",
            value,
            (value > 0) & jnp.isfinite(value),
        )
