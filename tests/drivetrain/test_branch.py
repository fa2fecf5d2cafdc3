"""The viscoelastic gear of three springs: rest, limits, energy."""

import dataclasses

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import pytest
from elastax.drivetrain import (
    CubicStiffness,
    LimitedStiffness,
    LinearStiffness,
    RelaxationBranch,
)

from tests.helpers import assert_close, assert_gradient


relaxed = [
    LinearStiffness(jnp.array([3e4, 5e5])),
    CubicStiffness(jnp.array([3e4, 5e5]), jnp.array([4e4, 4e8])),
    LimitedStiffness(
        jnp.array([3e4, 5e5]),
        jnp.array([4e4, 1e8]),
        jnp.array([1e5, 1e7]),
        jnp.array([2e-3, 1e-5]),
    ),
]
each_law = pytest.mark.parametrize("law", relaxed, ids=lambda s: type(s).__name__)
TORSION, RATE = jnp.array([4e-3, -2.1e-3]), jnp.array([0.02, 0.05])
MEMORY = jnp.array([[2.5e-3, -1.8e-3]])
SPRING = CubicStiffness(jnp.array([2e5, 4e6]), jnp.array([4e4, 0.0]))


def branch(law=relaxed[1]):
    return RelaxationBranch(jnp.array([8e4, 2e5]), law, jnp.array([300.0, 900.0]))


@each_law
def test_rest_is_an_equilibrium(law):
    scale = jnp.array([1e-12, 1e-5, 0.3, 1.0, 2.0, 10.0, 1e3, 1e6])
    torsion = scale[:, None] * TORSION[None]
    part = branch(law)

    def everything(torsion):
        memory = part.rest(torsion)
        rates = part.rates(torsion, jnp.zeros(2), memory)
        stiffness = part.coupling + law.stiffness(memory[0])
        # what is missing, as a torsion
        return memory[0], rates[0] * part.viscosity / stiffness

    memory, missing = jax.jit(jax.vmap(everything))(torsion)
    assert jnp.all(jnp.abs(missing) < 1e-15 * jnp.abs(memory))
    # both springs in series are softer than either, on the side of the torsion
    assert jnp.all(memory * torsion > 0)
    assert jnp.all(jnp.abs(memory) < jnp.abs(torsion))
    assert_close(part.rest(-TORSION), -part.rest(TORSION), rtol=0.0)


def test_slow_motion_meets_the_series_and_fast_motion_the_coupling():
    part = branch(relaxed[0])
    c2, c3 = part.coupling, relaxed[0].linear
    slow = part.torque(SPRING, TORSION, part.rest(TORSION))
    assert_close(slow, c2 * c3 / (c2 + c3) * TORSION, rtol=1e-14)
    frozen = lambda x: part.torque(SPRING, x, MEMORY)
    fast = jax.jvp(frozen, (TORSION,), (jnp.ones(2),))[1]
    assert_close(fast, c2, rtol=1e-14)
    # in between a first-order lag of the time constant d / (c2 + c3)
    rates = lambda z: part.rates(TORSION, RATE, z)
    decay = jax.jvp(rates, (MEMORY,), (jnp.ones((1, 2)),))[1]
    assert_close(decay[0], -(c2 + c3) / part.viscosity, rtol=1e-14)
    assert part.states == 1


@each_law
def test_power_goes_into_the_springs_and_the_damper(law):
    part = branch(law)
    rates = part.rates(TORSION, RATE, MEMORY)

    def stored(torsion, memory):
        stretch = torsion - memory[0]
        return 0.5 * part.coupling * stretch**2 + law.potential(memory[0])

    _, change = jax.jvp(stored, (TORSION, MEMORY), (RATE, rates))
    loss = part.viscosity * rates[0] ** 2
    power = part.torque(SPRING, TORSION, MEMORY) * RATE
    # sums of terms of the size of the loss
    assert jnp.all(jnp.abs(change + loss - power) < 1e-14 * (loss + jnp.abs(power)))
    assert jnp.all(loss > 0)


