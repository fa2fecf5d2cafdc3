"""Levenberg-Marquardt steps that are not refused for rounding."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import lineax as lx
import optimistix as optx


class RoundingSearch(optx.AbstractSearch):
    """Trust region that accepts steps between which the sum of squares cannot decide.

    Near its minimum a sum of squares changes by less than its own rounding. A trust
    region then refuses good steps at random, and damps until a step is too short to
    matter. Residuals that are weighted by their deviations have a sum whose differences
    of 1e-9 mean nothing: these are accepted.

    Attributes:
        region: what decides otherwise.
        allowance: increase of half the sum of squares, on top of one, that is accepted.
    """

    region: optx.ClassicalTrustRegion
    allowance: float = 1e-9

    def init(self, y, f_info_struct):
        return self.region.init(y, f_info_struct)

    def step(self, first_step, y, y_eval, f_info, f_eval_info, state):
        size, accept, result, new = self.region.step(
            first_step, y, y_eval, f_info, f_eval_info, state
        )
        before, now = f_info.as_min(), f_eval_info.as_min()
        level = now - before <= self.allowance * (1.0 + before)
        # such a step says nothing about the size of the region either
        keep = level & ~accept
        size = jnp.where(keep, state.step_size, size)
        return size, accept | level, result, self._with_size(new, size)

    def _with_size(self, state, size):
        return type(state)(step_size=size)


class LevenbergMarquardt(optx.AbstractGaussNewton):
    """optimistix' Levenberg-Marquardt method with `RoundingSearch`.

    Attributes:
        rtol, atol: a step ends the search if unknowns and residuals change by less.
        norm, descent, search, verbose: as in optimistix.
    """

    rtol: float
    atol: float
    norm: Callable[..., Any]
    descent: optx.AbstractDescent
    search: optx.AbstractSearch
    verbose: Callable[..., None]

    def __init__(self, rtol: float, atol: float):
        self.rtol = rtol
        self.atol = atol
        self.norm = optx.max_norm
        self.descent = optx.DampedNewtonDescent(linear_solver=lx.QR())
        self.search = RoundingSearch(optx.ClassicalTrustRegion())
        self.verbose = _silent


def _silent(**values) -> None:
    """Nobody watches the steps."""
