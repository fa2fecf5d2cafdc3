"""Trajectories: point-to-point profiles, Cartesian paths, reference motions."""

from ..signals import Reference as Reference
from ._cartesian import (
    StraightPath as StraightPath,
    path_to_joints as path_to_joints,
    rectangle as rectangle,
)
from ._ptp import (
    PointToPoint as PointToPoint,
    SevenSegments as SevenSegments,
)
