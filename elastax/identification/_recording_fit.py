"""Motor torque of a recording: prediction, and a fit of friction and offset.

Everything is linear in the parameters but the steepness of the Coulomb friction, which
is taken from a grid by the error on the recording that is fitted, and by no other.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import lsq_linear

from ..drivetrain import TwoScaleFriction
from ..dynamics import ElasticRobot, MotorCommand
from ..inverse import FlexibleJointInverse
from ..signals import AbstractFilter, Reference
from ._recording import Recording, recorded_reference


# s of (2.3) at the output side [s/rad]. At the last the sign of the friction changes
# within 2e-4 rad/s; a steeper one is beyond the resolution of a recorded motion.
STEEPNESS_GRID = (200.0, 500.0, 1000.0, 2000.0, 5000.0, 10000.0)


Feedforward = Callable[[ElasticRobot, Reference], MotorCommand]


@dataclasses.dataclass(frozen=True)
class FrictionFit:
    """Friction and torque offset fitted to a recording, output side.

    Attributes:
        robot: the robot with this friction (and payload) in its drive trains.
        names: of the parameters, as in `values`.
        values: rows viscous [N m s/rad], coulomb [N m], offset [N m], shape (3, axes).
        deviations: standard deviations of the values, shape (3, axes), under the
            assumption that the residual is white noise, which it is not.
        inflation: factor per axis by which the deviations grow if the residual is
            autoregressive of the first order instead; still optimistic.
        steepness: s of (2.3), from the grid [s/rad], shape (axes,).
        payload_mass: fitted or held [kg].
        payload_deviation: of the fitted mass [kg], white noise; zero if held.
        recording: name of the recording that was fitted.
    """

    robot: ElasticRobot
    names: tuple[str, ...]
    values: np.ndarray
    deviations: np.ndarray
    inflation: np.ndarray
    steepness: np.ndarray
    payload_mass: float
    payload_deviation: float
    recording: str


def coefficient_of_determination(
    measured: Float[Array, " times *axes"],
    predicted: Float[Array, " times *axes"],
    remove_mean: bool = True,
) -> Float[Array, " *axes"]:
    r"""$R^2 = 1 - \sum (y - \hat y)^2 / \sum (y - \bar y)^2$.

    Args:
        measured: y; must not be constant.
        predicted: $\hat y$.
        remove_mean: whether each signal is taken minus its own mean, so that a
            constant error does not count.
    """
    error = measured - predicted
    if remove_mean:
        error = error - jnp.mean(error, axis=0)[None]
    spread = measured - jnp.mean(measured, axis=0)[None]
    return 1.0 - jnp.sum(error**2, axis=0) / jnp.sum(spread**2, axis=0)


def one_program(model: ElasticRobot, reference: Reference) -> MotorCommand:
    """`FlexibleJointInverse.feedforward`, compiled as a whole by a map over one motion.

    Faster than one operation after the other, but compiled anew by every call.
    """
    inverse = FlexibleJointInverse()
    times = reference.times
    commands = jax.lax.map(
        lambda derivatives: inverse.feedforward(model, Reference(times, derivatives)),
        reference.derivatives[None],
    )
    return jax.tree.map(lambda leaf: leaf[0], commands)


def predict_motion(
    robot: ElasticRobot,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    feedforward: Feedforward = one_program,
) -> MotorCommand:
    """Motor motion and torque of the robot along the recorded reference, output side.

    The flexible-joint inverse: it gives the exact torques along a given motion of the
    joints, and its torsion of the gears is the wind-up. ASIM would move the joints away
    from the recorded reference, and the rigid inverse knows no wind-up.

    Args:
        robot: with the friction to be used.
        recording: brings the reference.
        filter: for a recording without derivatives, see `recorded_reference`.
        feedforward: of the inverse; pass
            `equinox.filter_jit(FlexibleJointInverse().feedforward)` to compile once for
            several recordings.
    """
    return feedforward(robot, recorded_reference(robot, recording, filter=filter))


def predict_torque(
    robot: ElasticRobot,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    feedforward: Feedforward = one_program,
) -> Float[Array, "times axes"]:
    """Motor torque along the recorded reference.

    Args:
        robot, recording, filter, feedforward: as for `predict_motion`.

    Returns:
        On the motor side, in the maker's sign [N m].
    """
    command = predict_motion(robot, recording, filter=filter, feedforward=feedforward)
    return to_maker_torque(robot, command.tau_m)


def to_maker_torque(robot: ElasticRobot, torque):
    """Motor-side torque in the maker's sign of one on the output side [N m]."""
    return torque * (robot.axis_signs / robot.drives.ratio)[None]


