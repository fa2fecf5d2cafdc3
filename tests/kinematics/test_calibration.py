"""Calibration: coverage, dependent parameters, nearly parallel axes, refusals."""

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
)

from ..helpers import assert_close, assert_gradient
from .arms import planar
from .calibration_arms import (
    deviations,
    heavy,
    heavy_hayati,
    poses,
)


def problem_of(chain, instrument, q, names=None, joint_deviation=None, **options):
    """Problem with readings of the nominal arm."""
    parameters = ChainParameters.of(chain)
    if names is not None:
        parameters = parameters.select(names)
    measured = Measurements.simulated(
        instrument, chain, q, joint_deviation=joint_deviation
    )
    return CalibrationProblem(parameters, measured, **options)


def true_problem(problem, x, key=None):
    """The problem with readings of the arm that deviates by x."""
    (nominal,) = problem.measurements
    measured = Measurements.simulated(
        nominal.instrument, problem.chain(x), nominal.q, key, nominal.joint_deviation
    )
    return CalibrationProblem(
        problem.parameters, measured, problem.prior, problem.encoders
    )


def reduced(problem):
    return problem.select(identifiability(problem).identifiable)


@pytest.fixture(scope="module")
def pose_problem():
    """Some parameters of the heavy arm from full poses."""
    names = ("theta_2", "a_2", "alpha_3", "d_4", "base_x", "base_ry", "tool_z")
    return problem_of(heavy(), PoseInstrument(1e-4, 1e-4), poses(8), names)


def test_exact_readings_give_exact_parameters(pose_problem):
    true = deviations(pose_problem.units, size=5e-3)
    found = estimate_parameters(true_problem(pose_problem, true))
    # the readings are 1e-4 fine, and the last step is below 1e-7 of that
    assert_close(found.deviation, true, rtol=0, atol=1e-10)
    assert found.chi_square() < 1e-8
    q = poses(1, seed=9)[0]
    assert_close(
        forward_kinematics(found.chain(), q),
        forward_kinematics(pose_problem.chain(true), q),
        rtol=0,
        atol=1e-9,
    )


def test_linear_problem_agrees_with_the_normal_equations(pose_problem):
    # deviations far below the curvature: the estimate is one linear solve
    measured = true_problem(pose_problem, pose_problem.zero(), jax.random.key(3))
    found = estimate_parameters(measured)
    matrix = np.asarray(measured.jacobian(found.deviation, measured.whitening()))
    covariance = np.linalg.inv(matrix.T @ matrix)
    # condition number of some 10, squared by the inverse
    assert_close(found.covariance, covariance, rtol=1e-9, atol=1e-18)
    start = np.asarray(measured.residuals(measured.zero(), measured.whitening()))
    linear = -np.linalg.lstsq(matrix, start, rcond=None)[0]
    # deviations of 1e-4 have products of 1e-8
    assert_close(found.deviation, linear, rtol=0, atol=1e-7)
    scaled = matrix / np.linalg.norm(matrix, axis=0)
    assert_close(found.condition, np.linalg.cond(scaled), rtol=1e-9)
    assert_close(np.diagonal(found.correlation()), np.ones(7), rtol=1e-12)


def test_estimate_is_differentiable_by_the_readings():
    problem = problem_of(
        planar(1.0, 0.7), PointInstrument(1e-3), jnp.array([[0.1, 0.5], [1, -0.7]]),
        ("a_1", "a_2", "theta_2"),
    )  # fmt: skip
    (nominal,) = problem.measurements
    true = true_problem(problem, deviations(problem.units), jax.random.key(1))

    def found(readings):
        measured = Measurements(nominal.instrument, nominal.q, readings)
        new = CalibrationProblem(problem.parameters, measured)
        return estimate_parameters(new, throw=False).deviation

    # the stopping rule leaves 1e-7 of a deviation of 1e-3, divided by the step
    assert_gradient(found, true.measurements[0].readings, rtol=1e-5)


def test_jit_and_vmap_agree_with_a_loop(pose_problem):
    true = deviations(pose_problem.units)
    keys = jax.random.split(jax.random.key(5), 2)
    run = lambda key: estimate_parameters(true_problem(pose_problem, true, key))
    together = jax.jit(jax.vmap(run))(keys)
    single = run(keys[1])
    # both stop within 1e-7 of a standard deviation
    assert_close(together.deviation[1], single.deviation, rtol=0, atol=1e-11)
    assert_close(together.covariance[1], single.covariance, rtol=1e-6, atol=1e-20)


