"""Friction laws: closed forms, referral through the gear, derivatives to saturation."""

import functools
import math

import jax
import jax.numpy as jnp
import pytest
from elastax._kernel import kernel
from elastax._taylor import compose, from_derivatives
from elastax.drivetrain import CoulombViscousFriction, TwoScaleFriction
from hypothesis import given, settings, strategies as st

from tests.drivetrain.friction_laws import (
    SPEED,
    coulomb_viscous,
    each_law,
    each_law_slowly,
    each_odd_law,
    two_scale,
)
from tests.helpers import assert_close, assert_gradient, load_vectors


EPS = jnp.finfo(jnp.float64).eps


def test_vector():
    (vector,) = load_vectors("2.3")
    inputs, outputs = vector["inputs"], vector["outputs"]
    law = CoulombViscousFriction(inputs["tau_v"], inputs["tau_h"], inputs["s"])
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    torque = law.torque(jnp.array(inputs["dphi"]))
    assert_close(torque, outputs["tau_r"], **tolerance)
    slope = jax.grad(law.torque)(jnp.array(0.0))
    assert_close(slope, outputs["slope0"], **tolerance)
    extreme = law.torque(jnp.array(inputs["dphi_extreme"]))
    assert_close(extreme, outputs["tau_r_extreme"], **tolerance)


def test_referral_vector():
    (vector,) = load_vectors("2.3.1 referral")
    inputs, outputs = vector["inputs"], vector["outputs"]
    motor = CoulombViscousFriction(inputs["tau_v_m"], inputs["tau_h_m"], inputs["s_m"])
    output = motor.to_output_side(inputs["i"])
    assert_close(output.viscous, outputs["tau_v"], rtol=vector["tol"])
    assert_close(output.coulomb, outputs["tau_h"], rtol=vector["tol"])
    assert_close(output.steepness, outputs["s"], rtol=vector["tol"])
    speed = jnp.array(outputs["omega_out"])
    assert_close(output.torque(speed), outputs["friction_out"], rtol=vector["tol"])


@each_law
def test_referral_keeps_the_power(law):
    ratio = jnp.array([256.0, -105.0])
    torque = law.to_output_side(ratio).torque(SPEED)
    assert_close(torque, ratio * law.torque(ratio * SPEED), rtol=1e-14)
    assert_close(torque * SPEED, law.torque(ratio * SPEED) * ratio * SPEED, rtol=1e-14)


@each_odd_law
def test_odd_and_dissipative(law):
    speed = jnp.array([[0.0, 0.0], [1e-6, 3e-5], [2e-3, 4e-2], [0.5, 2.0]])
    forward, backward = jax.vmap(law.torque)(speed), jax.vmap(law.torque)(-speed)
    assert_close(forward, -backward, rtol=1e-15)
    assert_close(forward[0], jnp.zeros(2), rtol=0.0)
    assert jnp.all(forward[1:] > 0)


def test_the_offset_alone_acts_at_rest():
    assert_close(two_scale.torque(jnp.zeros(2)), two_scale.offset, rtol=0.0)


def test_two_scales_against_the_sum_of_two_laws():
    law = two_scale
    coarse = CoulombViscousFriction(law.viscous, law.coulomb, 2.0 * law.steepness)
    fine = CoulombViscousFriction(
        jnp.zeros(2), law.coulomb_fine, 2.0 * law.steepness_fine
    )
    expected = law.offset + coarse.torque(SPEED) + fine.torque(SPEED)
    assert_close(law.torque(SPEED), expected, rtol=1e-14)


second_derivatives = {
    "forward over forward": lambda f: jax.jacfwd(jax.jacfwd(f)),
    "forward over reverse": lambda f: jax.jacfwd(jax.grad(f)),
    "reverse over forward": lambda f: jax.grad(jax.jacfwd(f)),
    "reverse over reverse": lambda f: jax.grad(jax.grad(f)),
}


@pytest.mark.parametrize(
    "derivative", second_derivatives.values(), ids=second_derivatives
)
def test_second_derivative_up_to_saturation(derivative):
    # The naive derivative of tanh loses its digits from 10 on and is 0 from 19 on.
    law = CoulombViscousFriction(0.0, 1.0, 2.0)
    second = jax.jit(derivative(law.torque))
    for x in (0.0, 0.5, -5.0, 15.0, 20.0, -40.0, 300.0):
        exact = -2.0 * math.tanh(x) / math.cosh(x) ** 2
        assert_close(second(jnp.array(x)), exact, rtol=1e-13)


def test_fourth_derivative():
    law = CoulombViscousFriction(0.0, 1.0, 2.0)
    function = law.torque
    for _ in range(4):
        function = functools.partial(derivative_of, function)
    for x in (0.3, -3.0, 30.0):
        t, s = math.tanh(x), 1.0 / math.cosh(x) ** 2
        # d^4 tanh = 8 tanh sech^2 (2 sech^2 - tanh^2), from d tanh = sech^2.
        assert_close(function(jnp.array(x)), 8.0 * t * s * (2.0 * s - t**2), rtol=1e-12)


def derivative_of(function, x):
    return jax.jvp(function, (x,), (jnp.ones_like(x),))[1]


@pytest.mark.slow
@each_law_slowly
def test_gradient(law):
    assert_gradient(lambda f, v: f.torque(v), law, SPEED, order=2)


