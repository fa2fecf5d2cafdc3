"""Friction by direction: levels, smoothness at rest, negative ratios, monotonicity."""

import jax
import jax.numpy as jnp
import pytest
from elastax.drivetrain import AsymmetricFriction, CoulombViscousFriction

from tests.helpers import assert_close


def blend(forward, backward, steepness=60.0):
    return AsymmetricFriction(
        CoulombViscousFriction(0.0, forward, 60.0),
        CoulombViscousFriction(0.0, backward, 60.0),
        steepness,
    )


def test_levels_and_rest():
    law = blend(5.0, 3.0)
    torque = law.torque(jnp.array([10.0, -10.0, 0.0]))
    assert_close(torque, jnp.array([5.0, -3.0, 0.0]), rtol=1e-15)
    assert_close(law.torque(-jnp.array(0.0)), 0.0, rtol=0.0)
    # Both laws have the slope s tau_h / 2 at rest; the blend has their mean.
    assert_close(jax.grad(law.torque)(jnp.array(0.0)), 30.0 * 4.0, rtol=1e-15)


def test_equal_laws_are_not_changed():
    speed = jnp.array([-0.3, -1e-4, 2e-3, 5.0])
    expected = blend(5.0, 5.0).forward.torque(speed)
    assert_close(blend(5.0, 5.0).torque(speed), expected, rtol=1e-15)


def test_a_negative_ratio_swaps_the_directions():
    law = blend(5.0, 3.0).to_output_side(-2.0)
    torque = law.torque(jnp.array([10.0, -10.0]))
    assert_close(torque, jnp.array([6.0, -10.0]), rtol=1e-15)


@pytest.mark.parametrize(("ratio", "monotone"), [(2.99, True), (3.01, False)])
def test_levels_may_differ_by_a_factor_of_three(ratio, monotone):
    assert bool(blend(ratio, 1.0).is_monotone()) == monotone
    assert bool(blend(1.0, ratio).is_monotone()) == monotone


def test_zero_steepness_is_refused():
    with pytest.raises(ValueError, match="`steepness` must not be zero"):
        blend(5.0, 3.0, 0.0)
