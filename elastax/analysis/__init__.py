"""Eigenfrequencies of a robot, and figures that judge a motion."""

from ._judgement import (
    WINDOW as WINDOW,
    Judgement as Judgement,
    criterion as criterion,
    judge as judge,
)
from ._locked_modes import locked_frequencies as locked_frequencies