def test_prior_shrinks_towards_its_mean(pose_problem):
    measured = true_problem(pose_problem, deviations(pose_problem.units))
    tight = GaussianPrior(("a_2",), [1e-9], [3e-4])
    problem = CalibrationProblem(measured.parameters, measured.measurements, tight)
    found = estimate_parameters(problem, throw=True)
    place = problem.names.index("a_2")
    assert_close(found.deviation[place], 3e-4, rtol=0, atol=1e-9)
    # the readings say 1e5 times less than the prior
    assert_close(found.standard_deviation()[place], 1e-9, rtol=1e-6)
    assert problem.rows == measured.rows + 1


# ----------------------------------------------------------------- dependent parameters


def test_encoder_offset_is_the_angle_of_its_joint():
    problem = problem_of(
        heavy(), PoseInstrument(1e-4, 1e-4), poses(6), ("theta_3", "a_3"), encoders=(2,)
    )
    report = identifiability(problem)
    assert problem.names == ("theta_3", "a_3", "encoder_3")
    assert report.dependent == ("encoder_3",)
    assert report.combinations() == {"encoder_3": "acts like 1 theta_3"}
    offset = problem.select(("a_3", "encoder_3"))
    true = true_problem(problem, jnp.array([2e-3, 1e-3, 0.0]))
    measured = CalibrationProblem(
        offset.parameters, true.measurements, None, offset.encoders
    )
    found = estimate_parameters(measured)
    assert_close(found.deviation, [1e-3, 2e-3], rtol=0, atol=1e-10)
    assert_close(found.encoder_offset(), [0, 0, 2e-3, 0, 0, 0], rtol=0, atol=1e-10)


def test_dependent_parameters_are_named_and_left_out():
    # one point at the tool's origin, all parameters
    problem = problem_of(heavy(), PointInstrument(5e-5), poses(30))
    with pytest.raises(ValueError, match=r"d_3 acts like 1 d_2.*exclude_dependent"):
        calibrate(problem)
    found = calibrate(problem, exclude_dependent=True)
    report = found.identifiability
    words = report.combinations()
    # parallel axes; base and first axis; rotations of the tool, which has one point
    assert words["d_3"] == "acts like 1 d_2"
    assert words["base_z"] == "acts like 1 d_1"
    assert words["base_rz"] == "acts like 1 theta_1"
    for name in ("tool_rx", "tool_ry", "tool_rz"):
        assert words[name] == "has no effect on the readings"
    assert set(report.identifiable) | set(report.dependent) == set(problem.names)
    # by theory: 4 per revolute joint, 6 of the base, 3 of the tool point, less d_3 and
    # 2 of the base and 3 of the last joint that the others stand for: rank of the
    # Jacobian by another route
    matrix = np.asarray(problem.jacobian(problem.zero(), problem.whitening()))
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    assert len(report.identifiable) == np.linalg.matrix_rank(scaled, tol=1e-7)
    text = found.table()
    for name in report.identifiable:
        assert f"\n{name} " in text
    assert "held at its nominal value: d_3, acts like 1 d_2" in text
    assert "chi-square 0.0 at " in text


def test_nearly_parallel_axes():
    """DH parameters of nearly parallel axes are ill-conditioned, Hayati's are not."""
    instrument, q = PoseInstrument(5e-5, 1e-4), poses(30)
    dh = reduced(problem_of(heavy(alpha_2=np.radians(0.01)), instrument, q))
    hayati = reduced(problem_of(heavy_hayati(), instrument, q))
    true = deviations(dh.units, size=1e-4).at[dh.names.index("alpha_2")].set(0.0)
    readings = true_problem(dh, true, jax.random.key(2)).measurements
    assert "d_3" in dh.names and "beta_2" in hayati.names
    estimates = {}
    for name, problem in (("dh", dh), ("hayati", hayati)):
        measured = CalibrationProblem(problem.parameters, readings)
        estimates[name] = calibrate(measured)
    ill, well = estimates["dh"], estimates["hayati"]
    # the offsets d_2 and d_3 differ in their effect by the angle of 1.7e-4 only
    assert not ill.identifiability.reliable
    assert ill.identifiability.condition > 1e3
    worst = ill.identifiability.weakest_combination()
    assert "d_2" in worst and "d_3" in worst
    assert "beyond 100" in ill.table() and "beyond 100" not in well.table()
    assert well.identifiability.condition < 100
    deviation = lambda c, n: c.estimate.standard_deviation()[
        c.estimate.problem.names.index(n)
    ]
    # 50 um over some ten effective readings and 1.7e-4 are 0.1 m, against 0.1 mm
    assert deviation(ill, "d_3") > 0.02
    assert np.max(well.estimate.standard_deviation()) < 5e-4
    # the same data, fitted to within their noise, and an arm that is right elsewhere
    assert well.estimate.probability() > 1e-3
    there = poses(20, seed=11)
    arm = dh.chain(true)
    place = lambda chain: jax.vmap(lambda x: forward_kinematics(chain, x)[:3, 3])(there)
    # 30 poses of 50 um leave some 30 um
    assert np.max(np.abs(place(well.chain()) - place(arm))) < 1.5e-4


