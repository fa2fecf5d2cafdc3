"""Identification: recordings, encoder skew, friction, figures of merit."""

from ._evaluate import (
    RecordingReport as RecordingReport,
    evaluate_recording as evaluate_recording,
)
from ._hysteresis_fit import (
    HysteresisFit as HysteresisFit,
    fit_hysteresis as fit_hysteresis,
    suggest_thresholds as suggest_thresholds,
)
from ._law_fit import LawFit as LawFit, fit_law as fit_law
from ._recording import Recording as Recording, recorded_reference as recorded_reference
from ._recording_fit import (
    STEEPNESS_GRID as STEEPNESS_GRID,
    FrictionFit as FrictionFit,
    coefficient_of_determination as coefficient_of_determination,
    fit_friction as fit_friction,
    predict_torque as predict_torque,
)
from ._skew import EncoderSkew as EncoderSkew, estimate_skew as estimate_skew
