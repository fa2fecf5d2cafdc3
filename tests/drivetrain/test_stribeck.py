"""Stribeck laws: vectors, bump, peak, when they are monotone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import BreakawayFriction, StribeckFriction

from tests.helpers import assert_close, load_vectors


def test_vector():
    (vector,) = load_vectors("2.4 (recommended)")
    inputs, outputs = vector["inputs"], vector["outputs"]
    law = StribeckFriction(
        *(inputs[name] for name in ("tau_v", "tau_h", "s", "a", "c"))
    )
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    torque = law.torque(jnp.array(inputs["dphi"]))
    assert_close(torque, outputs["tau_r"], **tolerance)
    speed, peak = law.peak()
    assert_close(speed, outputs["v_peak"], **tolerance)
    assert_close(peak, outputs["bump_peak"], **tolerance)
    bump = StribeckFriction(0.0, 0.0, 1.0, law.stribeck_fall, law.stribeck_rise)
    assert_close(bump.torque(speed), outputs["bump_peak"], **tolerance)
    slope = jax.grad(bump.torque)(jnp.sqrt(3.0) * speed)
    assert_close(slope, outputs["bump_min_slope"], **tolerance)


def slopes(law):
    speed = jnp.asarray(np.geomspace(1e-5, 1e2, 4001))
    return jax.vmap(jax.grad(law.torque))(speed)


@pytest.mark.parametrize("excess", [1e-9, -0.01])
def test_stribeck_is_monotone_from_an_eighth_of_its_rise(excess):
    # The Coulomb part is saturated where the bump falls most, so the bound is sharp.
    law = StribeckFriction(6.25 * (1.0 + excess), 38.0, 4e3, 8.0, 0.02)
    assert bool(law.is_monotone()) == (excess > 0)
    assert bool(jnp.all(slopes(law) > 0)) == (excess > 0)


@pytest.mark.parametrize("excess", [1e-9, -0.01])
def test_breakaway_is_monotone_where_viscous_friction_outweighs_it(excess):
    bound = np.sqrt(2.0 / np.e) * 1.5 / 0.2
    law = BreakawayFriction(bound * (1.0 + excess), 10.0, 4e3, 11.5, 0.2)
    assert bool(law.is_monotone()) == (excess > 0)
    assert bool(jnp.all(slopes(law) > 0)) == (excess > 0)


def test_breakaway_level_falls_to_the_coulomb_level():
    law = BreakawayFriction(0.0, 10.0, 1e4, 11.5, 0.2)
    torque = law.torque(jnp.array([0.01, 0.2, 5.0]))
    # Level at v / v_s = 0.05, 1 and 25; the tangent is saturated at all three.
    bell = jnp.exp(-jnp.array([0.0025, 1.0, 625.0]))
    assert_close(torque, 10.0 + 1.5 * bell, rtol=1e-14)


def test_a_law_that_falls_has_no_inverse():
    law = StribeckFriction(1.0, 38.0, 4e3, 8.0, 0.02)
    with pytest.raises(ValueError, match="must be monotone to have an inverse"):
        law.speed(jnp.array(1.0))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: StribeckFriction(-1.0, 1.0, 1.0, 1.0, 1.0), "`viscous` must not"),
        (lambda: StribeckFriction(1.0, -1.0, 1.0, 1.0, 1.0), "`coulomb` must not"),
        (lambda: StribeckFriction(1.0, 1.0, 0.0, 1.0, 1.0), "`steepness` must be"),
        (lambda: StribeckFriction(1.0, 1.0, 1.0, 0.0, 1.0), "`stribeck_fall` must be"),
        (lambda: StribeckFriction(1.0, 1.0, 1.0, 1.0, -1.0), "`stribeck_rise` must be"),
        (lambda: BreakawayFriction(1.0, 2.0, 1.0, 1.0, 1.0), "`breakaway` must not be"),
        (lambda: BreakawayFriction(1.0, 1.0, 1.0, 2.0, 0.0), "`stribeck_speed` must"),
        (lambda: BreakawayFriction(1.0, -1.0, 1.0, 2.0, 1.0), "`coulomb` must not"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
