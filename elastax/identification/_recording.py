"""A recorded motion of a robot, and the reference that it followed."""

import warnings

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import PerJoint, Times, as_optional_real, as_real
from ..dynamics import ElasticRobot
from ..signals import AbstractFilter, Reference, check_recording_signal


TimesByAxes = Float[Array, "times axes"]

SHORTEST = 50  # samples
# Share of its peak by which a speed may change in one sample; the recordings of the
# KR300 reach 0.05.
_SPEED_STEP = 0.1
_RESOLUTION = np.deg2rad(0.01)  # of an encoder, generous


class Recording(eqx.Module):
    """Sampled motion of a robot under control, in SI units and the maker's angles.

    Attributes:
        times: uniform [s], shape (times,).
        reference: reference angles and the derivatives that were recorded with them,
            shape (derivatives, times, axes) [rad/s^k]; row 0 alone if there are none.
        motor_angle: motor angles over the gear ratio [rad], (times, axes).
        motor_speed: their speed [rad/s], (times, axes).
        motor_torque: on the motor side [N m], (times, axes).
        link_angle: of the link-side encoders [rad], (times, encoders).
        stored_torque: feed-forward torque that was computed for the motion, on the
            motor side [N m], (times, axes), or `None`.
        encoders: axes that have a link-side encoder, counted from 0.
        name: for messages and reports.

    Raises:
        ValueError: wrong shapes, values that are not finite, times that are not
            uniform, too few samples, jumps, motors that do not follow the reference.
    """

    times: Times = eqx.field(converter=as_real)
    reference: Float[Array, "derivatives times axes"] = eqx.field(converter=as_real)
    motor_angle: TimesByAxes = eqx.field(converter=as_real)
    motor_speed: TimesByAxes = eqx.field(converter=as_real)
    motor_torque: TimesByAxes = eqx.field(converter=as_real)
    link_angle: Float[Array, "times encoders"] = eqx.field(converter=as_real)
    stored_torque: TimesByAxes | None = eqx.field(converter=as_optional_real)
    encoders: tuple[int, ...] = eqx.field(static=True)
    name: str = eqx.field(static=True, default="recording")

    def __check_init__(self):
        check_fields(self)
        shape = self.motor_angle.shape
        if self.stored_torque is not None and self.stored_torque.shape != shape:
            raise ValueError(
                f"`stored_torque` of {self.name} must have the shape {shape}, but has "
                f"{self.stored_torque.shape}"
            )
        if len(self.encoders) != self.link_angle.shape[1]:
            raise ValueError(
                f"`encoders` of {self.name} must name the axis of each of the "
                f"{self.link_angle.shape[1]} link-side encoders, but is {self.encoders}"
            )
        if any(not 0 <= axis < shape[1] for axis in self.encoders):
            raise ValueError(
                f"`encoders` of {self.name} must lie between 0 and {shape[1] - 1}, but "
                f"is {self.encoders}"
            )
        if shape[0] < SHORTEST:
            raise ValueError(
                f"{self.name} must hold at least {SHORTEST} samples, but has "
                f"{shape[0]}: record a longer motion"
            )
        _check_signals(self)

    @property
    def axes(self) -> int:
        """Number of axes."""
        return self.motor_angle.shape[1]

    @property
    def dt(self) -> float:
        """Sampling time [s]."""
        times = np.asarray(self.times)
        return float(times[-1] - times[0]) / (len(times) - 1)

    @property
    def start_pose(self) -> PerJoint:
        """Reference angles of the first sample [rad], shape (axes,)."""
        return self.reference[0, 0]


