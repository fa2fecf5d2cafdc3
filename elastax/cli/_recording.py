"""Following a recorded motion: fit, prediction, and the reference of the plant."""

import pathlib

import jax.numpy as jnp
import numpy as np

from ..dynamics import ElasticRobot
from ..identification import (
    RecordingReport,
    evaluate_recording,
    fit_friction,
    recorded_reference,
)
from ..io import load_recording
from ..signals import Reference
from ._arguments import FeedforwardConfig
from ._motion import HOLD, Motion, reference_filter, reference_order
from ._progress import Progress


def run_recording(
    robot: ElasticRobot, config: FeedforwardConfig, progress: Progress
) -> tuple[RecordingReport, Motion]:
    """Evaluate a recording and make its reference the motion of the run.

    Friction and torque offset are fitted on `identify_on`, or on the recording itself.

    Raises:
        ValueError: unreadable or implausible recording, another number of axes.
    """
    assert config.recording is not None
    recording = load_recording(config.recording)
    filter = reference_filter(config, reference_order(robot))
    fit = True
    if config.identify_on is not None:
        progress.say(f"fitting friction on {pathlib.Path(config.identify_on).name} ...")
        fit = fit_friction(robot, load_recording(config.identify_on), filter=filter)
    progress.say("fitting and predicting the recorded torques ...")
    report = evaluate_recording(robot, recording, fit, filter=filter)
    reference = recorded_reference(robot, recording, filter=filter)
    start = np.rad2deg(np.asarray(robot.to_maker(reference.positions[0])))
    motion = Motion(_held(reference), start, None, None, report.notes)
    return report, motion


def _held(reference: Reference) -> Reference:
    """The reference with its last angles held until the criterion's window ends."""
    step = float(reference.dt)
    count = int(np.ceil(HOLD / step))
    last = np.zeros((reference.order + 1, count, reference.derivatives.shape[2]))
    last[0] = np.asarray(reference.positions[-1])
    times = np.arange(reference.times.shape[0] + count) * step
    derivatives = jnp.concatenate([reference.derivatives, jnp.asarray(last)], axis=1)
    return Reference(times + float(reference.times[0]), derivatives)
