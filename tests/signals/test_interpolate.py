"""Interpolation on a uniform grid."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.signals import UniformHermite, UniformLinear, UniformQuintic

from tests.helpers import assert_close, assert_gradient


START, STEP = 0.3, 0.05


def build(kind, degree, step=STEP, count=9):
    """A polynomial of `degree` on two channels, sampled for `kind`."""
    t = START + step * np.arange(count)
    generator = np.random.default_rng(3)
    rows = [np.polynomial.Polynomial(generator.standard_normal(degree + 1))] * 2
    rows[1] = -0.5 * rows[0] + 1.0
    orders = {UniformLinear: 1, UniformHermite: 2, UniformQuintic: 3}[kind]
    values = [np.stack([p.deriv(k)(t) for p in rows], axis=1) for k in range(orders)]
    return kind(START, step, *values), rows


KINDS = [(UniformLinear, 1), (UniformHermite, 3), (UniformQuintic, 5)]
each_kind = pytest.mark.parametrize("kind, degree", KINDS)


@eqx.filter_jit
def sample(interpolant, t):
    """Values and slopes at the times `t`."""
    return jax.vmap(interpolant)(t), jax.vmap(jax.jacfwd(interpolant))(t)


@each_kind
def test_reproduces_polynomials(kind, degree):
    interpolant, rows = build(kind, degree)
    t = START + STEP * np.array([0.0, 0.1, 1.0, 2.5, 7.99, 8.0])
    desired = np.stack([p(t) for p in rows], axis=1)
    values, slopes = sample(interpolant, t)
    assert_close(values, desired, rtol=1e-12, atol=1e-14)
    desired = np.stack([p.deriv()(t) for p in rows], axis=1)
    assert_close(slopes, desired, rtol=1e-11, atol=1e-12)


@each_kind
def test_meets_the_samples_and_holds_outside(kind, degree):
    interpolant, _ = build(kind, degree)
    t = START + STEP * np.arange(9)
    at_samples, _ = sample(interpolant, t)
    # The times are rounded, and so is the place between the samples.
    assert_close(at_samples, interpolant.values, rtol=0.0, atol=1e-14)
    outside = jnp.array([-1e8, START - 1e-6, 0.71, 1e8])
    first, last = interpolant.values[0], interpolant.values[-1]
    held = jnp.stack([first, first, last, last])
    values, slopes = sample(interpolant, outside)
    assert_close(values, held, rtol=1e-15)
    assert_close(slopes, jnp.zeros_like(slopes), rtol=0.0)


@pytest.mark.parametrize(
    "kind, order", [(UniformLinear, 2), (UniformHermite, 4), (UniformQuintic, 6)]
)
def test_order_of_convergence(kind, order):
    errors = []
    for count in (11, 21):
        step = 1.0 / (count - 1)
        t = step * np.arange(count)
        turns = [lambda t, k=k: np.sin(6 * t + k * np.pi / 2) * 6**k for k in range(3)]
        values = [turn(t)[:, None] for turn in turns[: order // 2]]
        fine = np.linspace(0.0, 1.0, 401)
        y = jax.vmap(kind(0.0, step, *values))(fine)[:, 0]
        errors.append(np.max(np.abs(np.asarray(y) - turns[0](fine))))
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.2


@each_kind
def test_jit_is_loop(kind, degree):
    interpolant, _ = build(kind, degree)
    t = jnp.array([0.0, 0.31, 0.444, 0.9])
    loop = jnp.stack([interpolant(time) for time in t])
    mapped = eqx.filter_jit(eqx.filter_vmap(kind.__call__, in_axes=(None, 0)))
    assert_close(mapped(interpolant, t), loop, rtol=1e-14)


@pytest.mark.slow
@each_kind
def test_gradient(kind, degree):
    interpolant, _ = build(kind, degree)
    assert_gradient(lambda f, t: f(t), interpolant, jnp.asarray(0.437), order=2)


def test_refusals():
    values = jnp.zeros((4, 2))
    with pytest.raises(ValueError, match="`step` must be positive"):
        UniformLinear(0.0, 0.0, values)
    with pytest.raises(ValueError, match="`slopes`.* must have the shape"):
        UniformHermite(0.0, 1.0, values, values[:3])
    with pytest.raises(ValueError, match="`curvatures`.* must have the shape"):
        UniformQuintic(0.0, 1.0, values, values, values[:, :1])
    with pytest.raises(ValueError, match="at least two samples"):
        UniformLinear(0.0, 1.0, values[:1])