def recorded_reference(
    robot: ElasticRobot, recording: Recording, *, filter: AbstractFilter | None = None
) -> Reference:
    """Reference motion of a recording, as chain angles of the robot.

    Derivatives that the recording brings along are checked and taken as they are.
    Otherwise the recorded angles are filtered and the result is shifted back by the
    filter's delay, to the nearest sample.

    Args:
        robot: its signs and zeros convert the maker's angles.
        recording: of a robot with as many axes.
        filter: of an order of 4 or more; only used without recorded derivatives.

    Raises:
        ValueError: another number of axes, derivatives that contradict each other, or
            neither derivatives up to order three nor a filter.
    """
    if recording.axes != robot.axes:
        raise ValueError(
            f"{recording.name} must have the {robot.axes} axes of `{robot.name}`, but "
            f"has {recording.axes}"
        )
    derivatives = recording.reference * robot.axis_signs[None, None]
    derivatives = derivatives.at[0].add(robot.axis_zeros[None])
    times = recording.times
    if derivatives.shape[0] > 3:
        return Reference.from_derivatives(times, derivatives)
    if filter is None:
        raise ValueError(
            f"{recording.name} brings no derivatives of its reference up to the third: "
            "give a `filter`, such as `BesselFilter(6, 10.0)`"
        )
    delay = round(float(filter.delay()) / recording.dt)
    filtered = Reference.from_samples(
        times, derivatives[0], filter=filter, order=4, settle=delay * recording.dt
    )
    late = filtered.derivatives[:, delay : delay + times.shape[0]]
    return Reference(times, late)


def _check_signals(recording: Recording) -> None:
    signals = {
        "motor_angle": recording.motor_angle,
        "motor_speed": recording.motor_speed,
        "motor_torque": recording.motor_torque,
        "link_angle": recording.link_angle,
        "stored_torque": recording.stored_torque,
    }
    for k, derivative in enumerate(recording.reference):
        signals[f"reference[{k}]"] = derivative
    for field, values in signals.items():
        _check_signal(recording, field, values)
    # no angle may move faster than thrice the largest speed of its motor
    speed = np.abs(np.asarray(recording.motor_speed))
    limit = 3.0 * np.max(speed, axis=0) * recording.dt + _RESOLUTION
    _check_signal(recording, "motor_angle", recording.motor_angle, limit)
    _check_signal(recording, "motor_speed", recording.motor_speed, _speed_limit(speed))
    _check_signal(recording, "reference[0]", recording.reference[0], limit)
    link_limit = limit[np.array(recording.encoders, int)]
    _check_signal(recording, "link_angle", recording.link_angle, link_limit)
    _warn_of_torque_steps(recording)
    _check_following(recording)


def _check_signal(recording: Recording, field: str, values, max_step=None) -> None:
    if values is None or values.shape[1] == 0:
        return
    try:
        check_recording_signal(recording.times, values, max_step)
    except ValueError as error:
        raise ValueError(f"`{field}` of {recording.name}: {error}") from None


def _speed_limit(speed: np.ndarray) -> np.ndarray:
    """Largest change of the speed between two samples; slow axes may be noisy."""
    ranges = np.max(speed, axis=0)
    return _SPEED_STEP * np.maximum(ranges, 0.1 * np.max(ranges)) + 1e-12


def _warn_of_torque_steps(recording: Recording) -> None:
    torque = np.asarray(recording.motor_torque)
    steps = np.max(np.abs(np.diff(torque, axis=0)), axis=0)
    for axis in np.flatnonzero(steps > 0.9 * np.ptp(torque, axis=0)):
        if steps[axis] > 0:
            warnings.warn(
                f"the torque of axis {axis} (counted from 0) of {recording.name} runs "
                "through its whole range in one sample",
                stacklevel=2,
            )


def _check_following(recording: Recording) -> None:
    """Angles of another unit, sign or axis do not follow the reference."""
    reference, angle = np.asarray(recording.reference[0]), recording.motor_angle
    miss = np.std(np.asarray(angle) - reference, axis=0)
    travel = np.std(reference, axis=0)
    allowed = 0.5 * np.maximum(travel, 0.1 * np.max(travel)) + _RESOLUTION
    if np.any(miss > allowed):
        axis = int(np.argmax(miss > allowed))
        raise ValueError(
            f"the motor of axis {axis} (counted from 0) of {recording.name} must "
            f"follow the reference, but is off by {miss[axis]:.3g} rad rms: check the "
            "units, signs and order of the columns"
        )
