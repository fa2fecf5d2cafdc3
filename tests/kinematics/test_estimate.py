"""Estimates: exact data, normal equations, derivatives, noise, refusals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from elastax.kinematics import (
    CalibrationProblem,
    ChainParameters,
    DistanceInstrument,
    GaussianPrior,
    Measurements,
    NoiseVariance,
    PointInstrument,
    PoseInstrument,
    SerialChain,
    calibrate,
    estimate_parameters,
    forward_kinematics,
    identifiability,
    random_joints,
)

from ..helpers import assert_close, assert_gradient
from .arms import planar
from .calibration_arms import (
    deviations,
    estimate,
    heavy,
    measure,
    problem_of,
    true_problem,
)


@pytest.fixture(scope="module")
def pose_problem():
    """Some parameters of a planar arm, out of its plane too, from full poses."""
    q = random_joints(jnp.full(2, -2.0), jnp.full(2, 2.0), 8, key=jax.random.key(0))
    names = ("theta_2", "a_1", "a_2", "alpha_1", "base_x", "base_ry", "tool_z")
    return problem_of(planar(1.0, 0.7), PoseInstrument(1e-4, 1e-4), q, names)


@pytest.fixture(scope="module")
def small_problem():
    """Lengths and an angle of a planar arm from its tool's position."""
    q = jnp.array([[0.1, 0.5], [1.0, -0.7], [-0.5, 1.2]])
    names = ("a_1", "a_2", "theta_2")
    return problem_of(planar(1.0, 0.7), PointInstrument(1e-3), q, names)