@pytest.mark.slow
@each_law
def test_gradient(law):
    function = lambda b, x, z: (b.torque(SPRING, x, z), b.rates(x, RATE, z))
    assert_gradient(function, branch(law), TORSION, MEMORY, order=2)
    assert_gradient(lambda b, x: b.rest(x), branch(law), TORSION, order=2)


@pytest.mark.slow
@each_law
def test_extremes_are_finite(law):
    def everything(part, torsion):
        value = lambda b, x: jnp.sum(
            b.rest(x) + b.rates(x, RATE, b.rest(x)) + b.torque(SPRING, x, MEMORY)[None]
        )
        slope = lambda x: jax.grad(value, argnums=1)(part, x)
        curvature = jax.jvp(slope, (torsion,), (jnp.ones(2),))
        return value(part, torsion), jax.grad(value)(part, torsion), curvature

    sizes = jnp.array([0.0, 1e-300, 1e8])[:, None] * jnp.array([[1.0, -1.0]])
    result = jax.jit(jax.vmap(everything, (None, 0)))(branch(law), sizes)
    for leaf in jax.tree.leaves(result):
        assert jnp.all(jnp.isfinite(leaf))


def test_scaled():
    part, scaled = branch(), branch().scaled(1.3)
    torque = part.torque(SPRING, TORSION, MEMORY)
    assert_close(scaled.torque(SPRING, TORSION, MEMORY), 1.3 * torque, rtol=1e-14)
    # the motion inside stays the same
    rates = part.rates(TORSION, RATE, MEMORY)
    assert_close(scaled.rates(TORSION, RATE, MEMORY), rates, rtol=1e-12)
    assert_close(scaled.rest(TORSION), part.rest(TORSION), rtol=1e-14)


def test_jit_vmap_and_loop_agree():
    part = branch()
    torsion = TORSION[None] * jnp.linspace(-2.0, 3.0, 4)[:, None]
    loop = jnp.stack([part.rest(x) for x in torsion])
    assert_close(jax.jit(jax.vmap(part.rest))(torsion), loop, rtol=1e-14)
    rates = lambda x: part.rates(x, RATE, MEMORY)
    loop = jnp.stack([rates(x) for x in torsion])
    # differences of torques up to 1e3 over the viscosity
    assert_close(jax.jit(jax.vmap(rates))(torsion), loop, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
def test_gauss_newton_recovers_the_springs_from_half_of_them():
    true = branch(relaxed[0])
    x = jnp.linspace(-1.0, 1.0, 40)[:, None] * jnp.array([[5e-3, 2e-3]])
    z = (jnp.sin(jnp.arange(40.0)) * 2e-3)[:, None] * jnp.ones((1, 2))

    def measured(part):
        torque = jax.vmap(lambda x, z: part.torque(SPRING, x, z))(x, z[:, None])
        # rates times the nominal viscosity, which makes them torques
        rates = jax.vmap(lambda x, z: part.rates(x, RATE, z)[0] * true.viscosity)
        return jnp.stack([torque, rates(x, z[:, None])])

    part = jax.tree.map(lambda leaf: 0.5 * leaf, true)
    target = measured(true)
    for _ in range(8):
        flat, unravel = jax.flatten_util.ravel_pytree(part)
        residual = lambda v: (measured(unravel(v * flat)) - target).ravel()
        ones = jnp.ones_like(flat)
        step = jnp.linalg.lstsq(jax.jacfwd(residual)(ones), -residual(ones))[0]
        part = unravel(flat * (1.0 + step))
    assert_close(eqx.filter(part, eqx.is_array), true, rtol=1e-6)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: dataclasses.replace(branch(), coupling=jnp.zeros(2)),
            "`coupling` must be pos",
        ),
        (
            lambda: dataclasses.replace(branch(), viscosity=-jnp.ones(2)),
            "`viscosity` must be p",
        ),
        (
            lambda: RelaxationBranch(jnp.ones(2), relaxed[0], jnp.ones(3)),
            "must have the shape",
        ),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
