"""Springs that slip, fitted to a measured loop of torsion and torque.

For given thresholds everything is linear: the torque is a sum of the torsion, its cube,
an offset and the strains of the slipping springs, whose stiffnesses must not be
negative.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import lsq_linear

from ..drivetrain import CubicStiffness, play


Samples = Float[Array, " times"] | Float[np.ndarray, " times"]
Thresholds = Float[Array, " plays"] | Float[np.ndarray, " plays"]


@dataclasses.dataclass(frozen=True)
class HysteresisFit:
    """Spring and slipping springs of one gear.

    Attributes:
        spring: what is left of the torque when all others slip.
        stiffness: $c_i \\ge 0$ of the slipping springs [N m/rad], shape (plays,); with
            `[:, None]` that of a `StopBranch` or an `ExactStopBranch`.
        thresholds: torsions at which they slip [rad], shape (plays,).
        offset: of the torque [N m].
        first: index of the first sample that is used.
        residual: measured minus fitted torque from there on [N m].
    """

    spring: CubicStiffness
    stiffness: np.ndarray
    thresholds: np.ndarray
    offset: float
    first: int
    residual: np.ndarray

    @property
    def deviation(self) -> float:
        """Root mean square of the residual [N m]."""
        return float(np.sqrt(np.mean(self.residual**2)))


def suggest_thresholds(torsion: Samples, number: int) -> np.ndarray:
    """Equal steps through half of the stroke.

    After a turn a spring slips when the torsion has moved by twice its threshold, so
    that these thresholds divide the branches of the largest loop evenly. The last one
    lies below half of the stroke: what never slips is the spring's.

    Args:
        torsion: measured, one axis [rad].
        number: of thresholds.

    Raises:
        ValueError: the torsion does not move, or the number is not positive.
    """
    if number < 1:
        raise ValueError(f"`number` must be at least 1, but is {number}")
    stroke = float(np.max(torsion) - np.min(torsion))
    if not stroke > 0:
        raise ValueError(f"`torsion` must move, but its stroke is {stroke} rad")
    return 0.5 * stroke * np.arange(1, number + 1) / (number + 1)


def fit_hysteresis(
    torsion: Samples, torque: Samples, thresholds: Thresholds
) -> HysteresisFit:
    r"""Non-negative least squares for the slipping springs of a gear.

    $$\tau = c_0\,(1 + \gamma x^2)\,x + \sum_i c_i\,(x - P_i[x]) + \tau_0,\qquad
      c_0 > 0,\ \gamma \ge 0,\ c_i \ge 0$$

    Nothing is assumed about where the plays stand at the first sample: samples are used
    from where on every play has met one of its limits and forgotten its start. Torque
    of damping and of inertia must be taken out before, or the motion be slow.

    Args:
        torsion: output minus motor, one axis, in the order of time [rad].
        torque: that the gear transmits [N m].
        thresholds: $0 < r_1 < r_2 < \dots$ [rad], below half of the stroke;
            `suggest_thresholds` gives some.

    Raises:
        ValueError: lengths differ, values are not finite, thresholds are out of order
            or wider than the motion, the samples cannot tell the springs apart, or no
            spring is left when all others slip.

    References:
        [Reiner2010] (2.13), (2.14), where the weights are left to an optimisation.
    """
    x, measured = np.asarray(torsion), np.asarray(torque)
    thresholds = np.asarray(thresholds)
    _check_data(x, measured, thresholds)
    outputs, first = _settled_plays(x, thresholds)
    x, measured, outputs = x[first:], measured[first:], outputs[first:]

    # in the unit of the largest torsion every column is of order one
    unit = np.max(np.abs(x))
    strains = (x[:, None] - outputs) / unit
    scaled = x[:, None] / unit
    columns = np.concatenate([scaled, scaled**3, strains, np.ones_like(scaled)], axis=1)
    sizes = np.linalg.norm(columns, axis=0)
    rank = np.linalg.matrix_rank(columns / sizes)
    if rank < columns.shape[1]:
        raise ValueError(
            "`torsion` must tell the springs apart: its samples after the first "
            f"{first} determine {rank} of {columns.shape[1]} parameters"
        )
    lower = np.append(np.zeros(columns.shape[1] - 1), -np.inf)
    solution = lsq_linear(
        columns / sizes, measured, bounds=(lower, np.inf), method="bvls", tol=1e-15
    ).x
    values = solution / sizes
    linear, cubic = values[0] / unit, values[1] / unit**3
    if not linear > 0:
        raise ValueError(
            "`torque` must rise with the torsion when all springs slip, but its linear "
            f"part is {linear} N m/rad"
        )
    return HysteresisFit(
        spring=CubicStiffness(linear, cubic / linear),
        stiffness=values[2:-1] / unit,
        thresholds=thresholds,
        offset=float(values[-1]),
        first=first,
        residual=measured - columns @ values,
    )


def _check_data(torsion, torque, thresholds) -> None:
    if torsion.shape != torque.shape or torsion.ndim != 1:
        raise ValueError(
            "`torsion` and `torque` must have one value per sample, but have the "
            f"shapes {torsion.shape} and {torque.shape}"
        )
    if not (np.all(np.isfinite(torsion)) and np.all(np.isfinite(torque))):
        raise ValueError("`torsion` and `torque` must be finite, but are not")
    if thresholds.ndim != 1 or not np.all(np.diff(thresholds, prepend=0.0) > 0):
        raise ValueError(
            f"`thresholds` must be positive and increase, but are {thresholds}"
        )


def _settled_plays(torsion, thresholds):
    """Outputs of the plays, and the sample from which their start does not matter."""
    outermost = np.stack([torsion[0] - thresholds, torsion[0] + thresholds])

    def step(states, x):
        states = play(x, states, jnp.asarray(thresholds)[None])
        return states, states

    _, both = jax.lax.scan(step, jnp.asarray(outermost), jnp.asarray(torsion))
    lower, upper = np.swapaxes(np.asarray(both), 0, 1)
    # once both have met the same limit they are equal, to the bit
    settled = np.all(lower == upper, axis=1)
    if not np.any(settled):
        half = 0.5 * (np.max(torsion) - np.min(torsion))
        raise ValueError(
            f"`thresholds` must be below half of the stroke, {half} rad, or they are "
            f"never met, but are {thresholds}"
        )
    return lower, int(np.argmax(settled))