@each_law_slowly
def test_extremes_are_finite(law):
    speeds = jnp.array([[0.0], [1e-300], [1e8]]) * jnp.array([[1.0, -1.0]])

    def everything(law, speed):
        total = lambda f, v: jnp.sum(f.torque(v))
        slope = jax.grad(total, argnums=1)
        curvature = jax.jvp(lambda v: slope(law, v), (speed,), (jnp.ones(2),))
        twice = jax.grad(lambda f: jnp.sum(slope(f, speed)))(law)
        return law.torque(speed), curvature, jax.grad(total)(law, speed), twice

    for leaf in jax.tree.leaves(jax.jit(jax.vmap(everything, (None, 0)))(law, speeds)):
        assert jnp.all(jnp.isfinite(leaf))
    # Without overflow: far out only a straight line and the levels are left.
    one = jnp.ones(2)
    torque, slope = jax.jvp(law.torque, (speeds[2],), (one,))
    assert jnp.all(jnp.abs(torque - slope * speeds[2]) < 1e-3 * slope * 1e8 + 10.0)


@each_law_slowly
def test_speed_inverts_torque(law):
    scale = jnp.array([1e-6, 0.1, 3.0, 40.0, 3e3])[:, None]
    speed = scale * SPEED[None]
    torque = jax.vmap(law.torque)(speed)
    recovered = jax.jit(jax.vmap(law.speed))(torque)
    assert_close(jax.vmap(law.torque)(recovered), torque, rtol=1e-12)
    slope = jax.vmap(lambda v: jax.jvp(law.torque, (v,), (jnp.ones(2),))[1])(speed)
    # Rounding of the torque, through the inverse; nothing but rounding remains.
    assert jnp.all(jnp.abs(recovered - speed) <= 10 * EPS * jnp.abs(torque) / slope)


@each_law_slowly
def test_speed_gradient(law):
    # At a moderate speed: where a law is nearly flat, its inverse is all rounding.
    torque = law.torque(jnp.array([0.02, -1e-3]))
    assert_gradient(lambda f, t: f.speed(t), law, torque)


def test_speed_beyond_the_range_of_a_bounded_law():
    law = CoulombViscousFriction(0.0, 5.0, 400.0)
    speed, slope = jax.jvp(law.speed, (jnp.array([6.0, -6.0]),), (jnp.ones(2),))
    assert jnp.all(jnp.isfinite(speed)) and jnp.all(speed[0] > 1e50 > -1e50 > speed[1])
    assert_close(slope, jnp.zeros(2), rtol=0.0)


@settings(deadline=None, max_examples=40)
@given(
    steepness=st.floats(0.0, 6.0), place=st.floats(-8.0, 8.0), viscous=st.floats(-6, 3)
)
def test_speed_over_decades(steepness, place, viscous):
    law = CoulombViscousFriction(10.0**viscous, 38.0, 10.0**steepness)
    speed = jnp.array(10.0**place)
    torque, slope = jax.jvp(law.torque, (speed,), (jnp.ones(()),))
    error = jitted_round_trip(law, speed) - speed
    assert jnp.abs(error) <= 10 * EPS * jnp.maximum(speed, jnp.abs(torque) / slope)


@jax.jit
def jitted_round_trip(law, speed):
    return law.speed(law.torque(speed))


@pytest.mark.slow
@each_law
def test_taylor_composition(law):
    # Speed moves as v + a t: the coefficients are those of the derivatives.
    rate = jnp.array([0.3, -0.2])
    for speed in (SPEED, jnp.zeros(2), jnp.full(2, 1e-300), jnp.full(2, -1e8)):
        series = from_derivatives(jnp.stack([speed, rate, *jnp.zeros((3, 2))]))
        result = compose(law.torque, series).derivatives()
        assert jnp.all(jnp.isfinite(result))
    result = compose(
        law.torque, from_derivatives(jnp.stack([SPEED, rate, *jnp.zeros((2, 2))]))
    ).derivatives()
    function = law.torque
    for order in range(4):
        assert_close(result[order], function(SPEED) * rate**order, rtol=1e-11)
        function = functools.partial(derivative_of, function)


@pytest.mark.slow
@each_law
def test_in_a_kernel(law):
    inside = kernel(lambda law, speed: law.torque(speed))
    assert_close(inside(law, SPEED), law.torque(SPEED), rtol=1e-13)
    text = jax.jit(inside).lower(law, SPEED).as_text()
    assert "elastax_" in text


@each_law
def test_jit_vmap_and_loop_agree(law):
    speeds = SPEED[None] * jnp.linspace(-2.0, 3.0, 5)[:, None]
    loop = jnp.stack([law.torque(speed) for speed in speeds])
    assert_close(jax.jit(jax.vmap(law.torque))(speeds), loop, rtol=1e-14, atol=1e-13)


@each_law
def test_scaled(law):
    torque = law.torque(SPEED)
    assert_close(law.scaled(0.7).torque(SPEED), 0.7 * torque, rtol=1e-14)
    jitted = jax.jit(lambda factor: law.scaled(factor).torque(SPEED))(0.7)
    assert_close(jitted, 0.7 * torque, rtol=1e-13)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: CoulombViscousFriction(-1.0, 1.0, 1.0), "`viscous` must not be"),
        (lambda: CoulombViscousFriction(1.0, -1.0, 1.0), "`coulomb` must not be"),
        (lambda: CoulombViscousFriction(1.0, 1.0, 0.0), "`steepness` must be positive"),
        (
            lambda: CoulombViscousFriction(jnp.ones(2), jnp.ones(3), jnp.ones(2)),
            "must have the shape",
        ),
        (lambda: coulomb_viscous.to_output_side(0.0), "`ratio` must not be zero"),
        (lambda: TwoScaleFriction(1.0, 1.0, 1.0, -1.0, 1.0, 0.0), "`coulomb_fine`"),
        (lambda: TwoScaleFriction(1.0, 1.0, 1.0, 1.0, 0.0, 0.0), "`steepness_fine`"),
        (
            lambda: CoulombViscousFriction(0.0, 0.0, 1.0).speed(jnp.ones(())),
            "must be monotone",
        ),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
