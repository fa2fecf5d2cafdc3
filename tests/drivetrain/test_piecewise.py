"""Piecewise friction: vector, transitions, monotonicity, derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import PiecewiseFriction

from tests.helpers import assert_close, assert_gradient, load_vectors


def of_vector(vector):
    names = ("R_h", "s", "dphi_step", "dphi_lin", "tau_lin", "dtau_lin")
    return PiecewiseFriction(*(vector["inputs"][name] for name in names))


def test_vector():
    (vector,) = load_vectors("2.5")
    law, outputs = of_vector(vector), vector["outputs"]
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    torque = law.torque(jnp.array(vector["inputs"]["dphi"]))
    assert_close(torque, outputs["tau"], **tolerance)
    assert_close(law.coefficients(), outputs["p"], **tolerance)


def test_the_polynomial_of_the_text_with_another_break_speed():
    law = PiecewiseFriction(
        jnp.array([0.62, 40.0]),
        jnp.array([60.0, 2e3]),
        jnp.array([0.08, 6e-3]),
        jnp.array([2.0, 0.3]),
        jnp.array([1.0, 60.0]),
        jnp.array([0.05, 25.0]),
    )
    start, end = law.step_speed, law.break_speed
    speed = start[None] + jnp.linspace(0.0, 1.0, 7)[:, None] * (end - start)[None]
    expected = np.stack(
        [np.polyval(np.asarray(law.coefficients())[:, k], speed[:, k]) for k in (0, 1)]
    )
    # The powers cancel; Hermite's form does not.
    assert_close(jax.vmap(law.torque)(speed), expected.T, rtol=1e-13)


def test_value_and_slope_are_continuous():
    law = of_vector(*load_vectors("2.5"))
    places = jnp.stack([law.step_speed, law.break_speed])
    both_sides = jax.jit(jax.vmap(jax.value_and_grad(law.torque)))
    below, slope_below = both_sides(places * (1.0 - 1e-9))
    above, slope_above = both_sides(places * (1.0 + 1e-9))
    # Within 2e-9 of the speed the torque moves by its slope, the slope by less than
    # its largest derivative, some tens, times that.
    assert_close(below, above, rtol=1e-8)
    assert_close(slope_below, slope_above, rtol=1e-6)


def test_sections():
    law = of_vector(*load_vectors("2.5"))
    assert_close(law.torque(jnp.array(-0.05)), -0.62 * np.tanh(1.5), rtol=1e-15)
    assert_close(law.torque(jnp.array(-3.0)), -1.0 - 2.0 * 0.28, rtol=1e-15)
    slope = jax.grad(law.torque)(jnp.array(1e8))
    assert_close(slope, 0.28, rtol=1e-15)


@pytest.mark.slow
def test_gradient_beyond_the_zero_crossing():
    law = of_vector(*load_vectors("2.5"))
    speed = jnp.array([0.4, -0.9, 1.7])
    assert_gradient(lambda f, v: f.torque(v), law, speed, order=2)


@jax.jit
def least_slope(law):
    inside = law.step_speed + jnp.linspace(0.0, 1.0, 2001) * (
        law.break_speed - law.step_speed
    )
    return jnp.min(jax.vmap(jax.grad(law.torque))(inside))


def test_monotonicity_is_judged_at_the_least_slope_of_the_cubic():
    law = of_vector(*load_vectors("2.5"))
    structure, leaves = jax.tree.structure(law), jax.tree.leaves(law)
    refused = 0
    # The steeper the line, the deeper the cubic must dip before it.
    for slope in (0.28, 1.5, 1.6, 1.7, 1.8, 3.0):
        sampled = least_slope(jax.tree.unflatten(structure, [*leaves[:-1], slope]))
        if sampled > 0:
            assert dataclasses.replace(law, break_slope=slope).is_monotone()
            continue
        refused += 1
        with pytest.raises(ValueError, match="friction must not fall between"):
            dataclasses.replace(law, break_slope=slope)
    assert refused in (2, 3, 4)


def test_a_level_line_has_no_inverse():
    law = PiecewiseFriction(0.62, 60.0, 0.08, 1.0, 1.0, 0.0)
    assert not law.is_monotone()
    with pytest.raises(ValueError, match="must be monotone"):
        law.speed(jnp.array(0.5))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((-0.62, 60.0, 0.08, 1.0, 1.0, 0.28), "`coulomb` must be positive"),
        ((0.62, 0.0, 0.08, 1.0, 1.0, 0.28), "`steepness` must be positive"),
        ((0.62, 60.0, 0.0, 1.0, 1.0, 0.28), "`step_speed` must be positive"),
        ((0.62, 60.0, 0.08, 0.08, 1.0, 0.28), "`break_speed` must be above"),
        ((0.62, 60.0, 0.08, 1.0, 0.0, 0.28), "`break_torque` must be positive"),
        ((0.62, 60.0, 0.08, 1.0, 1.0, -0.1), "`break_slope` must not be negative"),
        ((0.62, 60.0, 0.08, 1.0, 0.5, 0.28), "friction must not fall between"),
    ],
)
def test_refusals(values, message):
    with pytest.raises(ValueError, match=message):
        PiecewiseFriction(*values)
