"""Fit of laws: recovery from far off, standard errors, what cannot be told apart."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import (
    CoulombViscousFriction,
    TemperatureFriction,
    TwoScaleFriction,
)
from elastax.identification import fit_law
from elastax.structure import LinearStiffness

from tests.helpers import assert_close
from tests.identification.fitted_laws import (
    CASES,
    STEEPNESS,
    coulomb,
    speeds,
    torque,
    warm_torque,
)


jitted_fit = eqx.filter_jit(fit_law)


def start_of(law, held, factors):
    """The law with every free parameter multiplied by a factor of its own."""
    leaves, structure = jax.tree.flatten(law)
    marks = jax.tree.unflatten(structure, range(len(leaves)))
    fixed = [] if held is None else jax.tree.leaves(held(marks))
    moved = [
        leaf if index in fixed else leaf * factor
        for index, (leaf, factor) in enumerate(zip(leaves, factors, strict=False))
    ]
    return jax.tree.unflatten(structure, moved)


HALF = np.full(12, 0.5)
MORE = np.full(12, 1.5)
# Neighbouring parameters on opposite sides.
MIXED = np.tile([0.5, 1.5, 1.5, 0.5], 3)


def check_recovery(case, steepness, factors):
    law = case.build(steepness)
    inputs = case.inputs(steepness)
    outputs = jax.vmap(lambda sample: case.function(law, sample))(inputs)
    start = start_of(law, case.held, factors)
    fit = jitted_fit(
        start, case.function, inputs, outputs, held=case.held, starts=case.starts
    )
    assert fit.unidentifiable() == ()
    # Without noise only rounding is left, and how the parameters pass it on.
    assert_close(fit.law, law, rtol=1e-9)
    assert fit.determination > 1.0 - 1e-12
    assert jnp.all(jnp.isfinite(fit.deviations)) and jnp.isfinite(fit.rms)


def test_recovery_of_coulomb_friction():
    check_recovery(CASES["coulomb"], 30.0, HALF)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_recovery_from_half_off(case):
    for steepness in STEEPNESS:
        for factors in (HALF, MORE, MIXED):
            check_recovery(case, steepness, factors)


# One compilation serves all fits with the same number of samples.
def fit_coulomb(start, speed, measured):
    held = CASES["coulomb"].held
    return jitted_fit(start, torque, speed, measured, held=held, starts=1)


def noisy(law, speed, deviation, seed=0):
    noise = np.random.default_rng(seed).standard_normal(speed.shape)
    return jax.vmap(law.torque)(speed) + deviation * jnp.asarray(noise)


def test_standard_errors_against_linear_regression():
    law, speed = coulomb(45.0), speeds(45.0)
    measured = noisy(law, speed, 0.3)
    fit = fit_coulomb(CoulombViscousFriction(6.0, 19.0, 45.0), speed, measured)
    columns = np.stack([speed, np.tanh(22.5 * np.asarray(speed))], axis=1)
    values, square, _, _ = np.linalg.lstsq(columns, np.asarray(measured))
    variance = square[0] / (speed.size - 2)
    spread = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    assert fit.names == ("viscous", "coulomb")
    # The search ends once a step moves nothing by more than 1e-10.
    assert_close(fit.values, values, rtol=1e-8)
    assert_close(fit.deviations, spread, rtol=1e-8)
    assert_close(fit.rms, np.sqrt(square[0] / speed.size), rtol=1e-10)
    y = np.asarray(measured)
    expected = 1.0 - square[0] / np.sum((y - y.mean()) ** 2)
    assert_close(fit.determination, expected, rtol=1e-12)


@pytest.mark.slow
def test_given_deviation_replaces_the_estimated_one():
    law, speed = coulomb(45.0), speeds(45.0)
    measured = noisy(law, speed, 0.3)
    own = fit_coulomb(law, speed, measured)
    held = CASES["coulomb"].held
    given = jitted_fit(law, torque, speed, measured, held=held, deviation=0.6)
    assert_close(given.values, own.values, rtol=1e-8)
    estimated = own.rms * jnp.sqrt(speed.size / (speed.size - 2))
    assert_close(given.deviations, own.deviations * 0.6 / estimated, rtol=1e-7)
    # 0.3 was the true one; the estimate is off by its own error of 2.5 % or so.
    assert_close(estimated, 0.3, rtol=0.1)


@pytest.mark.slow
def test_steepness_is_fitted_where_it_matters():
    law, speed = coulomb(45.0), speeds(45.0)
    outputs = jax.vmap(law.torque)(speed)
    start = jax.tree.map(lambda leaf: 0.5 * leaf, law)
    fit = fit_law(start, torque, speed, outputs)
    assert fit.unidentifiable() == ()
    assert_close(fit.law, law, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("slowest", [2.0, 40.0])
def test_steepness_is_unidentifiable_far_from_the_zero_crossing(slowest):
    # Where tanh is one the torque does not depend on the steepness at all; its
    # derivative is 1e-38 at the first of these speeds, zero at the second.
    law = coulomb(45.0)
    speed = jnp.linspace(slowest, 2.0 * slowest, 50)
    speed = jnp.concatenate([-speed, speed])
    outputs = jax.vmap(law.torque)(speed)
    start = CoulombViscousFriction(6.25, 57.0, 22.5)
    fit = jitted_fit(start, torque, speed, outputs)
    assert fit.unidentifiable() == ("steepness",)
    assert_close(fit.law.viscous, 12.5, rtol=1e-9)
    assert_close(fit.law.coulomb, 38.0, rtol=1e-9)
    assert not jnp.any(jnp.isnan(fit.deviations))


@pytest.mark.slow
def test_parameters_that_act_only_jointly_are_unidentifiable():
    speed = jnp.concatenate([speeds(45.0)] * 2)
    temperature = jnp.repeat(jnp.array([20.0, 50.0]), speed.size // 2)
    law = TemperatureFriction(coulomb(45.0), 20.0, 12.0, 20.0, 0.0)
    samples = (speed, temperature)
    outputs = jax.vmap(lambda sample: warm_torque(law, sample))(samples)
    held = lambda law: (law.law.steepness, law.temperature, law.decay)
    start = dataclasses.replace(law, viscous=12.0)
    fit = fit_law(start, warm_torque, samples, outputs, held=held)
    assert fit.names == ("law.viscous", "law.coulomb", "viscous", "reference")
    assert fit.unidentifiable() == ("viscous", "reference")
    assert jnp.all(jnp.isinf(fit.deviations[2:]))
    assert jnp.all(jnp.isfinite(fit.deviations[:2]))
    assert_close(fit.law.warm_viscous() / law.warm_viscous(), 1.0, rtol=1e-6)


@pytest.mark.slow
def test_torques_do_not_tell_the_size_of_a_linkage():
    case = CASES["counterbalance"]
    law, angle = case.build(1.0), case.inputs(1.0)
    held = lambda law: (law.reference_length, law.damping)
    fit = fit_law(law, torque, angle, law.torque(angle), held=held)
    jointly = ("base_distance", "lever", "spring_rate", "preload")
    assert fit.unidentifiable() == jointly
    assert fit.names == (*jointly[:2], "angle_offset", *jointly[2:])


@pytest.mark.slow
def test_signed_parameters_may_change_their_sign():
    law = TwoScaleFriction(2050.0, 285.0, 10.0, 70.0, 530.0, -54.0)
    speed = speeds(10.0)
    outputs = jax.vmap(law.torque)(speed)
    start = dataclasses.replace(law, offset=30.0, viscous=1000.0)
    held = lambda law: (law.steepness, law.steepness_fine)
    offset = lambda law: law.offset
    fit = fit_law(start, torque, speed, outputs, held=held, signed=offset)
    assert_close(fit.law, law, rtol=1e-9)


@pytest.mark.slow
def test_several_starts_leave_a_local_minimum():
    case, steepness = CASES["piecewise"], 30.0
    law, speed = case.build(steepness), speeds(steepness)
    outputs = jax.vmap(law.torque)(speed)
    start = start_of(law, case.held, MORE)
    one = fit_law(start, torque, speed, outputs, held=case.held, throw=False)
    best = fit_law(start, torque, speed, outputs, held=case.held, starts=8)
    assert one.rms > 1e-4 > 1e-12 > best.rms


@pytest.mark.slow
def test_values_per_axis_have_numbered_names():
    spring = LinearStiffness(jnp.array([2e5, 3e4]))
    torsion = jnp.array([[1e-3, 2e-3], [-2e-3, 1e-3], [3e-3, 4e-3]])
    outputs = jax.vmap(spring.torque)(torsion)
    fit = fit_law(spring.scaled(0.5), torque, torsion, outputs)
    assert fit.names == ("linear[0]", "linear[1]")
    assert_close(fit.law, spring, rtol=1e-10)


SPEEDS = jnp.linspace(0.1, 1.0, 3)


@pytest.mark.parametrize(
    ("samples", "options", "message"),
    [
        (SPEEDS, {}, "3 parameters need 4 outputs at least"),
        (SPEEDS, {"held": lambda law: jax.tree.leaves(law)}, "all are held"),
    ],
)
def test_refusals(samples, options, message):
    with pytest.raises(ValueError, match=message):
        fit_law(coulomb(45.0), torque, samples, samples, **options)


def test_single_precision_is_refused():
    with jax.enable_x64(False), pytest.raises(ValueError, match="double precision"):
        fit_law(coulomb(45.0), torque, SPEEDS, SPEEDS)


def test_measurements_must_be_finite():
    with pytest.raises(RuntimeError, match="`outputs` must be finite"):
        fit_law(LinearStiffness(1e5), torque, SPEEDS, SPEEDS.at[1].set(jnp.nan))
