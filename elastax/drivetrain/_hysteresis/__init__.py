"""Hysteresis operators: exact and smooth plays, Prandtl-Ishlinskii, its inverse."""

from ._delayed_play import DelayedPlay as DelayedPlay
from ._exact import PrandtlIshlinskii as PrandtlIshlinskii, play as play
from ._pade_delay import PadeDelay as PadeDelay
from ._play_base import AbstractSmoothPlay as AbstractSmoothPlay
from ._rate_independent import RateIndependentPlay as RateIndependentPlay
