"""Coverage: intervals hold the true values as often as they say."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from elastax.kinematics import (
    CalibrationProblem,
    ChainParameters,
    Measurements,
    NoiseVariance,
    PointInstrument,
    estimate_parameters,
    identifiability,
)

from .arms import planar
from .calibration_arms import REFLECTORS, deviations, heavy, light, poses


SEEDS = 200
TRACKER = PointInstrument(5e-5, REFLECTORS)
ENCODERS = jnp.full(6, 1e-5)


def measured(instrument, chain, q, key=None, encoders=None):
    return Measurements.simulated(instrument, chain, q, key, encoders)


def problem_of(arm):
    """All parameters of an arm, from three reflectors at 30 poses."""
    readings = measured(TRACKER, arm, poses(30), None, ENCODERS)
    return CalibrationProblem(ChainParameters.of(arm), readings)


@pytest.fixture(scope="module")
def free():
    """Parameters that neither arm leaves open: one program serves both."""
    lost = [identifiability(problem_of(arm())).dependent for arm in (heavy, light)]
    # offsets along parallel axes; first axis and base; tool and last joint
    assert {"d_3", "base_z", "base_rz"} <= set(lost[0]) <= set(lost[1])
    assert set(lost[1]) - set(lost[0]) == {"d_4"}
    names = ChainParameters.of(heavy()).names
    return tuple(name for name in names if name not in lost[1])


def run(problem, true, keys):
    """Estimates from as many noisy data sets as there are keys."""

    def one(key):
        (part,) = problem.measurements
        readings = measured(
            part.instrument, problem.chain(true), part.q, key, part.joint_deviation
        )
        noisy = CalibrationProblem(problem.parameters, readings)
        found = estimate_parameters(noisy, throw=False)
        return found, found.half_width(0.95), found.standard_deviation()

    return jax.vmap(one)(keys)


program = jax.jit(run)


@pytest.mark.slow
@pytest.mark.parametrize("arm", (heavy, light))
def test_intervals_cover_the_true_values(arm, free):
    problem = problem_of(arm()).select(free)
    true = deviations(problem.units)
    keys = jax.random.split(jax.random.key(7), SEEDS)
    estimates, half_width, deviation = program(problem, true, keys)
    assert np.all(estimates.result == optx.RESULTS.successful)
    error = estimates.deviation - true[None]
    inside = np.abs(error) < half_width
    # 200 data sets with some 28 parameters, which are correlated among themselves: the
    # share scatters by some 0.5 % about 95 %
    assert 0.93 < np.mean(inside) < 0.97
    # a variance from 200 samples is uncertain by 10 %, their mean by less
    scaled = error / deviation
    assert abs(np.mean(scaled**2) - 1.0) < 0.1
    # the mean of chi-square is the number of degrees of freedom
    freedom = problem.rows - problem.number
    chi_square = np.sum(np.asarray(estimates.residuals) ** 2, axis=1)
    scatter = np.sqrt(2 * freedom / SEEDS)
    assert abs(np.mean(chi_square) - freedom) < 4 * scatter


@pytest.mark.slow
def test_estimated_variance_takes_students_distribution():
    """Three degrees of freedom: the normal distribution would cover 85 % only."""
    arm, instrument = planar(1.0, 0.7), PointInstrument(1e-4)
    q = jnp.array([[0.1, 0.5], [1.0, -0.7], [-0.5, 1.0]])
    parameters = ChainParameters.of(arm).select(
        ("a_1", "a_2", "theta_1", "theta_2", "base_z", "base_rx")
    )

    def one(key):
        noisy = CalibrationProblem(parameters, measured(instrument, arm, q, key))
        found = estimate_parameters(noisy, noise=NoiseVariance.ESTIMATED, throw=False)
        assert found.degrees_of_freedom == 3
        return found.deviation, found.half_width(0.95), found.standard_deviation()

    keys = jax.random.split(jax.random.key(1), 1000)
    error, half_width, deviation = jax.jit(jax.vmap(one))(keys)
    inside = np.abs(error) < half_width
    # 1000 data sets that share one variance each: the share scatters by 0.7 %
    assert 0.93 < np.mean(inside) < 0.97
    normal = np.abs(error) < 1.96 * deviation
    assert np.mean(normal) < 0.9
