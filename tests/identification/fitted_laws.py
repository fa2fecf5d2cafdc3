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
    ConstantEfficiency,
    CoulombViscousFriction,
    DirectionalEfficiency,
    FallingEfficiency,
    LoadFriction,
    PiecewiseFriction,
    SpringCounterbalance,
    StribeckFriction,
    TemperatureFriction,
    TransmissionError,
    TwoScaleFriction,
)
from elastax.structure import (
    BacklashStiffness,
    CubicStiffness,
    ExponentialStiffness,
    LimitedStiffness,
    LinearStiffness,
    TabulatedStiffness,
)


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


def load_torque(mesh, sample):
    """What the teeth hand on."""
    return mesh.load_torque(*sample)


def drive_torque(mesh, sample):
    """What drives the teeth."""
    return mesh.drive_torque(*sample)


def motor_angle(error, angle):
    """Angle of the motor over that behind the teeth."""
    return error.motor_angle(angle)


def torques_and_speeds(steepness):
    """Both directions of the power, at every speed."""
    torque, speed = np.meshgrid(np.linspace(-50.0, 50.0, 12), speeds(steepness))
    return jnp.asarray(torque.ravel()), jnp.asarray(speed.ravel())


def angles(_):
    """Three quarters of a turn."""
    return jnp.linspace(-2.5, 2.2, 400)


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
    "breakaway within the crossing": Case(
        # the bell is over before the crossing is: a minimum without a bell as well
        lambda s: BreakawayFriction(12.5, 10.0, s, 11.0, 0.2 / s),
        starts=8,
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
    "exponential spring": Case(
        lambda s: ExponentialStiffness(2e5, 5e5, 300.0, 1e-4 / s),
        torsions,
        lambda law: law.rounding,
    ),
    "soft gap": Case(
        lambda s: BacklashStiffness(2e5, 4e-3, 4e-4 / s, 3e3),
        torsions,
        lambda law: law.rounding,
        starts=8,
    ),
    "table": Case(
        lambda _: TabulatedStiffness(
            jnp.array([2e-3, 5e-3, 1e-2]), jnp.array([300.0, 900.0, 2500.0])
        ),
        torsions,
        lambda law: law.torsions,
    ),
    "efficiency": Case(
        lambda s: DirectionalEfficiency(
            ConstantEfficiency(0.9),
            ConstantEfficiency(0.8),
            s,
            CoulombViscousFriction(5.0, 5.0, s),
        ),
        inputs=torques_and_speeds,
        held=lambda law: (law.steepness, law.driving_friction.steepness),
        function=load_torque,
    ),
    "falling efficiency": Case(
        lambda s: DirectionalEfficiency(
            FallingEfficiency(0.9, 0.05, 0.6, 40.0, 0.01), ConstantEfficiency(0.8), s
        ),
        inputs=torques_and_speeds,
        held=lambda law: (law.steepness, law.driving.sharpness, law.driving.rounding),
        function=load_torque,
    ),
    "load friction": Case(
        lambda s: LoadFriction(0.1, 0.05, max(0.2, 3.0 / s), s, 5.0),
        inputs=torques_and_speeds,
        held=lambda law: (law.steepness, law.rounding),
        function=drive_torque,
    ),
    "transmission error": Case(
        lambda _: TransmissionError(
            jnp.array([[3e-4], [1e-4]]),
            jnp.array([[1.0], [12.0]]),
            jnp.array([[0.4], [1.0]]),
            jnp.array([0.3]),
        ),
        lambda _: angles(_)[:, None],
        held=lambda law: law.orders,
        function=motor_angle,
    ),
    "counterbalance": Case(
        # torques alone do not tell the size of the linkage, nor the reference length
        # from the preload
        lambda _: SpringCounterbalance(0.72, 0.19, 0.35, 9e4, 0.53, 1.1e4, 1e3),
        angles,
        held=lambda law: (law.base_distance, law.reference_length, law.damping),
    ),
}
