"""Friction laws that the tests of all of them share, for two axes each."""

import jax.numpy as jnp
import pytest
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


coulomb_viscous = CoulombViscousFriction(
    jnp.array([12.5, 0.0]), jnp.array([38.0, 5.0]), jnp.array([45.0, 400.0])
)
# [Weigand2021], axes 1 and 2 of the KR300; the finer scale of axis 1 only.
two_scale = TwoScaleFriction(
    jnp.array([2050.35, 2306.7]),
    jnp.array([285.36, 10.0]),
    jnp.array([10.0, 100.0]),
    jnp.array([70.135, 232.33]),
    jnp.array([530.0, 28994.0]),
    jnp.array([54.024, -255.55]),
)
# Axis 1: the vector of (2.4).
stribeck = StribeckFriction(
    jnp.array([12.5, 400.0]),
    jnp.array([38.0, 3.0]),
    jnp.array([45.0, 6e3]),
    jnp.array([8.0, 0.5]),
    jnp.array([0.02, 3e-4]),
)
breakaway = BreakawayFriction(
    jnp.array([12.5, 60.0]),
    jnp.array([10.0, 0.0]),
    jnp.array([400.0, 1e4]),
    jnp.array([11.5, 1.0]),
    jnp.array([0.2, 0.02]),
)
# Axis 1: the vector of (2.5).
piecewise = PiecewiseFriction(
    jnp.array([0.62, 40.0]),
    jnp.array([60.0, 2e3]),
    jnp.array([0.08, 6e-3]),
    jnp.array([1.0, 0.3]),
    jnp.array([1.0, 60.0]),
    jnp.array([0.28, 25.0]),
)
asymmetric = AsymmetricFriction(
    coulomb_viscous.scaled(1.4), coulomb_viscous, jnp.array([60.0, 500.0])
)
warm = TemperatureFriction(
    stribeck,
    jnp.array([20.0, 9.0]),
    jnp.array([12.0, 25.0]),
    jnp.array([20.0, 20.0]),
    jnp.array([35.0, 48.0]),
)
mixed = AxisFriction(
    (
        PiecewiseFriction(0.62, 60.0, 0.08, 1.0, 1.0, 0.28),
        StribeckFriction(12.5, 38.0, 45.0, 8.0, 0.02),
    ),
    ((1,), (0,)),
)

odd_laws = [coulomb_viscous, stribeck, breakaway, piecewise, warm, mixed]
laws = [*odd_laws, two_scale, asymmetric]
QUICK = (coulomb_viscous, two_scale)
SIMPLE = tuple(law for law in laws if law is not mixed)


def each(laws, quick=None):
    """Parametrise over `laws`; with `quick`, those outside of it are slow tests."""
    slow = lambda law: quick is not None and all(law is not one for one in quick)
    return pytest.mark.parametrize(
        "law",
        [
            pytest.param(
                law,
                id=type(law).__name__,
                marks=[pytest.mark.slow] if slow(law) else [],
            )
            for law in laws
        ],
    )


each_law, each_odd_law = each(laws, SIMPLE), each(odd_laws, SIMPLE)
# Derivatives and inverses are costly to compile.
each_law_slowly = each(laws, QUICK)
SPEED = jnp.array([3e-3, -8e-5])