def fit_friction(
    robot: ElasticRobot,
    recording: Recording,
    *,
    steepness: tuple[float, ...] = STEEPNESS_GRID,
    payload_deviation: float | None = None,
    filter: AbstractFilter | None = None,
    feedforward: Feedforward = one_program,
) -> FrictionFit:
    r"""Fit friction (2.3) and a constant torque to the motor torques of a recording.

    $\tau = \tau_{model} + \tau_v v + \tau_h \tanh(s v/2) + \tau_0$ per axis, by least
    squares with $\tau_v, \tau_h \ge 0$; v is the motor's speed along the reference. All
    else of the model is held. The friction replaces that of the motors; the offset
    stands for what the model leaves out.

    Args:
        robot: the model; its links are taken as rigid.
        recording: fitted.
        steepness: candidates of s [s/rad]; the best on this recording is taken, axis
            by axis.
        payload_deviation: standard deviation of the payload mass [kg]; the mass is
            fitted with it as prior about the robot's own (inertia in proportion, centre
            of mass held). `None` holds the payload: gravity of axis 2, counterbalance
            and payload can hardly be told apart on one motion.
        filter, feedforward: as for `predict_motion`.

    Raises:
        ValueError: an axis that moves in one direction only, or no payload to fit.

    References:
        [Reiner2010] (2.3).
    """

    def predict(model):
        return predict_motion(model, recording, filter=filter, feedforward=feedforward)

    bare = without_friction(robot)
    command = predict(bare)
    fit = fit_along(robot, recording, command, steepness)
    if payload_deviation is None:
        return fit
    mass = fit.payload_mass
    if not mass > 0:
        raise ValueError(
            f"`{robot.name}` must carry a payload for its mass to be fitted: attach "
            "one with `with_payload`"
        )
    if not payload_deviation > 0:
        raise ValueError(
            f"`payload_deviation` must be positive [kg], but is {payload_deviation}"
        )
    doubled = predict(_scaled_payload(bare, 2.0))
    factor, deviation = _payload_factor(
        np.asarray(command.thetad),
        _target(robot, recording, command),
        np.asarray(doubled.tau_m - command.tau_m),
        fit.steepness,
        payload_deviation / mass,
    )
    loaded = _scaled_payload(robot, factor)
    command = predict(without_friction(loaded))
    fit = fit_along(loaded, recording, command, (fit.steepness,))
    return dataclasses.replace(fit, payload_deviation=mass * deviation)


def without_friction(robot: ElasticRobot) -> ElasticRobot:
    """The robot with neither friction nor offset at its motors."""
    return _with_friction(robot, np.zeros((3, robot.axes)), np.ones(robot.axes))


def fit_along(
    robot: ElasticRobot,
    recording: Recording,
    command: MotorCommand,
    steepness: tuple[float | np.ndarray, ...],
) -> FrictionFit:
    """The fit, given the motion and torque of the robot without friction.

    Candidates of the steepness are numbers or hold one value per axis.
    """
    speed = np.asarray(command.thetad)
    _check_reversal(speed, recording.name)
    target = _target(robot, recording, command)
    candidates = np.stack([np.broadcast_to(s, robot.axes) for s in steepness])
    fits = [
        min(
            (_fit_axis(speed[:, k], target[:, k], s) for s in candidates[:, k]),
            key=lambda fit: fit[1],
        )
        for k in range(robot.axes)
    ]
    values = np.stack([fit[0] for fit in fits], axis=1)
    chosen = np.array([fit[2] for fit in fits])
    statistics = [
        _deviations(speed[:, k], target[:, k], values[:, k], chosen[k])
        for k in range(robot.axes)
    ]
    return FrictionFit(
        robot=_with_friction(robot, values, chosen),
        names=("viscous", "coulomb", "offset"),
        values=values,
        deviations=np.stack([one[0] for one in statistics], axis=1),
        inflation=np.array([one[1] for one in statistics]),
        steepness=chosen,
        payload_mass=float(np.sum(robot.payload.mass)),
        payload_deviation=0.0,
        recording=recording.name,
    )


