"""Motions along a damped law against nested derivatives of the law."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    inverse_motion,
    jacobian,
    resolved_motion,
    tool_derivatives,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import fanuc, planar
from tests.kinematics.test_inverse_motion import REGULAR, seven
from tests.kinematics.test_motion import Sines


def law(chain, q, twist, damping, weights, length):
    """The law as it is printed, for autodiff."""
    scale = jnp.array([1.0, 1, 1, length, length, length])
    matrix = scale[:, None] * jacobian(chain, q)
    light = matrix / weights[None]
    gram = light @ matrix.T + damping**2 * jnp.eye(6)
    return light.T @ jnp.linalg.solve(gram, scale * twist)


@pytest.mark.slow
def test_derivatives_are_those_of_the_law():
    """A redundant arm with large damping: each one is the total derivative."""
    chain, rng = seven(), np.random.default_rng(4)
    q = jnp.asarray(rng.uniform(-1, 1, 7))
    y = jnp.asarray(rng.uniform(-1, 1, (3, 6)))
    weights = jnp.array([1.0, 4, 1, 9, 1, 1, 2])
    twist = lambda t: y[0] + t * y[1] + t**2 / 2 * y[2]
    rate = lambda q, t: law(chain, q, twist(t), 0.2, weights, 0.7)

    def total(f):
        """Derivative of a function of the state and the time along the motion."""
        return lambda q, t: jax.jvp(f, (q, t), (rate(q, t), jnp.ones_like(t)))[1]

    second = total(rate)
    expected = jax.jit(
        lambda t: jnp.stack([f(q, t) for f in (rate, second, total(second))])
    )(jnp.array(0.0))
    actual = resolved_motion(
        chain, q, y, damping=0.2, weights=weights, characteristic_length=0.7
    )
    assert_close(actual[0], q, rtol=0)
    assert_close(actual[1:], expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


@pytest.mark.slow
def test_without_damping_it_is_the_inverse():
    chain, q = fanuc(1e-3), Sines(3).derivatives()[:4].at[0].set(REGULAR)
    twists = tool_derivatives(chain, q).twists
    actual = resolved_motion(chain, REGULAR, twists, damping=1e-6)
    expected = inverse_motion(chain, REGULAR, twists).derivatives
    # the square of the damping over that of the smallest singular value, 0.4 m
    assert_close(actual, expected, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_singular_pose_gradient_and_batches():
    chain = planar(0.5, 0.3)
    stretched = jnp.array([0.4, 0.0])
    twists = jnp.array([[0.1, -0.2], [0.3, 0.1]])
    solve = lambda q, y: resolved_motion(chain, q, y, damping=0.05, rows=(0, 1))
    assert_gradient(solve, stretched, twists)
    batch = jnp.stack([stretched, 2 * stretched, stretched + 0.7])
    mapped = jax.jit(jax.vmap(solve, (0, None)))(batch, twists)
    loop = jnp.stack([solve(q, twists) for q in batch])
    assert_close(mapped, loop, rtol=1e-13, atol=1e-14)


def test_refusals():
    chain, q, y = planar(0.5, 0.3), jnp.array([0.4, 0.9]), jnp.zeros((2, 2))
    with pytest.raises(ValueError, match="`damping` must be positive"):
        resolved_motion(chain, q, y, damping=0.0, rows=(0, 1))
    with pytest.raises(ValueError, match=r"shape \(order, 6\)"):
        resolved_motion(chain, q, y, damping=0.1)
    with pytest.raises(ValueError, match="distinct indices"):
        resolved_motion(chain, q, y, damping=0.1, rows=(0, 6))
    with pytest.raises(ValueError, match="`weights` must be positive"):
        resolved_motion(chain, q, y, damping=0.1, weights=-1.0, rows=(0, 1))