@pytest.mark.slow
def test_exact_readings_give_exact_parameters(pose_problem):
    true = deviations(pose_problem.units, size=5e-3)
    found = estimate(measure(pose_problem, true))
    # the readings are 1e-4 fine, the last step is below 1e-6 of that
    assert_close(found.deviation, true, rtol=0, atol=1e-10)
    assert found.chi_square() < 1e-8
    place = jax.jit(lambda chain: forward_kinematics(chain, jnp.array([0.4, -1.1])))
    there = place(pose_problem.chain(true))
    assert_close(place(found.chain()), there, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_linear_problem_agrees_with_the_normal_equations(pose_problem):
    # deviations far below the curvature: the estimate is one linear solve
    measured = measure(pose_problem, pose_problem.zero(), jax.random.key(3))
    found = estimate(measured)
    both = eqx.filter_jit(
        lambda p, x: (p.residuals(p.zero(), (None,)), p.jacobian(x, (None,)))
    )
    start, matrix = (np.asarray(x) for x in both(measured, found.deviation))
    covariance = np.linalg.inv(matrix.T @ matrix)
    # condition number of some 10, squared by the inverse
    assert_close(found.covariance, covariance, rtol=1e-9, atol=1e-18)
    linear = -np.linalg.lstsq(matrix, start, rcond=None)[0]
    # deviations of 1e-4 have products of 1e-8
    assert_close(found.deviation, linear, rtol=0, atol=1e-7)
    scaled = matrix / np.linalg.norm(matrix, axis=0)
    assert_close(found.condition, np.linalg.cond(scaled), rtol=1e-9)
    assert_close(np.diagonal(found.correlation()), np.ones(7), rtol=1e-12)
    # known before the measurement, but for the change of the arm by 1e-4
    report = identifiability(pose_problem)
    assert_close(report.expected, found.standard_deviation(), rtol=1e-2)


@pytest.mark.slow
def test_estimate_is_differentiable_by_the_readings(small_problem):
    (nominal,) = small_problem.measurements
    true = measure(small_problem, deviations(small_problem.units), jax.random.key(1))

    def found(readings):
        measured = Measurements(nominal.instrument, nominal.q, readings)
        problem = CalibrationProblem(small_problem.parameters, measured)
        return estimate_parameters(problem, throw=False).deviation

    # the stopping rule leaves 1e-6 of a deviation of 1e-3, divided by the step
    assert_gradient(found, true.measurements[0].readings, rtol=1e-5)


@pytest.mark.slow
def test_jit_and_vmap_agree_with_a_loop(small_problem):
    true = deviations(small_problem.units)
    keys = jax.random.split(jax.random.key(5), 2)
    run = lambda key: estimate_parameters(true_problem(small_problem, true, key))
    together = jax.jit(jax.vmap(run))(keys)
    single = estimate(measure(small_problem, true, keys[1]))
    # both stop within 1e-6 of a standard deviation
    assert_close(together.deviation[1], single.deviation, rtol=0, atol=1e-9)
    assert_close(together.covariance[1], single.covariance, rtol=1e-6, atol=1e-20)


@pytest.mark.slow
def test_prior_shrinks_towards_its_mean(small_problem):
    measured = measure(small_problem, deviations(small_problem.units))
    tight = GaussianPrior(("a_2",), [1e-8], [3e-4])
    problem = CalibrationProblem(measured.parameters, measured.measurements, tight)
    found = estimate(problem)
    place = problem.names.index("a_2")
    assert_close(found.deviation[place], 3e-4, rtol=0, atol=1e-9)
    # the readings say 1e5 times less than the prior
    assert_close(found.standard_deviation()[place], 1e-8, rtol=1e-6)
    assert problem.rows == measured.rows + 1


@pytest.mark.slow
def test_information_of_several_instruments_adds_up(small_problem):
    """Poses of a probe and points of a tracker with noisy encoders, one arm."""
    (points,) = small_problem.measurements
    probe = Measurements.simulated(
        PoseInstrument(2e-3, 1e-3), planar(1.0, 0.7), points.q[:2]
    )
    noisy = Measurements(points.instrument, points.q, points.readings, [1e-3, 2e-3])
    parameters = small_problem.parameters
    found = [
        estimate(CalibrationProblem(parameters, parts))
        for parts in (probe, noisy, (probe, noisy))
    ]
    first, second, both = (np.linalg.inv(each.covariance) for each in found)
    # condition numbers of some hundred
    assert_close(both, first + second, rtol=1e-9, atol=1e-9 * np.max(both))
    exact = estimate(small_problem)
    assert np.all(found[1].standard_deviation() > exact.standard_deviation())


@pytest.mark.slow
def test_start_far_from_the_solution():
    """A base pose that is wrong by half a metre and 30 degrees."""
    names = tuple(f"base_{c}" for c in ("x", "y", "z", "rx", "ry", "rz"))
    q = jnp.array([[0.1, 0.5], [1.0, -0.7], [-0.5, 1.2]])
    problem = problem_of(planar(1.0, 0.7), PoseInstrument(1e-4, 1e-4), q, names)
    true = jnp.array([0.5, -0.4, 0.3, 0.3, -0.4, 0.5])
    found = estimate(measure(problem, true))
    assert_close(found.deviation, true, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_distances_determine_the_arm():
    anchors = np.array([[2.0, 1, 0], [2, -1, 1], [-1, 2, 0.5]])
    instrument = DistanceInstrument(1e-4, anchors, [0.05, 0.0, 0.1])
    q = jnp.array([[0.1, 0.5], [1.0, -0.7], [-0.5, 1.2]])
    names = ("a_1", "a_2", "theta_2", "base_z")
    problem = problem_of(planar(1.0, 0.7), instrument, q, names)
    true = deviations(problem.units, size=2e-3)
    assert_close(estimate(measure(problem, true)).deviation, true, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_wrong_deviations_show_in_the_probability(small_problem):
    measured = measure(small_problem, small_problem.zero(), jax.random.key(4))
    (part,) = measured.measurements
    optimistic = PointInstrument(1e-4)  # a tenth of what it is
    wrong = CalibrationProblem(
        measured.parameters, Measurements(optimistic, part.q, part.readings)
    )
    assert estimate(measured).probability() > 0.01
    found = estimate(wrong)
    assert found.probability() < 1e-6
    corrected = estimate(wrong, noise=NoiseVariance.ESTIMATED)
    freedom = found.degrees_of_freedom
    assert freedom == 6
    factor = np.sqrt(found.chi_square() / freedom)
    ratio = corrected.standard_deviation() / found.standard_deviation()
    assert_close(ratio, np.full(3, factor), rtol=1e-12)
    zero = eqx.tree_at(lambda e: e.covariance, found, jnp.zeros((3, 3)))
    assert_close(zero.correlation(), np.zeros((3, 3)), rtol=0)
    # the normal and Student's t distribution, from tables
    width = lambda found: found.half_width() / found.standard_deviation()
    assert_close(width(found), np.full(3, 1.959964), rtol=1e-6)
    assert_close(width(corrected), np.full(3, 2.446912), rtol=1e-6)


@pytest.mark.slow
def test_solver_that_gives_up_says_so(small_problem):
    measured = measure(small_problem, deviations(small_problem.units, size=0.05))
    found = estimate(measured, max_steps=2, throw=False)
    assert found.result == optx.RESULTS.nonlinear_max_steps_reached
    with pytest.raises(Exception, match="maximum number of steps"):
        estimate(measured, max_steps=2)


@pytest.mark.slow
def test_undetermined_parameter_is_finite(small_problem):
    (nominal,) = small_problem.measurements
    parameters = ChainParameters.of(planar(1.0, 0.7)).select(("a_2", "tool_rx"))
    problem = CalibrationProblem(parameters, nominal)
    found = estimate(problem)
    assert np.all(np.isfinite(found.covariance))
    assert found.deviation[1] == 0.0
    with pytest.raises(ValueError, match="none of tool_rx has an effect"):
        identifiability(problem.select(("tool_rx",)))


def test_refusals(pose_problem):
    (part,) = pose_problem.measurements
    few = Measurements(part.instrument, part.q[:1], part.readings[:1])
    small = CalibrationProblem(pose_problem.parameters, few)
    with pytest.raises(ValueError, match="7 parameters need 7 readings at least.* 6"):
        estimate_parameters(small)
    with pytest.raises(ValueError, match="the prior names .*nothing"):
        CalibrationProblem(
            pose_problem.parameters, part, GaussianPrior(("nothing",), [1.0])
        )
    with pytest.raises(ValueError, match="`q` of the measurements must have 6 columns"):
        CalibrationProblem(ChainParameters.of(heavy()), part)
    with pytest.raises(ValueError, match="`encoders` must name joints from 0 to 1"):
        CalibrationProblem(pose_problem.parameters, part, None, (6,))
    with pytest.raises(ValueError, match="at least one set"):
        CalibrationProblem(pose_problem.parameters, ())
    with pytest.raises(ValueError, match="one `deviation` and one `mean` per name"):
        GaussianPrior(("a_1",), [1.0, 2.0])
    with pytest.raises(ValueError, match="`deviation` of a prior must be positive"):
        GaussianPrior(("a_1",), [0.0])


@pytest.mark.slow
def test_readings_that_are_not_finite_raise_at_run_time(pose_problem):
    (part,) = pose_problem.measurements

    @eqx.filter_jit
    def run(readings):
        measured = Measurements(part.instrument, part.q, readings)
        problem = CalibrationProblem(pose_problem.parameters, measured)
        return estimate_parameters(problem, throw=False).deviation

    with pytest.raises(Exception, match="`readings` must be finite"):
        jax.block_until_ready(run(part.readings.at[2, 0, 3].set(jnp.nan)))


def test_single_precision_is_refused():
    chain = SerialChain.from_dh(*np.zeros((4, 1)))
    with jax.enable_x64(False):
        single = jax.tree.map(lambda x: x.astype(jnp.float32), chain)
        measured = Measurements.simulated(
            PointInstrument(1e-4), single, jnp.zeros((3, 1))
        )
        problem = CalibrationProblem(ChainParameters.of(single), measured)
        with pytest.raises(ValueError, match="needs double precision"):
            calibrate(problem)