def _target(robot, recording, command) -> np.ndarray:
    """Measured motor torque on the output side, less that of the model [N m]."""
    sides = np.asarray(robot.drives.ratio * robot.axis_signs)
    return np.asarray(recording.motor_torque) * sides - np.asarray(command.tau_m)


def _check_reversal(speed: np.ndarray, name: str) -> None:
    for axis, v in enumerate(speed.T):
        peak = np.max(np.abs(v))
        if min(np.max(v), -np.min(v)) < 0.02 * peak or peak == 0:
            raise ValueError(
                f"axis {axis} (counted from 0) of {name} must move in both directions, "
                "or Coulomb friction and offset cannot be told apart: fit on another "
                "recording"
            )


def _regressors(speed: np.ndarray, steepness: float) -> np.ndarray:
    law = np.tanh(0.5 * steepness * speed)
    return np.stack([speed, law, np.ones_like(speed)], axis=1)


def _fit_axis(speed, target, steepness):
    """Values, sum of squares and steepness of one axis."""
    columns = _regressors(speed, steepness)
    scale = np.max(np.abs(columns), axis=0)
    bounds = ([0.0, 0.0, -np.inf], np.inf)
    solution = lsq_linear(columns / scale, target, bounds)
    return solution.x / scale, 2.0 * solution.cost, steepness


def _deviations(speed, target, values, steepness):
    """Standard deviations under white noise, and their growth under AR(1) noise."""
    columns = _regressors(speed, steepness)
    residual = target - columns @ values
    variance = residual @ residual / (len(residual) - len(values))
    covariance = variance * np.linalg.inv(columns.T @ columns)
    centred = residual - residual.mean()
    correlation = (centred[1:] @ centred[:-1]) / (centred @ centred)
    correlation = min(max(correlation, 0.0), 1.0 - 1e-6)
    growth = np.sqrt((1.0 + correlation) / (1.0 - correlation))
    return np.sqrt(np.diag(covariance)), growth


def _payload_factor(speed, target, slope, steepness, deviation) -> tuple[float, float]:
    """Factor of the payload mass with a normal prior about one, and its deviation."""
    numerator, information = 0.0, 1.0 / deviation**2
    for k, s in enumerate(steepness):
        # the friction of the axis is projected out; errors weigh by their own variance
        basis, _ = np.linalg.qr(_regressors(speed[:, k], s))
        x = slope[:, k] - basis @ (basis.T @ slope[:, k])
        y = target[:, k] - basis @ (basis.T @ target[:, k])
        weight = (len(y) - 4) / (y @ y)
        numerator += weight * (x @ y)
        information += weight * (x @ x)
    return 1.0 + numerator / information, information**-0.5


def _scaled_payload(robot: ElasticRobot, factor: float) -> ElasticRobot:
    return eqx.tree_at(
        lambda r: (r.payload.mass, r.payload.inertia),
        robot,
        (factor * robot.payload.mass, factor * robot.payload.inertia),
    )


def _with_friction(robot, values, steepness) -> ElasticRobot:
    """The robot with (2.3) and an offset at its motors.

    `TwoScaleFriction` writes the law with the argument of tanh, half the steepness.
    """
    viscous, coulomb, offset = values
    unused, one = np.zeros(robot.axes), np.ones(robot.axes)
    friction = TwoScaleFriction(viscous, coulomb, 0.5 * steepness, unused, one, offset)
    return dataclasses.replace(
        robot, drives=dataclasses.replace(robot.drives, motor_friction=friction)
    )
