"""Columns that depend on those in front of them."""

import numpy as np
import pytest
from elastax.kinematics import dependent_columns


def test_known_combinations():
    rng = np.random.default_rng(0)
    a, b, c = rng.standard_normal((3, 8))
    found = dependent_columns(np.stack([a, 2 * a, b, 0 * a, c, a - 3 * b], axis=1))
    assert found.independent == (0, 2, 4)
    assert found.dependent == (1, 3, 5)
    expected = np.array([[2.0, 0, 1], [0, 0, -3], [0, 0, 0]])
    np.testing.assert_allclose(found.combination, expected, atol=1e-14)


def test_units_do_not_count():
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((9, 4)) @ rng.standard_normal((4, 6))
    units = np.array([1e-9, 1.0, 1e6, 1e3, 1e-3, 1e9])
    plain, scaled = dependent_columns(matrix), dependent_columns(matrix * units)
    assert plain.independent == scaled.independent == (0, 1, 2, 3)
    np.testing.assert_allclose(plain.condition, scaled.condition, rtol=1e-12)
    back = scaled.combination * units[:4, None] / units[4:]
    # the condition of four random columns is some tens
    np.testing.assert_allclose(back, plain.combination, rtol=1e-12)


def test_tolerance_is_the_share_outside():
    a, b = np.eye(3)[:2]
    matrix = np.stack([a, a + 1e-4 * b], axis=1)
    assert dependent_columns(matrix, 0.9e-4).dependent == ()
    assert dependent_columns(matrix, 1.1e-4).dependent == (1,)
    # two columns at the angle e have the condition 2/e
    condition = dependent_columns(matrix).condition
    np.testing.assert_allclose(condition, 2e4, rtol=1e-7)


def test_limits():
    found = dependent_columns(np.zeros((3, 2)))
    assert (found.independent, found.dependent) == ((), (0, 1))
    assert found.combination.shape == (0, 2) and found.condition == 0.0
    found = dependent_columns(np.eye(3))
    assert found.dependent == () and found.combination.shape == (3, 0)
    assert dependent_columns(np.zeros((3, 0))).independent == ()
    with pytest.raises(ValueError, match="finite"):
        dependent_columns(np.array([[np.nan, 1.0]]))
