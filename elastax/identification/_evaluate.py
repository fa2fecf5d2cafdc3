"""Figures of merit of a robot model against a recording."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from ..drivetrain import AbstractSwitchingFriction
from ..dynamics import ElasticRobot
from ..signals import AbstractFilter
from ._recording import Recording
from ._recording_fit import (
    STEEPNESS_GRID,
    Feedforward,
    FrictionFit,
    coefficient_of_determination,
    fit_along,
    one_program,
    predict_motion,
    to_maker_torque,
    without_friction,
)
from ._skew import estimate_skew


@dataclasses.dataclass(frozen=True)
class RecordingReport:
    """How a model meets a recording.

    Attributes:
        robot: the model, with fitted friction if there is any.
        fit: the friction fit that was made or held, or `None`.
        summary: the figures, ready for JSON: `axes` (counted from 1), `skew_s`,
            `torque` with `r2`, `rms`, `r2_raw`, `stored_r2`, `stored_rms` (motor side
            [N m]; means removed except in `r2_raw`), `windup` with `r2`, `rms` [rad]
            and `r2_motor_torque`, `friction` and `notes`. Without a link-side encoder
            `skew_s` and `windup` hold `None`.
        arrays: time series of these axes, shape (times, axes): `recording_time`,
            `recording_torque_measured`, `_predicted`, `_stored` [N m, motor side],
            `recording_windup_measured`, `_predicted` [rad].
        notes: how the figures are to be read.
    """

    robot: ElasticRobot
    fit: FrictionFit | None
    summary: dict
    arrays: dict[str, np.ndarray]
    notes: tuple[str, ...]

    @property
    def plot(self) -> dict:
        """Arguments of `plotting.plot_recording`."""
        series, windup = self.arrays, self.summary["windup"]
        return {
            "times": series["recording_time"],
            "measured_torque": series["recording_torque_measured"],
            "predicted_torque": series["recording_torque_predicted"],
            "stored_torque": series.get("recording_torque_stored"),
            "measured_windup": series.get("recording_windup_measured"),
            "predicted_windup": series.get("recording_windup_predicted"),
            "torque_r2": self.summary["torque"]["r2"],
            "windup_r2": windup["r2"],
            "axis_names": tuple(
                self.robot.axis_names[axis - 1] for axis in self.summary["axes"]
            ),
        }


def evaluate_recording(
    robot: ElasticRobot,
    recording: Recording,
    fit: bool | FrictionFit = True,
    *,
    filter: AbstractFilter | None = None,
    feedforward: Feedforward = one_program,
) -> RecordingReport:
    r"""Measured against predicted motor torque and wind-up, and the encoders' skew.

    The axes are those with a link-side encoder, or all if there is none. Torques follow
    from the flexible-joint inverse along the recorded reference. Wind-up is the
    output-side angle minus the motor angle: measured, with skew and constant taken
    out; predicted, the torsion of the gear under the torque of the links. Friction lies
    on the motor's side of the spring. `r2_motor_torque` of the wind-up tells what comes
    out if the measured motor torque, friction included, is taken for the gear's.

    Args:
        robot: the model.
        recording: brings reference, motor torques and angles.
        fit: `True` fits friction and offset on this recording, a `FrictionFit` made on
            another one is held, `False` takes the robot's own friction.
        filter: for a recording without derivatives, see `recorded_reference`.
        feedforward: of the flexible-joint inverse, see `predict_motion`.

    Raises:
        ValueError: as `recorded_reference` and `fit_friction`.
    """
    held = fit if isinstance(fit, FrictionFit) else None
    model = robot if held is None else held.robot
    # friction at the motors acts on the torque alone, so one run serves all
    command = predict_motion(
        without_friction(model), recording, filter=filter, feedforward=feedforward
    )
    if held is None and fit:
        held = fit_along(robot, recording, command, STEEPNESS_GRID)
        model = held.robot
    law = model.drives.motor_friction
    if isinstance(law, AbstractSwitchingFriction):
        raise ValueError("recordings are evaluated with smooth friction")
    friction = jax.vmap(law.torque)(command.thetad)
    encoders = recording.encoders
    chosen = np.array(encoders or range(recording.axes))

    measured = np.asarray(recording.motor_torque)[:, chosen]
    torque_of_motors = to_maker_torque(model, command.tau_m + friction)
    predicted = np.asarray(torque_of_motors)[:, chosen]
    torque = {
        "r2": _r2(measured, predicted),
        "rms": _rms(measured - predicted),
        "r2_raw": _r2(measured, predicted, False),
        "stored_r2": None,
        "stored_rms": None,
    }
    arrays = {
        "recording_time": np.asarray(recording.times),
        "recording_torque_measured": measured,
        "recording_torque_predicted": predicted,
    }
    if recording.stored_torque is not None:
        stored = np.asarray(recording.stored_torque)[:, chosen]
        torque["stored_r2"] = _r2(measured, stored)
        torque["stored_rms"] = _rms(measured - stored)
        arrays["recording_torque_stored"] = stored

    skew_s, windup = None, {"r2": None, "rms": None, "r2_motor_torque": None}
    if encoders:
        skew = estimate_skew(
            recording.motor_angle[:, chosen],
            recording.link_angle,
            recording.motor_speed[:, chosen],
        )
        skew_s = np.asarray(skew.delay).tolist()
        seen = -np.asarray(skew.residual)
        signs = np.asarray(model.axis_signs)[chosen]
        torsion = signs * np.asarray(command.q - command.theta)[:, chosen]
        torsion = torsion - np.mean(torsion, axis=0)
        by_motor = signs * _torsion_by_motor(model, recording, command)[:, chosen]
        windup = {
            "r2": _r2(seen, torsion),
            "rms": _rms(seen - torsion),
            "r2_motor_torque": _r2(seen, by_motor),
        }
        arrays["recording_windup_measured"] = seen
        arrays["recording_windup_predicted"] = torsion
    notes = _notes(recording, held, encoders)
    summary = {
        "axes": (chosen + 1).tolist(),
        "skew_s": skew_s,
        "torque": torque,
        "windup": windup,
        "friction": None if held is None else _friction_figures(held, chosen),
        "notes": list(notes),
    }
    return RecordingReport(model, held, summary, arrays, notes)


def _r2(measured, predicted, remove_mean: bool = True) -> list[float]:
    pair = jnp.asarray(measured), jnp.asarray(predicted)
    r2 = coefficient_of_determination(*pair, remove_mean)
    return np.asarray(r2).tolist()


def _rms(error: np.ndarray) -> list[float]:
    """Root mean square of the error minus its mean."""
    return np.std(error, axis=0).tolist()


def _torsion_by_motor(robot, recording, command) -> np.ndarray:
    """Torsion [rad] if the motor's torque less its inertia's loaded the gear."""
    drives = robot.drives
    if drives.stiffness is None:
        raise ValueError("wind-up needs a model with elastic gears")
    sides = np.asarray(drives.ratio * robot.axis_signs)
    inertia = np.asarray(drives.reflected_inertia()) * np.asarray(command.thetadd)
    load = np.asarray(recording.motor_torque) * sides - inertia
    return np.asarray(jax.vmap(drives.stiffness.torsion)(jnp.asarray(-load)))


def _friction_figures(fit: FrictionFit, chosen: np.ndarray) -> dict:
    figures = {
        name: {
            "value": fit.values[row, chosen].tolist(),
            "deviation": fit.deviations[row, chosen].tolist(),
        }
        for row, name in enumerate(fit.names)
    }
    return figures | {
        "steepness": fit.steepness[chosen].tolist(),
        "deviation_inflation": fit.inflation[chosen].tolist(),
        "payload_mass": fit.payload_mass,
        "payload_deviation": fit.payload_deviation,
        "fitted_on": fit.recording,
    }


def _notes(recording: Recording, fit: FrictionFit | None, encoders) -> tuple[str, ...]:
    notes = []
    if fit is not None:
        place = "this recording" if fit.recording == recording.name else fit.recording
        notes.append(
            f"friction and offset fitted on {place}; standard deviations take the "
            "residual for white noise: multiply by `deviation_inflation` for "
            "first-order correlation, and expect more"
        )
    if recording.stored_torque is None:
        notes.append("the recording holds no feed-forward torque of its own")
    if encoders:
        notes.append(
            "wind-up from the links' torque over the gear's stiffness; taking the "
            "motor torque, friction included, for the gear's gives `r2_motor_torque`, "
            "negative where friction is a large part"
        )
    else:
        notes.append("no link-side encoder: neither skew nor wind-up")
    return tuple(notes)
