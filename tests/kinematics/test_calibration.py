"""Calibration: dependent parameters, nearly parallel axes, the report."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    CalibrationProblem,
    PointInstrument,
    PoseInstrument,
    calibrate,
    forward_kinematics,
    identifiability,
)

from ..helpers import assert_close
from .arms import planar
from .calibration_arms import (
    deviations,
    estimate,
    heavy,
    heavy_hayati,
    measure,
    poses,
    problem_of,
)


def reduced(problem):
    return problem.select(identifiability(problem).identifiable)


@pytest.fixture(scope="module")
def small_problem():
    """Lengths and an angle of a planar arm from its tool's position."""
    q = jnp.array([[0.1, 0.5], [1.0, -0.7], [-0.5, 1.2]])
    names = ("a_1", "a_2", "theta_2")
    return problem_of(planar(1.0, 0.7), PointInstrument(1e-3), q, names)


@pytest.mark.slow
def test_encoder_offset_is_the_angle_of_its_joint(small_problem):
    (nominal,) = small_problem.measurements
    parameters = small_problem.parameters.select(("theta_2", "a_2"))
    problem = CalibrationProblem(parameters, nominal, None, (1,))
    report = identifiability(problem)
    assert problem.names == ("theta_2", "a_2", "encoder_2")
    assert report.dependent == ("encoder_2",)
    assert report.combinations() == {"encoder_2": "acts like 1 theta_2"}
    turned = measure(problem, jnp.array([2e-3, 1e-3, 0.0]))
    offset = problem.select(("a_2", "encoder_2"))
    measured = CalibrationProblem(offset.parameters, turned.measurements, None, (1,))
    with pytest.raises(ValueError, match=r"no unknowns \['encoder_1'\]"):
        problem.select(("encoder_1",))
    found = estimate(measured)
    assert_close(found.deviation, [1e-3, 2e-3], rtol=0, atol=1e-9)
    assert_close(found.encoder_offset(), [0, 2e-3], rtol=0, atol=1e-9)


@pytest.mark.slow
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
    # by another route
    matrix = eqx.filter_jit(lambda p: p.jacobian(p.zero(), (None,)))(problem)
    lengths = np.linalg.norm(matrix, axis=0)
    scaled = np.asarray(matrix) / np.where(lengths > 1e-6, lengths, np.inf)
    assert len(report.identifiable) == np.linalg.matrix_rank(scaled, tol=1e-7)
    text = found.table()
    for name in report.identifiable:
        assert f"\n{name} " in text
    assert "held at its nominal value: d_3, acts like 1 d_2" in text
    assert "chi-square 0.0 at " in text


@pytest.fixture(scope="module")
def nearly_parallel():
    """Readings of an arm whose axes 2 and 3 differ by 0.01 degrees, in two models."""
    instrument, q = PoseInstrument(5e-5, 1e-4), poses(30)
    dh = reduced(problem_of(heavy(alpha_2=np.radians(0.01)), instrument, q))
    hayati = reduced(problem_of(heavy_hayati(), instrument, q))
    true = deviations(dh.units, size=1e-4).at[dh.names.index("alpha_2")].set(0.0)
    readings = measure(dh, true, jax.random.key(2)).measurements
    return dh.chain(true), *(
        CalibrationProblem(problem.parameters, readings) for problem in (dh, hayati)
    )


@pytest.mark.slow
def test_nearly_parallel_axes(nearly_parallel):
    """DH parameters of nearly parallel axes are ill-conditioned, Hayati's are not."""
    arm, dh, hayati = nearly_parallel
    report = identifiability(dh)
    # moving d_2 against d_3 shifts the arm by the angle of 1.7e-4, which turning axes 2
    # and 3 undoes: the square of the angle, 3e-8, is what is left
    assert "d_2" in report.identifiable and "d_3" in report.identifiable
    assert not report.reliable and report.condition > 1e6
    worst = report.weakest_combination()
    assert "d_2" in worst and "d_3" in worst
    # some 20 um over 3e-8 are hundreds of metres
    assert report.expected[report.identifiable.index("d_3")] > 100.0
    found = calibrate(hayati)
    assert "beta_2" in hayati.names and "d_2" not in hayati.names
    assert found.identifiability.reliable and found.identifiability.condition < 100
    assert "beyond 100" not in found.table()
    # all within ten times what a single reading is good for
    assert np.max(found.estimate.standard_deviation()) < 5e-4
    # the same data, fitted to within their noise, and an arm that is right elsewhere
    assert found.estimate.probability() > 1e-3
    there = poses(20, seed=11)
    place = jax.jit(
        lambda chain: jax.vmap(lambda x: forward_kinematics(chain, x)[:3, 3])(there)
    )
    # 30 poses of 50 um leave some 30 um
    assert np.max(np.abs(place(found.chain()) - place(arm))) < 1.5e-4


@pytest.mark.slow
def test_ill_conditioned_estimate_says_so(nearly_parallel):
    _, dh, _ = nearly_parallel
    text = calibrate(dh, throw=False).table()
    assert "beyond 100" in text and "determined worst: " in text
