r"""Limits of reach: extremes over the joint coordinates, one joint at a time.

The squared distance of the tool from a point, and its height along a direction, are
$a + b\cos q_k + c\sin q_k$ in the coordinate of a revolute joint and a parabola in that
of a prismatic one. The best coordinate within its limits is therefore known in closed
form; going round the joints climbs to a local extreme, from several starts.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar, Vector3
from ._chain import SerialChain, forward_kinematics
from ._joints import JointKind
from ._starts import random_joints


_STARTS = 32


class ReachLimits(NamedTuple):
    """Extremes of a length over all joint coordinates within limits.

    Attributes:
        least, largest: the extremes [m].
        q_least, q_largest: coordinates at which they are met, shape (joints,).
    """

    least: Scalar
    largest: Scalar
    q_least: PerJoint
    q_largest: PerJoint


def reach_limits(
    chain: SerialChain,
    lower: PerJoint,
    upper: PerJoint,
    *,
    centre: Vector3 | None = None,
    starts: Float[Array, "starts joints"] | None = None,
    rounds: int = 300,
) -> ReachLimits:
    """Smallest and largest distance of the tool from a point.

    The best of the local extremes that are found from the starts. The lengths are
    differentiable by the chain, and by the limits that are met.

    Args:
        chain: the chain; with a tool of its own at the wrist centre this gives the
            reach that data sheets state.
        lower, upper: joint limits [rad] or [m], shape (joints,), finite.
        centre: the point in the base frame [m], its origin unless given.
        starts: joint coordinates to start from; 32 random ones unless given.
        rounds: how often every joint is moved. Extremes at limits and stretched arms
            take a few; a tool that can come to the point itself approaches it slowly.
    """

    def square(chain, q):
        position = forward_kinematics(chain, q)[:3, 3]
        return jnp.sum((position if centre is None else position - centre) ** 2)

    found = _extremes(square, chain, lower, upper, starts, rounds)
    least, largest = (_root(square(chain, q)) for q in found)
    return ReachLimits(least, largest, *found)


def extent(
    chain: SerialChain,
    lower: PerJoint,
    upper: PerJoint,
    direction: Vector3,
    *,
    starts: Float[Array, "starts joints"] | None = None,
    rounds: int = 300,
) -> ReachLimits:
    """Smallest and largest coordinate of the tool along a direction.

    Args:
        chain, lower, upper, starts, rounds: as for `reach_limits`.
        direction: in the base frame, of any length but zero, shape (3,).
    """
    unit = direction / jnp.sqrt(jnp.sum(direction**2))
    along = lambda chain, q: unit @ forward_kinematics(chain, q)[:3, 3]
    found = _extremes(along, chain, lower, upper, starts, rounds)
    least, largest = (along(chain, q) for q in found)
    return ReachLimits(least, largest, *found)


def _extremes(
    function: Callable[[SerialChain, PerJoint], Scalar],
    chain: SerialChain,
    lower: PerJoint,
    upper: PerJoint,
    starts,
    rounds: int,
) -> tuple[PerJoint, PerJoint]:
    """Coordinates with the smallest and with the largest value."""
    if starts is None:
        starts = random_joints(lower, upper, _STARTS, key=jax.random.key(0))
    sliding = jnp.asarray([kind is JointKind.PRISMATIC for kind in chain.kinds])
    # by the envelope theorem only the limits move the extreme to first order
    fixed, low, high, starts = jax.lax.stop_gradient((chain, lower, upper, starts))

    def climb(sign, q):
        value = lambda q: jax.lax.stop_gradient(sign * function(fixed, q))

        def move(step, q):
            k = step % chain.number
            along = lambda x: value(q.at[k].set(x))
            return q.at[k].set(_best(along, q[k], low[k], high[k], sliding[k]))

        end = jax.lax.fori_loop(0, rounds * chain.number, move, q)
        return end, value(end)

    signs = jnp.array([-1.0, 1.0], low.dtype)
    climbs = jax.vmap(jax.vmap(climb, (None, 0)), (0, None))
    ends, values = climbs(signs, starts)
    q = jnp.take_along_axis(ends, jnp.argmax(values, axis=1)[:, None, None], axis=1)
    at_low, at_high = q[:, 0] <= low[None], q[:, 0] >= high[None]
    found = jnp.where(at_high, upper[None], q[:, 0])
    found = jnp.where(at_low, lower[None], found)
    return found[0], found[1]


def _best(function, here, low, high, slides):
    """Coordinate within limits at which a sinusoid or a parabola is largest."""
    middle, half = (low + high) / 2, (high - low) / 2
    turned = here + 2 * np.pi / 3 * jnp.arange(3.0, dtype=here.dtype)
    places = jnp.where(slides, jnp.stack([low, middle, high]), turned)
    values = jax.vmap(function)(places)

    # sinusoid: peak next above the lower limit
    cosine = 2 / 3 * jnp.sum(values * jnp.cos(turned))
    sine = 2 / 3 * jnp.sum(values * jnp.sin(turned))
    peak = jnp.arctan2(sine, cosine)
    peak = peak + 2 * np.pi * jnp.ceil((low - peak) / (2 * np.pi))
    wave = lambda x: cosine * jnp.cos(x) + sine * jnp.sin(x)

    # parabola over s in [-1, 1]
    slope = (values[2] - values[0]) / 2
    bend = (values[2] - 2 * values[1] + values[0]) / 2
    curved = bend < 0
    vertex = jnp.where(curved, -slope / jnp.where(curved, 2 * bend, 1.0), 0.0)
    arch = lambda x: (slope + bend * x) * x
    place = lambda x: (x - middle) / jnp.where(half > 0, half, 1.0)

    top = jnp.where(slides, middle + half * vertex, peak)
    top = jnp.where((top >= low) & (top <= high), top, low)
    # where nothing is gained, the coordinate stays
    candidates = jnp.stack([jnp.clip(here, low, high), low, high, top])
    scores = jnp.where(slides, arch(place(candidates)), wave(candidates))
    return candidates[jnp.argmax(scores)]


def _root(square: Scalar) -> Scalar:
    """Square root, zero with zero slope where the argument is zero."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)
