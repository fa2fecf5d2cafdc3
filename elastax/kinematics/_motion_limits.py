"""Technical limits of joints, checked against a motion."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, Scalar, as_optional_real, as_real
from ._arm import Arm


_NAMES = ("position", "velocity", "acceleration", "jerk")


class MotionLimits(eqx.Module):
    r"""Limits of the joints: $|\dot x| \le v_{max}$, $|\ddot x| \le a_{max}$, ...

    An infinite limit, or `None`, does not count.

    Attributes:
        lower, upper: positions, shape (joints,) [rad] or [m].
        velocity, acceleration, jerk: magnitudes, shape (joints,) [rad/s^k] or [m/s^k].

    References:
        [KinModell] (3-134), which has velocity and acceleration only.
    """

    lower: PerJoint = eqx.field(converter=as_real)
    upper: PerJoint = eqx.field(converter=as_real)
    velocity: PerJoint | None = eqx.field(converter=as_optional_real, default=None)
    acceleration: PerJoint | None = eqx.field(converter=as_optional_real, default=None)
    jerk: PerJoint | None = eqx.field(converter=as_optional_real, default=None)

    def __check_init__(self):
        check_fields(self)
        for name in _NAMES[1:]:
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != self.lower.shape:
                raise ValueError(
                    f"`{name}` must hold one limit per joint of {self.lower.shape[0]}, "
                    f"but has the shape {value.shape}"
                )
            check_values(f"`{name}` must be positive", value, value > 0)
        check_values(
            "`upper` limits must lie above `lower`", self.upper, self.upper > self.lower
        )

    @staticmethod
    def of_arm(arm: Arm, *, acceleration=None, jerk=None) -> "MotionLimits":
        """Limits of an arm, which knows those of position and velocity.

        Args:
            arm: the arm; limits of the chain's own coordinates.
            acceleration: limits, shape (joints,) [rad/s^2] or [m/s^2].
            jerk: limits, shape (joints,) [rad/s^3] or [m/s^3].
        """
        return MotionLimits(arm.lower, arm.upper, arm.velocity, acceleration, jerk)

    def bounds(self, order: int) -> tuple[PerJoint, PerJoint]:
        """Lower and upper bound of a derivative; infinite where there is none."""
        if order == 0:
            return self.lower, self.upper
        limit = getattr(self, _NAMES[order]) if order < len(_NAMES) else None
        limit = jnp.full_like(self.lower, jnp.inf) if limit is None else limit
        return -limit, limit


class MotionCheck(eqx.Module):
    """How a motion keeps the limits of the joints.

    Attributes:
        ratios: largest use of each limit, shape (orders, joints): 0 in the middle
            between the limits, 1 at them, 0 where there is no limit.
        samples: index of the sample at which that is so, shape (orders, joints).
        holds: whether all ratios are at most one.
        slowdown: factor by which all times have to grow so that velocity, acceleration
            and jerk hold; less than one if the motion may be faster. A slower motion
            changes no position.
    """

    ratios: Float[Array, "orders joints"]
    samples: Int[Array, "orders joints"]
    holds: Bool[Array, ""]
    slowdown: Scalar

    def __str__(self) -> str:
        one = is_concrete(self.ratios) and self.ratios.ndim == 2
        return self.table() if one else repr(self)

    def table(self, times=None) -> str:
        """Worst use of every limit in percent, and when it occurs.

        Args:
            times: of the samples, shape (times,) [s]; their numbers are shown unless
                given.
        """
        when = np.asarray(self.samples)
        shown = when if times is None else np.asarray(times)[when]
        text = "{:.4g} s".format if times is not None else "sample {}".format
        count = self.ratios.shape[1]
        lines = [["", *(f"joint {k + 1}" for k in range(count))]]
        for order, row in enumerate(np.asarray(self.ratios)):
            cells = [
                f"{100 * ratio:.1f} % at {text(at)}" + (" !" if ratio > 1 else "")
                for ratio, at in zip(row, shown[order], strict=True)
            ]
            lines.append([_NAMES[order], *cells])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        rows = [
            "  ".join(x.ljust(w) for x, w in zip(r, widths)).rstrip() for r in lines
        ]
        verdict = "all limits hold" if self.holds else "limits are exceeded (!)"
        return "\n".join([*rows, f"{verdict}; slowdown {float(self.slowdown):.4g}"])


def motion_margins(
    limits: MotionLimits, derivatives: Float[Array, "terms times joints"]
) -> Float[Array, "2 orders times joints"]:
    """Distances from the limits, as shares of half their range: at least zero.

    They are linear in the motion and so fit as constraints of an optimisation. The
    margin of a limit that does not exist is one; that of a joint with one position
    limit is in rad or m.

    Args:
        limits: of the joints.
        derivatives: joint coordinates and their derivatives along a motion, shape
            (order + 1, times, joints), as `Reference.derivatives`. Orders above the
            jerk are left out.

    Returns:
        Shape (2, orders, times, joints): from the lower and from the upper limit.

    Raises:
        ValueError: the motion has another number of joints, or no samples.

    References:
        [KinModell] (3-134).
    """
    joints = limits.lower.shape[0]
    if derivatives.ndim != 3 or derivatives.shape[2] != joints:
        raise ValueError(
            f"`derivatives` must have the shape (order + 1, times, {joints}), but has "
            f"{derivatives.shape}"
        )
    if derivatives.shape[1] == 0:
        raise ValueError("`derivatives` must hold at least one sample, but has none")
    orders = min(derivatives.shape[0], len(_NAMES))
    below, above = [], []
    for order in range(orders):
        lower, upper = limits.bounds(order)
        both = jnp.isfinite(lower) & jnp.isfinite(upper)
        # one limit alone leaves no range: the unit is then a radian or a metre
        half = jnp.where(both, (upper - lower) / 2, 1.0)
        below.append(_margin(derivatives[order], lower, half, 1.0))
        above.append(_margin(derivatives[order], upper, half, -1.0))
    return jnp.stack([jnp.stack(below), jnp.stack(above)])


def _margin(value, limit, half, sign):
    exists = jnp.isfinite(limit)
    bound = jnp.where(exists, limit, 0.0)
    distance = sign * (value - bound[None]) / half[None]
    return jnp.where(exists[None], distance, 1.0)


def check_motion(
    limits: MotionLimits, derivatives: Float[Array, "terms times joints"]
) -> MotionCheck:
    """Worst use of every limit along a motion.

    Args:
        limits: of the joints, or `MotionLimits.of_arm`.
        derivatives: joint coordinates and their derivatives along a motion, shape
            (order + 1, times, joints), as `Reference.derivatives`.

    Raises:
        ValueError: the motion has another number of joints, or no samples.

    References:
        [KinModell] (3-134).
    """
    margins = motion_margins(limits, derivatives)
    use = 1.0 - jnp.min(margins, axis=0)
    ratios, samples = jnp.max(use, axis=1), jnp.argmax(use, axis=1)
    rates = [_root(jnp.max(ratios[k]), k) for k in range(1, len(ratios))]
    slowdown = jnp.max(jnp.stack([jnp.zeros_like(ratios[0, 0]), *rates]))
    return MotionCheck(ratios, samples, jnp.all(ratios <= 1.0), slowdown)


def _root(ratio, order: int):
    """Root of a ratio whose gradient is finite at zero."""
    positive = ratio > 0
    return jnp.where(positive, jnp.where(positive, ratio, 1.0) ** (1 / order), 0.0)
