"""Springs of (2.8), of a table and with a soft gap: laws, inverses, limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from elastax.structure import (
    BacklashStiffness,
    CubicStiffness,
    ExponentialStiffness,
    TabulatedStiffness,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


TABLE = jnp.array([[1e-3, 2e-3], [2e-3, 3e-3], [5e-3, 9e-3]])
SPRINGS = [
    ExponentialStiffness(
        jnp.array([2e5, 4e6]),
        jnp.array([5e5, 9e6]),
        jnp.array([150.0, 900.0]),
        jnp.array([1e-4, 1e-5]),
    ),
    TabulatedStiffness(TABLE, jnp.array([[200.0, 9e3], [500.0, 2e4], [1.7e3, 9e4]])),
    BacklashStiffness(
        jnp.array([2e5, 4e6]),
        jnp.array([2e-3, 3e-4]),
        jnp.array([1e-4, 5e-5]),
        jnp.array([0.0, 1e4]),
    ),
]
each_spring = pytest.mark.parametrize("spring", SPRINGS, ids=lambda s: type(s).__name__)
TORSION = jnp.array([4.1e-3, -2.3e-3])


def test_exponential_vector():
    """At the text's corner, which a rounding of 1e-13 rad leaves sharp."""
    (vector,) = load_vectors("2.8")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    spring = ExponentialStiffness(given["c0"], given["c_max"], given["gamma"], 1e-13)
    torsion = jnp.array(given["phi_rel"])
    bounds = {"rtol": tol, "atol": tol}
    assert_close(spring.torque(torsion), desired["tau"], **bounds)
    assert_close(spring.stiffness(torsion), desired["tangent"], **bounds)
    top = spring.stiffness(jnp.array(desired["phi_at_max"]))
    assert_close(top, desired["tangent_max"], rtol=tol)


@pytest.mark.slow
@each_spring
def test_inverse_and_slopes(spring):
    """Over fourteen decades of torsion: inverse, tangent, secant, odd symmetry."""
    size = jnp.logspace(-12, 2, 60)[:, None] * jnp.array([1.0, -1.0])[None]
    torque, back = jax.jit(
        jax.vmap(lambda x: (spring.torque(x), spring.torsion(spring.torque(x))))
    )(size)
    assert np.all(np.diff(np.abs(np.asarray(torque)), axis=0) > 0)
    stiffness = jax.vmap(spring.stiffness)(size)
    # ten roundings of the torque over the slope, [issue: 10 eps |f / f'|]
    bound = 10 * np.finfo(float).eps * np.abs(torque / stiffness)
    assert np.all(np.abs(np.asarray(back - size)) <= bound)
    assert_close(jax.vmap(spring.secant)(size) * size, torque, rtol=1e-13)
    assert_close(jax.vmap(spring.torque)(-size), -torque, rtol=1e-15)


@each_spring
def test_forward_of_inverse(spring):
    torque = jnp.logspace(-9, 7, 50)[:, None] * jnp.array([1.0, -1.0])[None]
    again = jax.jit(jax.vmap(lambda t: spring.torque(spring.torsion(t))))(torque)
    assert_close(again, torque, rtol=1e-12)


@pytest.mark.slow
@each_spring
def test_stiffness_is_the_slope_and_potential_the_area(spring):
    slope = jax.jvp(spring.torque, (TORSION,), (jnp.ones(2),))[1]
    assert_close(spring.stiffness(TORSION), slope, rtol=1e-11)
    for k, end in enumerate(np.asarray(TORSION)):
        single = jax.tree.map(lambda leaf: leaf[..., k], spring)
        jitted = jax.jit(single.torque.__func__)
        law = lambda x: float(jitted(single, jnp.array(x)))
        knots = [*np.asarray(TABLE[:, k]), *(-np.asarray(TABLE[:, k]))]
        inside = [p for p in knots if min(0, end) < p < max(0, end)]
        area, _ = scipy.integrate.quad(law, 0, end, points=inside or None, limit=200)
        # the quadrature's own tolerance is 1.5e-8
        assert_close(single.potential(jnp.array(end)), area, rtol=2e-8)


@each_spring
def test_slope_at_zero(spring):
    """What a state of rest starts from: autodiff must see the stiffness there."""
    zero = jnp.zeros(2)
    slope = jax.jit(lambda: jax.jvp(spring.torque, (zero,), (jnp.ones(2),))[1])()
    assert_close(slope, spring.stiffness(zero), rtol=1e-13)
    assert np.all(np.asarray(slope) > 0)


