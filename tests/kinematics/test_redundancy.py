"""Redundant corrections: hard and soft conditions."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import hard_and_soft, weighted_correction

from tests.helpers import assert_close, assert_gradient, load_vectors


def published():
    case = load_vectors("004 Lagrange")[0]
    inputs = {k: jnp.array(v) for k, v in case["inputs"].items()}
    return inputs, case["outputs"], case["tol"]


def test_published_multipliers():
    """[Berns] "Lagrange-Multiplikatoren" with A = sqrt(W) and q = A times the wish."""
    given, expected, tol = published()
    root = jnp.sqrt(given["w"])
    x, multipliers = hard_and_soft(
        given["J"], given["b"], jnp.diag(root), root * given["pref"]
    )
    assert_close(x, expected["x"], rtol=tol)
    assert_close(multipliers, expected["lam"], rtol=tol)


def test_published_closed_form():
    given, expected, tol = published()
    x = weighted_correction(given["J"], given["b"], given["w"], given["pref"])
    assert_close(x, expected["x"], rtol=tol)
    same = jnp.ones(3)
    smallest = weighted_correction(given["J"], given["b"], same, 0 * same)
    assert_close(smallest, expected["min_norm"], rtol=tol)


def test_two_joints_share_a_distance():
    """The weights cross: the heavier joint moves less."""
    case = load_vectors("004 singular configuration")[0]
    given, expected = case["inputs"], case["outputs"]
    weights = jnp.array([given["a"], given["b"]])
    x = weighted_correction(
        jnp.ones((1, 2)), jnp.array([given["D"]]), weights, jnp.zeros(2)
    )
    assert_close(x, [expected["d1"], expected["d2"]], rtol=case["tol"])


def test_dependent_rows_stay_finite():
    """The same condition twice, with values that contradict each other."""
    rows, values = jnp.ones((2, 3)), jnp.array([1.0, 2.0])
    weights = jnp.array([1.0, 2.0, 4.0])
    x = weighted_correction(rows, values, weights, jnp.zeros(3))
    # the mean of both, shared in proportion to 1/w  # algebra
    assert_close(x, 1.5 * np.array([4.0, 2.0, 1.0]) / 7, rtol=1e-12)
    x, multipliers = hard_and_soft(rows, jnp.ones(2), jnp.eye(3), jnp.zeros(3))
    assert_close(x, jnp.ones(3) / 3, rtol=1e-12)  # algebra
    assert_close(multipliers[0], multipliers[1], rtol=1e-12)  # of smallest norm


@pytest.mark.slow
def test_gradient():
    given, _, _ = published()
    assert_gradient(
        lambda g: (
            weighted_correction(g["J"], g["b"], g["w"], g["pref"]),
            hard_and_soft(g["J"], g["b"], jnp.diag(g["w"]), g["pref"]),
        ),
        given,
    )
