"""Laws whose parameters the tests recover from their own output.

A law that is to be fitted gets a line in `CASES`.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import (
    AsymmetricFriction,
    AxisFriction,
    BreakawayFriction,
    CoulombViscousFriction,
    PiecewiseFriction,
    StribeckFriction,
    TemperatureFriction,
    TwoScaleFriction,
)
from elastax.structure import CubicStiffness, LimitedStiffness, LinearStiffness


STEEPNESS = (1.0, 30.0, 1e3, 1e4)


def torque(law, argument):
    """What friction and springs have in common."""
    return law.torque(argument)


def warm_torque(law, sample):
    """Friction at the speed and temperature of a sample."""
    speed, temperature = sample
    return eqx.tree_at(lambda law: law.temperature, law, temperature).torque(speed)


def speeds(steepness):
    """Both directions, from a tenth of the crossing's width to far beyond it."""
    size = np.geomspace(0.1 / steepness, 10.0, 400)
    return jnp.asarray(np.concatenate([-size[::-1], size]))


def speeds_and_temperatures(steepness):
    """The speeds at three temperatures."""
    speed = speeds(steepness)
    return jnp.tile(speed, 3), jnp.repeat(jnp.array([20.0, 35.0, 60.0]), speed.size)


def two_axes(steepness):
    """The speeds of two axes."""
    return jnp.stack([speeds(steepness), speeds(2.0 * steepness)], axis=1)


def torsions(_):
    """Far into the limit of a spring."""
    size = np.geomspace(1e-4, 2e-2, 400)
    return jnp.asarray(np.concatenate([-size[::-1], size]))


@dataclasses.dataclass(frozen=True)
class Case:
    """A law and what is measured of it.

    Attributes:
        build: the true law, from a steepness.
        inputs: from the steepness.
        held: parameters that are not fitted.
        function: of a law and a sample.
        starts: of the fit.
    """

    build: Callable[[float], Any]
    inputs: Callable[[float], Any] = speeds
    held: Callable[[Any], Any] | None = lambda law: law.steepness
    function: Callable[[Any, Any], Any] = torque
    starts: int = 1


coulomb = lambda s, factor=1.0: CoulombViscousFriction(12.5, 38.0 * factor, s)

# Features of a law stay at speeds where its zero crossing is over.
CASES = {
    "coulomb": Case(coulomb),
    "two scales": Case(
        lambda s: TwoScaleFriction(2050.35, 285.36, s, 70.135, 53.0 * s, 54.024),
        held=lambda law: (law.steepness, law.steepness_fine),
    ),
    "stribeck": Case(lambda s: StribeckFriction(12.5, 38.0, s, 8.0, 0.02)),
    "breakaway": Case(
        lambda s: BreakawayFriction(12.5, 10.0, s, 11.0, max(0.2, 3.0 / s))
    ),
    "piecewise": Case(
        lambda s: PiecewiseFriction(
            0.62, s, max(0.08, 4.0 / s), max(1.0, 8.0 / s), 1.0, 0.28 if s > 9 else 0.08
        ),
        # where the sections meet is fitted too: there are several minima
        starts=8,
    ),
    "asymmetric": Case(
        lambda s: AsymmetricFriction(coulomb(s), coulomb(s, 0.7), s),
        held=lambda law: (
            law.steepness,
            law.forward.steepness,
            law.backward.steepness,
        ),
    ),
    "temperature": Case(
        lambda s: TemperatureFriction(coulomb(s), 20.0, 12.0, 20.0, 35.0),
        inputs=speeds_and_temperatures,
        held=lambda law: (law.reference, law.temperature, law.law.steepness),
        function=warm_torque,
    ),
    "two axes": Case(
        lambda s: AxisFriction(
            (coulomb(s), StribeckFriction(12.5, 38.0, 2.0 * s, 8.0, 0.02)),
            ((1,), (0,)),
        ),
        inputs=two_axes,
        held=lambda law: (law.laws[0].steepness, law.laws[1].steepness),
    ),
    "linear spring": Case(lambda _: LinearStiffness(2e5), torsions, None),
    "cubic spring": Case(lambda _: CubicStiffness(2e5, 4e4), torsions, None),
    "limited spring": Case(
        # the limitation is as sharp as a zero crossing: over a fraction of the limit
        lambda s: LimitedStiffness(2e5, 4e4, 5e5, 100.0 * s / 5e5),
        torsions,
    ),
}
