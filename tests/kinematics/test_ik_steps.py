"""Corrections of iterative inverses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ConstantDamping,
    DampedStep,
    ErrorDampedStep,
    PseudoInverseStep,
    RestPostureStep,
    damped_least_squares,
    jacobian,
    limit_step,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import planar


NO_POSTURE = jnp.zeros(2)


def test_published_inverse():
    """Two-joint arm; the text prints l1 c12 instead of l2 c12 in the second row."""
    case = load_vectors("004 J^-1")[0]
    given, expected = case["inputs"], case["outputs"]
    chain = planar(given["l1"], given["l2"])
    matrix = jacobian(chain, jnp.array(given["theta"]))[:2]
    assert_close(matrix, expected["J"], rtol=case["tol"])
    step = PseudoInverseStep()
    inverse = jax.vmap(lambda e: step(matrix, e, NO_POSTURE), out_axes=1)(jnp.eye(2))
    assert_close(inverse, expected["Jinv"], rtol=case["tol"])
    wrong = np.abs(inverse - np.array(expected["Jinv_printed_wrong"]))
    assert wrong[1].min() > 0.1


def test_published_over_determined():
    case = load_vectors("004 pseudo-inverse overdetermined")[0]
    matrix, error = (jnp.array(case["inputs"][k]) for k in ("J", "b"))
    found = PseudoInverseStep()(matrix, error, NO_POSTURE)
    assert_close(found, case["outputs"]["x"], rtol=case["tol"])


def test_published_redundant():
    """[Reiner2010] (3.60) is the rest posture's step with nothing to prefer."""
    case = load_vectors("004 Lagrange")[0]
    matrix, error, weights, wish = (
        jnp.array(case["inputs"][k]) for k in ("J", "b", "w", "pref")
    )
    q = jnp.array([0.3, -0.2, 0.5])
    found = PseudoInverseStep()(matrix, error, q)
    assert_close(found, case["outputs"]["min_norm"], rtol=case["tol"])
    step = RestPostureStep(rest=q + wish / 0.5, weights=weights, share=0.5)
    assert_close(step(matrix, error, q), case["outputs"]["x"], rtol=case["tol"])


@pytest.mark.slow
def test_damped_steps_are_damped_least_squares():
    rng = np.random.default_rng(2)
    matrix, error = jnp.asarray(rng.standard_normal((4, 6))), jnp.arange(1.0, 5.0)
    expected = damped_least_squares(matrix, error, jnp.array(0.3))
    constant = DampedStep(ConstantDamping(0.3))(matrix, error, jnp.zeros(6))
    assert_close(constant, expected, rtol=1e-14)  # the same operations
    gain = 0.09 / (error @ error)
    by_error = ErrorDampedStep(gain)(matrix, error, jnp.zeros(6))
    # the smallest damping adds 1e-11 to its square of 0.09
    assert_close(by_error, expected, rtol=1e-9)


@pytest.mark.parametrize("step", [PseudoInverseStep(), ErrorDampedStep()])
def test_singular_posture(step):
    """Along the stretched arm no joint moves the tool; across it both do."""
    matrix = jacobian(planar(1.0, 1.0), jnp.zeros(2))[:2]
    along = step(matrix, jnp.array([1e-3, 0.0]), NO_POSTURE)
    assert_close(along, jnp.zeros(2), rtol=0.0, atol=1e-12)  # rounding
    across = step(matrix, jnp.array([0.0, 1e-3]), NO_POSTURE)
    # minimum norm; the damping's square of 1e-8 shows over the singular value's of 5
    assert_close(across, 1e-3 * jnp.array([0.4, 0.2]), rtol=1e-8)
    nothing = step(0 * matrix, jnp.array([0.0, 1e-3]), NO_POSTURE)
    assert_close(nothing, jnp.zeros(2), rtol=0.0)


def test_step_limit_keeps_the_direction():
    step = jnp.array([0.1, -0.6, 0.3])
    assert_close(limit_step(step, jnp.array(0.2)), step / 3, rtol=1e-15)  # rounding
    each = jnp.array([0.05, 0.6, 0.6])
    assert_close(limit_step(step, each), step / 2, rtol=1e-15)  # rounding
    assert_close(limit_step(step, jnp.array(0.6)), step, rtol=0.0)
    assert_close(limit_step(0 * step, jnp.array(0.1)), 0 * step, rtol=0.0)


@pytest.mark.slow
def test_gradient():
    rng = np.random.default_rng(1)
    matrix, error = jnp.asarray(rng.standard_normal((3, 4))), jnp.arange(1.0, 4.0)
    q = jnp.array([0.1, -0.3, 0.2, 0.4])
    steps = (
        PseudoInverseStep(),
        DampedStep(ConstantDamping(0.2)),
        ErrorDampedStep(),
        RestPostureStep(jnp.ones(4), jnp.arange(1.0, 5.0)),
    )
    assert_gradient(
        lambda *a: [limit_step(step(*a), jnp.array(0.2)) for step in steps],
        matrix,
        error,
        q,
    )


@pytest.mark.parametrize(
    ("build", "what"),
    [
        (lambda: PseudoInverseStep(2.0), "cutoff"),
        (lambda: ErrorDampedStep(0.0), "gain"),
        (lambda: RestPostureStep(np.zeros(2), np.array([1.0, 0.0])), "weights"),
        (lambda: RestPostureStep(np.zeros(2), np.ones(3)), "shape"),
        (lambda: RestPostureStep(np.zeros(2), np.ones(2), 1.5), "share"),
    ],
)
def test_refusals(build, what):
    with pytest.raises(ValueError, match=what):
        build()
