"""Friction that depends on the temperature: closed form, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import CoulombViscousFriction, TemperatureFriction

from tests.helpers import assert_close


law = CoulombViscousFriction(12.5, 38.0, 45.0)


def test_viscous_part_decays_with_the_temperature():
    speed = jnp.array([-0.4, 1e-3, 2.0])
    for temperature in (-10.0, 20.0, 44.0, 80.0):
        warm = TemperatureFriction(law, 20.0, 12.0, 20.0, temperature)
        viscous = 12.5 + 20.0 * np.exp(-(temperature - 20.0) / 12.0)
        expected = CoulombViscousFriction(viscous, 38.0, 45.0)
        assert_close(warm.torque(speed), expected.torque(speed), rtol=1e-15)


def test_referral_leaves_the_temperature():
    warm = TemperatureFriction(law, 20.0, 12.0, 20.0, 44.0)
    output = warm.to_output_side(jnp.array([100.0, -50.0]))
    assert_close(output.temperature, jnp.array([44.0, 44.0]), rtol=0.0)
    expected = jnp.array([1e4, 2500.0]) * warm.warm_viscous()
    assert_close(output.warm_viscous(), expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((-1.0, 12.0, 20.0, 20.0), "`viscous` must not be negative"),
        ((1.0, 0.0, 20.0, 20.0), "`decay` must be positive"),
    ],
)
def test_refusals(values, message):
    with pytest.raises(ValueError, match=message):
        TemperatureFriction(law, *values)
