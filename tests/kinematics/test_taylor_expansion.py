"""Taylor polynomials of poses and bounds of what they leave out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ElementaryProduct,
    elementary_chain,
    elementary_pose,
    multi_indices,
    pose_derivative,
    pose_differentials,
    taylor_majorant,
    taylor_polynomials,
    taylor_remainder,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, planar
from tests.kinematics.test_pose_derivatives import rpy_elements, small


def moved(factors, deviation):
    return ElementaryProduct(
        factors.values + deviation,
        factors.directions,
        factors.constants,
        factors.places,
    )


def test_published_polynomials():
    case = load_vectors("003 (3-35)/(3-37)")[0]
    factors = ElementaryProduct.of(rpy_elements("D", case["inputs"]["Theta0"]))
    places = np.array([factors.index(f"D_{c}") for c in "xyz"])
    deviation = jnp.zeros(3).at[places].set(jnp.array(case["inputs"]["h"]))
    polynomials = taylor_polynomials(factors, deviation, 3)
    for order in (1, 2, 3):
        expected = case["outputs"][f"P{order}"]
        assert_close(polynomials[order, :3, :3], expected, rtol=case["tol"])
    exact = elementary_pose(moved(factors, deviation))
    assert_close(exact[:3, :3], case["outputs"]["exact"], rtol=case["tol"])


@pytest.mark.parametrize("order", [1, 2, 3])
def test_differentials_are_multinomial_sums(order):
    """(3-35.2) by truncated Taylor arithmetic, and the sum (3-36)."""
    factors, q = small(), jnp.array([0.3, -0.2])
    deviation = jnp.array([0.3, -0.2, 0.5, 0.1, -0.4])
    indices = multi_indices(factors.number, order)
    every = jax.jit(jax.vmap(pose_derivative, (None, 0, None)))
    derivatives = every(factors, jnp.asarray(indices.orders), q)
    powers = np.prod(np.asarray(deviation) ** indices.orders, axis=1)
    expected = jnp.einsum("t,tab->ab", indices.coefficients * powers, derivatives)
    actual = pose_differentials(factors, deviation, 3, q)
    assert_close(actual[order], expected, rtol=0, atol=1e-15)
    assert not np.any(actual[1:, 3])


@pytest.fixture(scope="module")
def arm():
    """Fanuc arm; degrees and millimetres of deviation, of 200 samples."""
    factors = elementary_chain(fanuc(1e-3))
    rng = np.random.default_rng(8)
    q = jnp.asarray(rng.uniform(-1.5, 1.5, (200, 6)))
    units = np.where(np.array(factors.units) == "m", 1e-3, np.deg2rad(1.0))
    deviations = jnp.asarray(rng.uniform(-1, 1, (200, factors.number)) * units)
    return factors, deviations, jnp.asarray(units), q


@pytest.mark.slow
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bounds_hold_and_are_not_loose(arm, order):
    factors, deviations, sizes, q = arm

    @jax.jit
    @jax.vmap
    def evaluate(deviation, q):
        exact = elementary_pose(moved(factors, deviation), q)
        actual = exact - taylor_polynomials(factors, deviation, order, q)[order]
        remainder = taylor_remainder(factors, deviation, order, q)
        majorant = taylor_majorant(factors, sizes, order, q)
        return jnp.abs(actual), remainder.estimate, remainder.bound, majorant

    actual, estimate, bound, majorant = evaluate(deviations, q)
    rounding = 1e-15  # of sums of matrices and lengths of order one
    assert np.all(actual <= bound + rounding)
    # a bound for the whole box bounds what is bound for one deviation
    assert np.all(bound <= majorant + rounding)
    for block, name in ((np.s_[:, :3, :3], "rotation"), (np.s_[:, :3, 3], "position")):
        largest = np.max(actual[block], axis=tuple(range(1, actual[block].ndim)))
        bounds = np.max(bound[block], axis=tuple(range(1, bound[block].ndim)))
        ratios = bounds / largest
        # three terms are summed; those behind them, if all adds up, are some per cent
        assert np.max(ratios) < 1.05, f"{name}: bound/actual up to {np.max(ratios):.2f}"
        guess = np.max(estimate[block], axis=tuple(range(1, bound[block].ndim)))
        assert np.all(guess > 0.9 * largest), f"{name}: estimate/actual too small"


@pytest.mark.slow
def test_majorant_is_met_by_parallel_axes():
    """A stretched planar arm whose deviations add up: all norms are attained."""
    factors = elementary_chain(planar(0.5, 0.3, 0.2), base=False, tool=False)
    about = np.array(factors.units) == "rad"
    # only the joints move, by the same sign
    carried = np.isin(np.arange(factors.number), factors.joint_variables)
    deviation = jnp.where(jnp.asarray(about & carried), 1e-4, 0.0)
    exact = elementary_pose(moved(factors, deviation))
    for order in (0, 1):
        rest = exact - taylor_polynomials(factors, deviation, order)[order]
        majorant = taylor_majorant(factors, deviation, order)
        # the next term but for its own next one, 1e-4 of it or less
        assert_close(jnp.max(jnp.abs(rest[:3, :3])), majorant[0, 0], rtol=1e-4)
        assert_close(jnp.max(jnp.abs(rest[:3, 3])), majorant[0, 3], rtol=1e-4)


def test_remainder_has_its_order(arm):
    """Half the deviation leaves an eighth of the remainder of the second order."""
    factors, deviations, _, q = arm

    @jax.jit
    def rest(deviation, q):
        exact = elementary_pose(moved(factors, deviation), q)
        return exact - taylor_polynomials(factors, deviation, 2, q)[2]

    whole, half = (jnp.max(jnp.abs(rest(s * deviations[0], q[0]))) for s in (1, 0.5))
    # the next order adds some per cent
    assert_close(whole / half, 8.0, rtol=0.1)


@pytest.mark.slow
def test_gradients_and_batches():
    factors, q = small(), jnp.array([0.3, -0.2])
    deviation = jnp.array([0.03, -0.02, 0.05, 0.01, -0.04])
    polynomial = lambda f, h, q: taylor_polynomials(f, h, 3, q)
    assert_gradient(polynomial, factors, deviation, q)
    batch = jnp.stack([deviation, 2 * deviation, -deviation])
    mapped = jax.jit(jax.vmap(polynomial, (None, 0, None)))(factors, batch, q)
    loop = jnp.stack([polynomial(factors, h, q) for h in batch])
    assert_close(mapped, loop, rtol=0, atol=1e-15)
    # no deviation: nothing is left out, and the bound has finite derivatives
    zero = jnp.zeros(5)
    assert not np.any(taylor_majorant(factors, zero, 2, q))
    slope = jax.jit(jax.jacrev(lambda h: taylor_majorant(factors, h, 2, q)))(zero)
    assert np.all(np.isfinite(slope))


def test_refusal():
    with pytest.raises(ValueError, match="`order` must not be negative"):
        pose_differentials(small(), jnp.zeros(5), -1)
