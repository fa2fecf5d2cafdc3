"""Operands that XLA finds to be constant late: the process would abort.

Each case is a program that did, or stands next to one.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import kernel, written_out
from elastax.kinematics import ChainParameters, forward_kinematics

from tests.helpers import assert_close
from tests.kinematics.arms import planar, puma


A = 0.1 * jnp.arange(1.0, 7.0)
START = np.arange(6) < 3


@kernel
def fused(a, b, c):
    return jnp.sin(a) * c + b


def ones():
    """Ones of which XLA finds out while it simplifies."""
    return jnp.where(START, jnp.ones(()), jnp.asarray(1.0))


def step(x, c):
    return fused(jnp.outer(x, x) @ x, x, c)


CASES = {
    "beside a product": lambda a: fused(
        a @ (ones()[:, None] * jnp.outer(a, a)), a, ones()
    ),
    "behind a product": lambda a: step(a, ones()),
    "inner jit": lambda a: jax.jit(step)(a, ones()),
    "loop": lambda a: jax.lax.fori_loop(0, 3, lambda _, x: step(x, ones()), a),
    "carried": lambda a: jax.lax.fori_loop(
        0, 3, lambda _, x: (step(*x), x[1]), (a, ones())
    )[0],
    "branch": lambda a: jax.lax.cond(
        a[0] > 0, lambda x: step(x, ones()), lambda x: x, a
    ),
    "checkpoint": lambda a: jax.checkpoint(lambda x: step(x, ones()))(a),
    "empty sum": lambda a: step(a, a[:0].sum() + ones()),
    "all of them": lambda a: fused(ones(), 2 * ones(), 3 * ones()),
    "iota": lambda a: step(a, jnp.arange(6.0)),
    "given": lambda a: step(a, jnp.ones(6)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_result_is_that_of_the_definition(case):
    found = jax.jit(CASES[case])(A)
    with written_out():
        desired = jax.jit(lambda a: CASES[case](a))(A)
    assert_close(found, desired, rtol=1e-14)


def test_constant_tangent_of_a_pose():
    chain, turn = puma(), jnp.eye(6)
    pose = lambda q: forward_kinematics(chain, turn @ q)
    rate = lambda x, v: jax.jvp(pose, (x,), (jnp.zeros(6),))[1] * v[0]
    rates = jax.jit(jax.vmap(rate, (None, 0)))(jnp.ones(6), jnp.eye(6))
    assert_close(rates, jnp.zeros((6, 4, 4)), rtol=0)


def test_pose_and_derivatives_at_constant_parameters():
    nominal = ChainParameters.of(planar(0.5, 0.4), base=False, tool=False)
    zero = jnp.zeros(8)
    pose = lambda x, q: forward_kinematics(nominal.moved(x), q)
    both = lambda q: (pose(zero, q), jax.jacfwd(lambda x: pose(x, q))(zero))
    found = jax.jit(both)(jnp.ones(2))
    with written_out():
        desired = jax.jit(lambda q: both(q))(jnp.ones(2))
    assert_close(found, desired, rtol=1e-14, atol=1e-15)
