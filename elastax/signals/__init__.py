"""Signals: filters that deliver derivatives, reference motions, interpolation."""

from ._filters import (
    AbstractFilter as AbstractFilter,
    BesselFilter as BesselFilter,
    CriticallyDampedFilter as CriticallyDampedFilter,
    FirstOrderHold as FirstOrderHold,
)
from ._interpolate import (
    UniformHermite as UniformHermite,
    UniformLinear as UniformLinear,
    UniformQuintic as UniformQuintic,
)
from ._reference import (
    Reference as Reference,
    check_recording_signal as check_recording_signal,
)
