"""Spring laws: closed forms, inverses, potentials and their limits."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from elastax._taylor import compose, from_derivatives
from elastax.structure import CubicStiffness, LimitedStiffness, LinearStiffness
from hypothesis import given, settings, strategies as st

from tests.helpers import assert_close, assert_gradient, load_vectors


springs = [
    LinearStiffness(jnp.array([2e5, 4.0e6])),
    CubicStiffness(jnp.array([2e5, 4.0e6]), jnp.array([4e4, 0.0])),
    LimitedStiffness(
        jnp.array([2e5, 4.0e6]),
        jnp.array([4e4, 1e5]),
        jnp.array([5e5, 4.4e6]),
        jnp.array([2e-4, 1e-5]),
    ),
]
each_spring = pytest.mark.parametrize("spring", springs, ids=lambda s: type(s).__name__)
TORSION = jnp.array([4e-3, -2.1e-3])


def of_vector(vector):
    inputs = vector["inputs"]
    return LimitedStiffness(
        inputs["c0"], inputs["gamma"], inputs["c_max"], inputs["s_lim"]
    )


def test_cubic_vectors():
    (vector,) = load_vectors("2.7")
    inputs, outputs = vector["inputs"], vector["outputs"]
    spring = CubicStiffness(inputs["c0"], inputs["gamma"])
    torsion = jnp.array(inputs["phi_rel"])
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    assert_close(spring.torque(torsion), outputs["tau"], **tolerance)
    assert_close(spring.stiffness(torsion), outputs["tangent"], **tolerance)
    assert_close(spring.potential(torsion), outputs["V"], **tolerance)

    (vector,) = load_vectors("1.1")
    inputs, outputs = vector["inputs"], vector["outputs"]
    spring = CubicStiffness(inputs["c0"], inputs["gamma"])
    torsion = jnp.array(inputs["dphi"])
    assert_close(spring.torque(torsion), outputs["tau"], rtol=1e-12)
    assert_close(spring.torque(torsion) / torsion, outputs["c"], rtol=1e-12)
    assert_close(spring.stiffness(torsion), outputs["tangent"], rtol=1e-12)


def test_limited_vector():
    (vector,) = load_vectors("2.9")
    outputs = vector["outputs"]
    spring = of_vector(vector)
    torsion = jnp.array(vector["inputs"]["phi_rel"])
    tolerance = {"rtol": vector["tol"], "atol": vector["tol"]}
    assert_close(spring.torque(torsion), outputs["tau"], **tolerance)
    assert_close(spring.stiffness(torsion), outputs["dtau_dphi"], **tolerance)
    corner = jnp.sqrt((spring.limit / spring.linear - 1.0) / spring.hardening)
    secant = spring.torque(corner) / corner
    assert_close(secant, outputs["c_lim_at_cmax"], **tolerance)
    secant = spring.torque(jnp.array(1e3)) / 1e3
    assert_close(secant, outputs["c_lim_limit_large"], rtol=1e-9)


def test_limited_secant_is_bounded_and_torque_increases():
    spring = of_vector(*load_vectors("2.9"))
    torsion = jnp.linspace(0.0, 0.05, 2001)
    torque = spring.torque(torsion)
    assert jnp.all(jnp.diff(torque) > 0)
    assert jnp.all(torque[1:] / torsion[1:] < spring.limit)
    # Printed remark of the errata: the tangent overshoots, below 3 c_max - 2 c_0.
    largest = jnp.max(spring.stiffness(torsion))
    assert spring.limit < largest < 3.0 * spring.limit - 2.0 * spring.linear


@each_spring
def test_torsion_inverts_torque(spring):
    scale = jnp.array([1e-12, 1e-5, 0.3, 1.0, 1.5, 2.0, 10.0, 1e3, 1e6])
    torsion = scale[:, None] * TORSION[None]
    recovered = jax.vmap(lambda x: spring.torsion(spring.torque(x)))(torsion)
    # The relative condition of the inverse is torque / (stiffness torsion) <= 1.
    assert_close(recovered, torsion, rtol=1e-14)


@settings(deadline=None, max_examples=150)
@given(
    hardening=st.floats(-4.0, 8.0),
    excess=st.floats(-2.0, 3.0),
    corners=st.floats(-2.0, 8.0),
    place=st.floats(-4.0, 3.0),
)
def test_limited_inverse_over_decades(hardening, excess, corners, place):
    gamma, ratio = 10.0**hardening, 1.0 + 10.0**excess
    torsion = jnp.array(10.0**place * np.sqrt((ratio - 1.0) / gamma))
    spring = LimitedStiffness(1e5, gamma, 1e5 * ratio, 10.0**corners / (1e5 * ratio))
    assert_close(jitted_round_trip(spring, torsion), torsion, rtol=1e-14)


@jax.jit
def jitted_round_trip(spring, torsion):
    return spring.torsion(spring.torque(torsion))


@each_spring
def test_laws_are_odd_and_the_tangent_is_the_derivative(spring):
    torque, stiffness = jax.jvp(spring.torque, (TORSION,), (jnp.ones(2),))
    assert_close(spring.torque(-TORSION), -torque, rtol=0.0)
    assert_close(spring.torsion(-torque), -spring.torsion(torque), rtol=0.0)
    assert_close(spring.potential(-TORSION), spring.potential(TORSION), rtol=0.0)
    assert_close(spring.stiffness(TORSION), stiffness, rtol=1e-13)


@each_spring
def test_secant_is_torque_over_torsion_and_the_tangent_at_zero(spring):
    torsion = jnp.array([1e-12, 1e-3, 0.3, 1.0, 3.0, 1e3])[:, None] * TORSION[None]
    law = jax.jit(jax.vmap(lambda s, x: (s.torque(x), s.secant(x)), (None, 0)))
    torque, secant = law(spring, torsion)
    assert_close(secant, torque / torsion, rtol=1e-15)
    assert_close(spring.secant(-TORSION), spring.secant(TORSION), rtol=0.0)
    zero = jnp.zeros(2)
    assert_close(spring.secant(zero), spring.stiffness(zero), rtol=1e-15)
    assert_close(derivative(spring.secant, zero), zero, rtol=0.0)


@each_spring
def test_potential_is_the_integral_of_the_torque(spring):
    for index, one in enumerate((0, 1)):
        single = jax.tree.map(lambda leaf: leaf[one], spring)
        torque = lambda x: float(single.torque(jnp.array(x)))
        for torsion in (2e-4, 4e-3, 2e-2):
            work, _ = scipy.integrate.quad(
                torque, 0.0, torsion, epsabs=0.0, epsrel=1e-10, limit=200
            )
            energy = spring.potential(jnp.array([torsion, torsion]))[index]
            assert_close(energy, work, rtol=1e-9)


@pytest.mark.parametrize("torsion", [1e-6, 1e-3, 4e-3, 0.02, 1.0])
@pytest.mark.parametrize("corners", [2.0, 1e2, 1e5])
def test_limited_potential_on_both_sides_of_its_switch(torsion, corners):
    # Work over the secant in mpmath's precision would need a dependency: the same
    # integral in panels that resolve the corner is exact to rounding.
    spring = LimitedStiffness(2e5, 4e4, 5e5, corners / 5e5)
    corner = np.sqrt((5e5 / 2e5 - 1.0) / 4e4)
    edges = np.unique(
        np.clip(
            np.concatenate(
                [
                    torsion * np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 25)]),
                    corner
                    + corner * np.outer([-1, 1], np.geomspace(1e-9, 1.0, 60)).ravel(),
                ]
            ),
            0.0,
            torsion,
        )
    )
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(edges)[:, None]
    points = 0.5 * (edges[:-1] + edges[1:])[:, None] + half * nodes
    torque = np.asarray(spring.torque(jnp.asarray(points)))
    work = np.sum(half * weights * torque)
    assert_close(spring.potential(jnp.array(torsion)), work, rtol=1e-12)


@pytest.mark.slow
@each_spring
def test_gradients(spring):
    # Away from zero hardening, where a central difference would leave the domain.
    spring = jax.tree.map(lambda leaf: jnp.where(leaf == 0.0, 2e4, leaf), spring)
    assert_gradient(lambda s, x: s.torque(x), spring, TORSION, order=2)
    assert_gradient(lambda s, x: s.torsion(x), spring, spring.torque(TORSION), order=2)


@pytest.mark.slow
@each_spring
def test_potential_gradient(spring):
    assert_gradient(lambda s, x: s.potential(x), spring, TORSION)
    torque = jax.vmap(jax.grad(lambda s, x: s.potential(x), argnums=1))(spring, TORSION)
    assert_close(torque, spring.torque(TORSION), rtol=1e-13)


@pytest.mark.slow
def test_cubic_inverse_is_smooth_at_zero_hardening():
    torque = jnp.array(700.0)
    soft = lambda gamma: CubicStiffness(2e5, gamma).torsion(torque)
    zero = jnp.array(0.0)
    ratio = 700.0 / 2e5
    assert_close(soft(zero), ratio, rtol=1e-15)
    # x + gamma x^3 = u: x = u - gamma u^3 + 3 gamma^2 u^5 - ...
    assert_close(jax.grad(soft)(zero), -(ratio**3), rtol=1e-14)
    assert_close(jax.hessian(soft)(zero), 6.0 * ratio**5, rtol=1e-14)
    assert_close(soft(jnp.array(1e-3)), ratio - 1e-3 * ratio**3, rtol=1e-15)


def test_limited_turns_into_cubic_far_below_a_sharp_limit():
    limited = LimitedStiffness(2e5, 4e4, 1e9, 1.0)
    cubic = CubicStiffness(2e5, 4e4)
    torsion = jnp.array([1e-3, -4e-3])
    # Rounding of the corners: 1/(3 pi s^3 c^2) relative to c, far below.
    assert_close(limited.torque(torsion), cubic.torque(torsion), rtol=1e-11)
    assert_close(limited.potential(torsion), cubic.potential(torsion), rtol=1e-11)


@pytest.mark.slow
@each_spring
def test_extremes_are_finite(spring):
    sizes = jnp.array([0.0, 1e-300, 1e8])[:, None]
    arguments = sizes * jnp.array([[1.0, -1.0]])

    def everything(spring, argument):
        results = []
        for name in ("torque", "torsion", "potential", "stiffness", "secant"):
            law = lambda s, x, name=name: jnp.sum(getattr(s, name)(x))
            slope = jax.grad(law, argnums=1)
            ones = jnp.ones_like(argument)
            results += [
                law(spring, argument),
                jax.jvp(lambda x, slope=slope: slope(spring, x), (argument,), (ones,)),
                jax.grad(law)(spring, argument),
            ]
        return results, spring.torsion(spring.torque(argument))

    results, recovered = jax.jit(jax.vmap(everything, (None, 0)))(spring, arguments)
    for leaf in jax.tree.leaves(results):
        assert jnp.all(jnp.isfinite(leaf))
    assert_close(recovered, arguments, rtol=1e-14)


@each_spring
def test_scaled(spring):
    torque = spring.torque(TORSION)
    scaled = spring.scaled(1.3)
    assert type(scaled) is type(spring)
    assert_close(scaled.torque(TORSION), 1.3 * torque, rtol=1e-14)
    assert_close(scaled.potential(TORSION), 1.3 * spring.potential(TORSION), rtol=1e-13)
    jitted = jax.jit(lambda factor: spring.scaled(factor).torque(TORSION))(1.3)
    assert_close(jitted, 1.3 * torque, rtol=1e-14)


@each_spring
def test_jit_vmap_and_loop_agree(spring):
    torsions = TORSION[None] * jnp.linspace(-2.0, 3.0, 5)[:, None]
    for law in (spring.torque, spring.torsion, spring.potential):
        arguments = torsions if law != spring.torsion else 1e6 * torsions
        loop = jnp.stack([law(one) for one in arguments])
        assert_close(jax.jit(jax.vmap(law))(arguments), loop, rtol=1e-14)


@pytest.mark.slow
@each_spring
def test_taylor_composition(spring):
    # Torsion moves as x + v t: the coefficients are those of the derivatives.
    rate = jnp.array([0.3, -0.2])
    series = from_derivatives(jnp.stack([TORSION, rate, *jnp.zeros((2, 2))]))
    result = compose(spring.torque, series).derivatives()
    law = spring.torque
    for order in range(4):
        expected = law(TORSION) * rate**order
        assert_close(result[order], expected, rtol=1e-11)
        law = functools.partial(derivative, law)
    back = compose(spring.torsion, compose(spring.torque, series)).derivatives()
    assert_close(back[:2], series.derivatives()[:2], rtol=1e-13)
    # The higher ones cancel: terms of the size of the torque's own over its tangent.
    size = jnp.max(jnp.abs(result / spring.stiffness(TORSION)[None]), axis=1)
    assert jnp.all(jnp.abs(back[2:]) < 1e-12 * size[2:, None] + 1e-13)


def derivative(law, x):
    return jax.jvp(law, (x,), (jnp.ones_like(x),))[1]


def test_scalar_parameters_take_any_shape():
    spring = LimitedStiffness(2e5, 4e4, 5e5, 2e-4)
    torsion = jnp.array([[1e-3, 2e-3], [5e-3, 7e-3]])
    assert_close(spring.torsion(spring.torque(torsion)), torsion, rtol=1e-14)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: LinearStiffness(0.0), "`linear` must be positive"),
        (lambda: CubicStiffness(-1.0, 1.0), "`linear` must be positive"),
        (lambda: CubicStiffness(1.0, -1.0), "`hardening` must not be negative"),
        (lambda: LimitedStiffness(2.0, 1.0, 2.0, 1.0), "`limit` must be above"),
        (lambda: LimitedStiffness(2.0, 1.0, 3.0, 0.0), "`steepness` must be positive"),
        (lambda: LinearStiffness(jnp.nan), "`linear` must be positive"),
        (lambda: CubicStiffness(jnp.ones(2), jnp.ones(3)), "must have the shape"),
        (lambda: LinearStiffness(1.0).scaled(-1.0), "`linear` must be positive"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
