"""The uses of a function of a robot and a state that users have.

Every use evaluates `function(robot, *state)` for many states: one call at a time, one
after another in a scan, vmapped, and vmapped derivatives.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from elastax.dynamics import ElasticRobot


USES = ("single", "scan", "vmap", "jvp", "jacfwd", "vjp")


def scanned(function: Callable) -> Callable:
    """One state after another, each waiting for the result before it."""

    def run(robot, *states):
        def step(carry, state):
            # too small to change the first input, but the compiler cannot know
            first, *rest = state
            result = function(robot, first + carry, *rest)
            return 1e-300 * jax.tree.leaves(result)[0].ravel()[0], result

        start = jnp.zeros((), states[0].dtype)
        return jax.lax.scan(step, start, states)[1]

    return run


def mapped(function: Callable) -> Callable:
    """All states in one call."""
    return lambda robot, *states: jax.vmap(lambda *x: function(robot, *x))(*states)


def pushed(function: Callable) -> Callable:
    """Derivative along one direction of the parameters and of the state."""

    def run(robot, *states):
        def one(*state):
            tangents = direction(robot), *(0.1 * x for x in state)
            return jax.jvp(function, (robot, *state), tangents)[1]

        return jax.vmap(one)(*states)

    return run


def direction(robot: ElasticRobot) -> ElasticRobot:
    """Relative change of the physical parameters; the geometry stays."""
    moved = jax.tree.map(lambda x: 0.1 * x, robot)
    still = jax.tree.map(jnp.zeros_like, (robot.chain, robot.flange))
    return eqx.tree_at(lambda r: (r.chain, r.flange), moved, still)


def jacobians(function: Callable) -> Callable:
    """Forward Jacobian with respect to the whole state."""

    def run(robot, *states):
        everything = tuple(range(len(states)))
        one = jax.jacfwd(lambda *x: function(robot, *x), argnums=everything)
        return jax.vmap(one)(*states)

    return run


def pulled(function: Callable) -> Callable:
    """Gradient of the sum of all results by all parameters and all states."""

    def run(robot, *states):
        result, pull = jax.vjp(mapped(function), robot, *states)
        return pull(jax.tree.map(jnp.ones_like, result))

    return run


PROGRAMS: dict[str, Callable[[Callable], Callable]] = {
    "single": lambda function: function,
    "scan": scanned,
    "vmap": mapped,
    "jvp": pushed,
    "jacfwd": jacobians,
    "vjp": pulled,
}
