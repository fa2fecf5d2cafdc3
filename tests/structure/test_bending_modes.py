"""Eigenmodes of beams and bars: characteristic equations, orthogonality, limits."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.structure import (
    ClampedFree,
    FreeFree,
    SupportedFree,
    bar_modes,
    bending_modes,
)

from tests.helpers import assert_close, assert_gradient


SUPPORTS = (ClampedFree(), SupportedFree(), FreeFree())
modes_of = eqx.filter_jit(
    lambda support, *values: bending_modes(
        *values[:3],
        30,
        support=support,
        rotary_inertia=values[3],
        tip_mass=values[4],
        tip_inertia=values[5],
    )
)


def unit_modes(support, rotary=0.0, mass=0.0, inertia=0.0):
    """Thirty modes of a beam of unit stiffness, mass and length."""
    return modes_of(support, *map(jnp.array, (1.0, 1.0, 1.0, rotary, mass, inertia)))


def hyperbolic(beta):
    """Cosine and sine hyperbolic over e^beta / 2."""
    decay = np.exp(-2.0 * beta)
    return 1.0 + decay, 1.0 - decay


# Characteristic equations of the textbook over cosh or sinh, zero at the roots.
CHARACTERISTIC = {
    ClampedFree: lambda b: np.cos(b) + 1.0 / np.cosh(b),
    SupportedFree: lambda b: np.sin(b) - np.cos(b) * np.tanh(b),
    FreeFree: lambda b: np.cos(b) - 1.0 / np.cosh(b),
}
FIRST = {
    ClampedFree: [1.875104068711961, 4.694091132974175, 7.854757438237613],
    SupportedFree: [3.926602312047919, 7.068582745628732, 10.210176122813031],
    FreeFree: [4.730040744862704, 7.853204624095838, 10.995607838001671],
}


@pytest.mark.parametrize("support", SUPPORTS, ids=lambda s: type(s).__name__)
def test_roots_of_the_characteristic_equation(support):
    beta = np.sqrt(np.asarray(unit_modes(support).frequencies))
    # the residual is the error of the root; 1e-8 is asked for, rounding is 1e-14
    assert np.max(np.abs(CHARACTERISTIC[type(support)](beta))) < 1e-12
    assert_close(beta[:3], FIRST[type(support)], rtol=1e-14)
    # one root to every half wave: none is missing
    assert np.all(np.abs(np.diff(beta)[1:] - np.pi) < 0.03)


@pytest.mark.parametrize("ratio", [0.0, 0.25, 1.0, 10.0])
def test_cantilever_with_a_tip_mass(ratio):
    beta = np.sqrt(np.asarray(unit_modes(ClampedFree(), mass=ratio).frequencies))
    cosh, sinh = hyperbolic(beta)
    # 1 + cos cosh + mu b (cos sinh - sin cosh) = 0, over e^b / 2
    balance = 2.0 * np.exp(-beta) + np.cos(beta) * cosh
    balance = balance + ratio * beta * (np.cos(beta) * sinh - np.sin(beta) * cosh)
    assert np.max(np.abs(balance / (1.0 + ratio * beta))) < 1e-12


def test_supported_beam_with_a_tip_mass():
    # sin cosh - cos sinh - 2 mu b sin sinh = 0: moment-free base and end
    ratio = 0.5
    modes = unit_modes(SupportedFree(), mass=ratio)
    beta = np.sqrt(np.asarray(modes.frequencies))
    cosh, sinh = hyperbolic(beta)
    balance = np.sin(beta) * cosh - np.cos(beta) * sinh
    balance = balance + 2.0 * ratio * beta * np.sin(beta) * sinh
    assert np.max(np.abs(balance / (1.0 + 2.0 * ratio * beta))) < 1e-12


CASES = [
    (ClampedFree(), 0.0, 0.0, 0.0),
    (ClampedFree(), 1e-3, 0.5, 0.02),
    (SupportedFree(), 1e-2, 0.0, 0.0),
    (SupportedFree(), 0.0, 1.0, 0.3),
    (FreeFree(), 0.0, 0.0, 0.0),
    (FreeFree(), 1e-3, 0.5, 0.02),
]


@pytest.mark.parametrize("case", CASES)
def test_modes_are_orthonormal(case):
    support, rotary, mass, inertia = case
    modes = unit_modes(*case)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    x, end = jnp.asarray(0.5 * (nodes + 1.0)), jnp.ones(1)
    product = lambda a, b: (np.asarray(a) * 0.5 * weights) @ np.asarray(b).T
    value, slope, bend = modes.value(x), modes.slope(x), modes.curvature(x)
    tip, turn = np.asarray(modes.value(end)), np.asarray(modes.slope(end))
    total = product(value, value) + rotary * product(slope, slope)
    total = total + mass * tip @ tip.T + inertia * turn @ turn.T
    # thirty modes, none overflows or loses digits; 1e-10 is asked for
    assert_close(total, np.eye(30), rtol=0.0, atol=1e-12)
    size = np.asarray(modes.frequencies)
    stiffness = product(bend, bend) / np.outer(size, size)
    assert_close(stiffness, np.eye(30), rtol=0.0, atol=1e-12)
    assert np.all(tip > 0)


@pytest.mark.parametrize("case", CASES)
def test_boundary_conditions_and_equation(case):
    support, rotary, mass, inertia = case
    modes = unit_modes(*case)
    w = np.asarray(modes.frequencies)[:, None]
    a = np.asarray(modes.trigonometric)[:, None]
    b = np.asarray(modes.exponential)[:, None]
    assert_close(a * b, w, rtol=1e-13)
    assert_close(a**2 - b**2, rotary * w**2, rtol=1e-9, atol=1e-9)
    zero, one = jnp.zeros(1), jnp.ones(1)
    value, slope, bend = (
        (np.asarray(f(zero)), np.asarray(f(one)))
        for f in (modes.value, modes.slope, modes.curvature)
    )
    assert np.all(np.abs(value[0]) < 1e-12) == support.holds_deflection
    # slopes and moments in their own units; the errors of 30 modes are rounding
    assert np.all(np.abs(slope[0] / a) < 1e-12) == support.holds_slope
    assert np.all(np.abs(bend[0] / a**2) < 1e-12) == (not support.holds_slope)
    moment = bend[1] - inertia * w**2 * slope[1]
    assert np.max(np.abs(moment / (a**2 + inertia * w**2 * a))) < 1e-12


def test_heavy_tips_and_thin_sections_are_limits():
    # a very heavy tip holds still: a beam clamped at one and supported at the other end
    modes = unit_modes(ClampedFree(), mass=1e8)
    beta = np.sqrt(np.asarray(modes.frequencies))
    assert_close(beta[1:4], FIRST[SupportedFree], rtol=1e-8)
    assert_close(beta[0] ** 2, np.sqrt(3.0 / 1e8), rtol=1e-6)
    # rotary inertia lowers every frequency, by its share of the energy at first
    plain, rayleigh = unit_modes(ClampedFree()), unit_modes(ClampedFree(), rotary=1e-7)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    slope = np.asarray(plain.slope(jnp.asarray(0.5 * (nodes + 1.0))))
    share = 0.5e-7 * (slope**2 @ (0.5 * weights))
    lower = 1.0 - np.asarray(rayleigh.frequencies / plain.frequencies)
    assert_close(lower[:5], share[:5], rtol=1e-3)


def test_units():
    EI, mu, l = 3.3e4, 12.5, 1.7
    modes = modes_of(ClampedFree(), *map(jnp.array, (EI, mu, l, 0.0, 6.0, 0.4)))
    scaled = unit_modes(ClampedFree(), mass=6.0 / (mu * l), inertia=0.4 / (mu * l**3))
    time = np.sqrt(mu * l**4 / EI)
    assert_close(modes.frequencies * time, scaled.frequencies, rtol=1e-12)
    x = jnp.array([0.3, 1.0, 1.7])
    value = scaled.value(x / l) / np.sqrt(mu * l)
    assert_close(modes.value(x), value, rtol=1e-10, atol=1e-12)


@pytest.mark.slow
def test_gradient_by_all_parameters():
    """Supported at the base: both kinds of conditions there, held and free."""

    def law(EI, mu, l, rho, m, J):
        modes = bending_modes(
            EI,
            mu,
            l,
            3,
            support=SupportedFree(),
            rotary_inertia=rho,
            tip_mass=m,
            tip_inertia=J,
        )
        x = l * jnp.array([0.4, 1.0])
        return modes.frequencies, modes.value(x), modes.slope(x)

    assert_gradient(law, *map(jnp.array, (2.0, 1.5, 1.2, 0.01, 0.4, 0.05)))


@pytest.mark.parametrize("support", [ClampedFree(), FreeFree()])
@pytest.mark.parametrize("tip", [0.0, 0.7])
def test_bars(support, tip):
    c, mu, l = 5.0, 2.0, 1.5
    modes = bar_modes(c, mu, l, 10, support=support, tip=tip)
    k = np.arange(10)
    beta = np.asarray(modes.frequencies) * l * np.sqrt(mu / c)
    kappa = tip / (mu * l)
    if support.holds_deflection:
        assert np.max(np.abs(np.cos(beta) - kappa * beta * np.sin(beta))) < 1e-12
        expected = np.pi * (k + 0.5)
    else:
        assert np.max(np.abs(np.sin(beta) + kappa * beta * np.cos(beta))) < 1e-12
        expected = np.pi * (k + 1.0)
    if tip == 0.0:
        assert_close(beta, expected, rtol=1e-14)
    nodes, weights = np.polynomial.legendre.leggauss(100)
    x, end = jnp.asarray(0.5 * l * (nodes + 1.0)), jnp.array([l])
    value, tips = np.asarray(modes.value(x)), np.asarray(modes.value(end))
    total = mu * (value * 0.5 * l * weights) @ value.T + tip * tips @ tips.T
    assert_close(total, np.eye(10), rtol=0.0, atol=1e-12)
    slope = np.asarray(modes.slope(x))
    stiffness = c * (slope * 0.5 * l * weights) @ slope.T
    squares = np.asarray(modes.frequencies) ** 2
    assert_close(stiffness, np.diag(squares), rtol=1e-11, atol=1e-9)
    assert np.all(tips > 0)


@pytest.mark.slow
def test_gradient_of_bars():
    def law(c, mu, l, tip):
        modes = bar_modes(c, mu, l, 3, tip=tip)
        return modes.frequencies, modes.value(l * jnp.array([0.4, 1.0]))

    assert_gradient(law, *map(jnp.array, (2.0, 1.5, 1.2, 0.4)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: bending_modes(0.0, 1.0, 1.0, 1), "`stiffness` must be positive"),
        (
            lambda: bending_modes(1.0, 1.0, 1.0, 1, tip_mass=-1.0),
            "`tip_mass` must not be negative",
        ),
        (lambda: bending_modes(1.0, 1.0, 1.0, 0), "`number` of modes must be at least"),
        (lambda: bar_modes(1.0, 1.0, -1.0, 1), "`length` must be positive"),
        (lambda: bar_modes(1.0, 1.0, 1.0, 0), "`number` of modes must be at least 1"),
        (lambda: bar_modes(1.0, 1.0, 1.0, 1, tip=-1.0), "`tip` must not be negative"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
