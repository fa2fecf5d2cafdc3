"""Smooth plays along a motion that is known as a function of time."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp


@eqx.filter_jit
def follow(plays, motion: Callable, end, steps: int, start=None):
    """Inputs and states at `steps + 1` equidistant times up to `end`.

    Runge-Kutta of the fourth order.

    Args:
        plays: smooth plays.
        motion: input by time, shape (joints,).
        end: of the motion [s].
        steps: number of them.
        start: states; by default those of rest at the first input.
    """
    step = end / steps

    def rates(t, states):
        x, xd = jax.jvp(motion, (t,), (jnp.ones_like(t),))
        return plays.rates(x, xd, states)

    def advance(states, t):
        first = rates(t, states)
        second = rates(t + 0.5 * step, states + 0.5 * step * first)
        third = rates(t + 0.5 * step, states + 0.5 * step * second)
        fourth = rates(t + step, states + step * third)
        change = (first + 2.0 * second + 2.0 * third + fourth) / 6.0
        return states + step * change, states

    times = step * jnp.arange(steps + 1, dtype=float)
    x = jax.vmap(motion)(times)
    start = plays.rest(x[0]) if start is None else start
    _, states = jax.lax.scan(advance, start, times)
    return x, states
