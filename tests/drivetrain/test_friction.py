"""Friction laws: closed forms, referral through the gear, derivatives to saturation."""

import functools
import math

import jax
import jax.numpy as jnp
import pytest
from elastax.drivetrain import CoulombViscousFriction, TwoScaleFriction

from tests.helpers import assert_close, assert_gradient, load_vectors


laws = [
    CoulombViscousFriction(
        jnp.array([12.5, 0.0]), jnp.array([38.0, 5.0]), jnp.array([45.0, 400.0])
    ),
    # [Weigand2021], axes 1 and 2 of the KR300; the finer scale of axis 1 only.
    TwoScaleFriction(
        jnp.array([2050.35, 2306.7]),
        jnp.array([285.36, 10.0]),
        jnp.array([10.0, 100.0]),
        jnp.array([70.135, 232.33]),
        jnp.array([530.0, 28994.0]),
        jnp.array([54.024, -255.55]),
    ),
]
each_law = pytest.mark.parametrize("law", laws, ids=lambda f: type(f).__name__)
SPEED = jnp.array([3e-3, -8e-5])


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


@each_law
def test_odd_but_for_the_offset_and_dissipative(law):
    speed = jnp.array([[1e-6, 3e-5], [2e-3, 4e-2], [0.5, 2.0]])
    torque = jax.vmap(law.torque)
    rest = law.torque(jnp.zeros(2))
    offset = law.offset if isinstance(law, TwoScaleFriction) else jnp.zeros(2)
    assert_close(rest, offset, rtol=0.0)
    forward, backward = torque(speed) - rest[None], torque(-speed) - rest[None]
    assert_close(forward, -backward, rtol=1e-12, atol=1e-12)
    assert jnp.all(forward * speed > 0)


def test_two_scales_against_the_sum_of_two_laws():
    law = laws[1]
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


@each_law
def test_gradient(law):
    assert_gradient(lambda f, v: f.torque(v), law, SPEED, order=2)


@each_law
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
    # Without overflow: far out only the viscous part and the levels are left.
    level = law.torque(speeds[2]) - law.viscous * speeds[2]
    assert jnp.all(jnp.abs(level) < 1e-3 * law.viscous * 1e8 + 10.0)


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
        (lambda: laws[0].to_output_side(0.0), "`ratio` must not be zero"),
        (lambda: TwoScaleFriction(1.0, 1.0, 1.0, -1.0, 1.0, 0.0), "`coulomb_fine`"),
        (lambda: TwoScaleFriction(1.0, 1.0, 1.0, 1.0, 0.0, 0.0), "`steepness_fine`"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