def test_distances_determine_the_arm():
    anchors = np.array([[2.0, 1, 0], [2, -1, 1], [-1, 2, 0.5], [0, 0, 3]])
    instrument = DistanceInstrument(1e-5, anchors, [0.05, 0.0, 0.1])
    problem = problem_of(heavy(), instrument, poses(12), ("theta_2", "a_2", "base_y"))
    true = deviations(problem.units, size=2e-3)
    found = estimate_parameters(true_problem(problem, true))
    assert_close(found.deviation, true, rtol=0, atol=1e-10)


# ---------------------------------------------------------------- reports, refusals


def test_wrong_deviations_show_in_the_probability(pose_problem):
    measured = true_problem(pose_problem, pose_problem.zero(), jax.random.key(4))
    (part,) = measured.measurements
    optimistic = PoseInstrument(5e-5, 5e-5)  # half of what it is
    wrong = CalibrationProblem(
        measured.parameters, Measurements(optimistic, part.q, part.readings)
    )
    assert estimate_parameters(measured).probability() > 0.01
    found = estimate_parameters(wrong)
    assert found.probability() < 1e-6
    corrected = estimate_parameters(wrong, noise=NoiseVariance.ESTIMATED)
    ratio = corrected.standard_deviation() / found.standard_deviation()
    # chi-square over 41 degrees of freedom scatters by 22 %, its root by 11 %
    assert_close(ratio, np.full(7, 2.0), rtol=0.4)
    # Student's t is wider than the normal distribution
    factor = corrected.half_width() / corrected.standard_deviation()
    assert_close(factor, np.full(7, 2.0195), rtol=1e-4)  # table, 41 degrees
    assert_close(
        found.half_width() / found.standard_deviation(),
        np.full(7, 1.959964),
        rtol=1e-6,
    )


def test_solver_that_gives_up_says_so(pose_problem):
    measured = true_problem(pose_problem, deviations(pose_problem.units, size=0.05))
    found = estimate_parameters(measured, max_steps=2, throw=False)
    assert found.result == optx.RESULTS.nonlinear_max_steps_reached
    with pytest.raises(Exception, match="maximum number of steps"):
        estimate_parameters(measured, max_steps=2)


def test_undetermined_parameter_is_finite(pose_problem):
    problem = problem_of(heavy(), PointInstrument(1e-4), poses(8), ("a_2", "tool_rx"))
    found = estimate_parameters(problem)
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
    with pytest.raises(ValueError, match="`q` of the measurements must have 2 columns"):
        CalibrationProblem(ChainParameters.of(planar(1.0, 1.0)), part)
    with pytest.raises(ValueError, match="`encoders` must name joints from 0 to 5"):
        CalibrationProblem(pose_problem.parameters, part, None, (6,))
    with pytest.raises(ValueError, match="at least one set"):
        CalibrationProblem(pose_problem.parameters, ())
    with pytest.raises(ValueError, match="one `deviation` and one `mean` per name"):
        GaussianPrior(("a_1",), [1.0, 2.0])
    with pytest.raises(ValueError, match="`deviation` of a prior must be positive"):
        GaussianPrior(("a_1",), [0.0])


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
        problem = None
        single = jax.tree.map(lambda x: x.astype(jnp.float32), chain)
        measured = Measurements.simulated(
            PointInstrument(1e-4), single, jnp.zeros((3, 1))
        )
        problem = CalibrationProblem(ChainParameters.of(single), measured)
        with pytest.raises(ValueError, match="needs double precision"):
            calibrate(problem)