@pytest.mark.slow
@each_spring
def test_gradient(spring):
    assert_gradient(lambda s, x: s.torque(x), spring, TORSION, order=2)
    assert_gradient(lambda s, x: s.torsion(x), spring, spring.torque(TORSION))
    assert_gradient(lambda s, x: s.potential(x), spring, TORSION)


@pytest.mark.slow
@each_spring
def test_derivatives_are_finite(spring):
    single = jax.tree.map(lambda leaf: leaf[..., 0], spring)
    x = jnp.array([0.0, 1e-300, -1e-3, 1e8])

    @jax.jit
    @jax.vmap
    def derivatives(x):
        laws = (single.torque, single.secant, single.torsion, single.potential)
        return [(f(x), jax.grad(f)(x), jax.grad(jax.grad(f))(x)) for f in laws]

    assert np.all(np.isfinite(np.asarray(jax.tree.leaves(derivatives(x)))))


@each_spring
def test_jit_vmap_loop_and_scale(spring):
    torsion = jnp.linspace(-6e-3, 6e-3, 8).reshape(4, 2)
    mapped = jax.jit(jax.vmap(spring.torque))(torsion)
    looped = jnp.stack([spring.torque(row) for row in torsion])
    assert_close(mapped, looped, rtol=1e-13)
    assert_close(spring.scaled(1.7).torque(TORSION), 1.7 * spring.torque(TORSION),
                 rtol=1e-14)  # fmt: skip


def test_soft_gap_becomes_the_sharp_one():
    """Within the rounding of the sharp dead zone, whatever the torsion."""
    spring = BacklashStiffness(1e5, 2e-3, 1e-6, 0.0)
    torsion = jnp.linspace(-4e-3, 4e-3, 81)
    sharp = jnp.sign(torsion) * jnp.maximum(jnp.abs(torsion) - 1e-3, 0.0)
    assert_close(spring.torque(torsion), 1e5 * sharp, rtol=0, atol=1e5 * 1e-6)


@pytest.mark.slow
def test_table_meets_its_points_and_stays_monotone():
    spring = SPRINGS[1]
    assert_close(jax.vmap(spring.torque)(TABLE), spring.torques, rtol=1e-13)
    fine = jnp.linspace(0.0, 1.2e-2, 2000)
    single = jax.tree.map(lambda leaf: leaf[:, 0], spring)
    assert np.all(np.asarray(jax.vmap(single.stiffness)(fine)) > 0)
    # points of a line give the line, also beyond the last
    line = TabulatedStiffness(TABLE[:, 0], 3e5 * TABLE[:, 0])
    assert_close(line.torque(fine), 3e5 * fine, rtol=1e-13)
    # many points of a hardening spring give that spring
    x = jnp.linspace(0, 5e-3, 40)[1:]
    cubic = CubicStiffness(2e5, 4e4)
    found = TabulatedStiffness(x, cubic.torque(x)).torque(x[:-2] + 5e-5)
    # the slopes are right to second order: 3 gamma h^2 / 2 of the cubic's, here
    assert_close(found, cubic.torque(x[:-2] + 5e-5), rtol=1.5 * 4e4 * (5e-3 / 39) ** 2)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: ExponentialStiffness(2.0, 1.0, 1.0, 1.0), "`limit` must be above"),
        (lambda: ExponentialStiffness(2.0, 3.0, -1.0, 1.0), "`hardening` must be pos"),
        (lambda: ExponentialStiffness(2.0, 3.0, 1.0, 0.0), "`rounding` must be pos"),
        (lambda: BacklashStiffness(1.0, -1.0, 1.0, 0.0), "`width` must not be neg"),
        (lambda: BacklashStiffness(1.0, 1.0, 0.0, 0.0), "`rounding` must be positive"),
        (lambda: TabulatedStiffness([1.0, 1.0], [1.0, 2.0]), "`torsions` of a table"),
        (lambda: TabulatedStiffness([1.0, 2.0], [2.0, 1.0]), "`torques` of a table"),
        (lambda: TabulatedStiffness([0.0, 2.0], [0.0, 1.0]), "`torsions` of a table"),
    ],
)
def test_refusals(build, words):
    with pytest.raises(ValueError, match=words):
        build()
