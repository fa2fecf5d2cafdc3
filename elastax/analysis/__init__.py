"""Figures that judge a motion."""

from ._judgement import (
    Judgement as Judgement,
    criterion as criterion,
    judge as judge,
)
