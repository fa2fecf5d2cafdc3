"""Simulation of systems whose equations switch: events, modes, and their times.

Between two events a system of differential equations of a fixed mode is integrated. A
step at whose end a guard is negative is cut off where that guard becomes so: bisection
on the dense output of the step finds the time to rounding, and a step of just that
length the state. Then the system chooses its next mode.
"""

import abc
from typing import Any, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import Scalar, Times


State = Float[Array, " states"]
Mode = Float[Array, " modes"]
Guards = Float[Array, " guards"]

_BISECTIONS = 60  # of a step: its length over 2^60 is below rounding
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0  # of the step size, as usual


class AbstractSwitchingSystem(eqx.Module):
    """Differential equations with modes.

    The mode is an array of a fixed shape, such as -1, 0, 1 for every friction element.
    """

    @abc.abstractmethod
    def rates(self, t: Scalar, x: State, mode: Mode) -> State:
        """Time derivative of the state in a mode."""

    @abc.abstractmethod
    def guards(self, t: Scalar, x: State, mode: Mode) -> Guards:
        """What stays non-negative as long as the mode holds."""

    @abc.abstractmethod
    def switched(
        self, t: Scalar, x: State, mode: Mode, hit: Bool[Array, " guards"]
    ) -> tuple[State, Mode]:
        """State and mode after an event.

        Args:
            t, x, mode: when a guard has become negative.
            hit: which of them.
        """

    @abc.abstractmethod
    def accepted(self, t: Scalar, x: State, mode: Mode) -> State:
        """State after a step, for memories that are renewed step by step."""


class SwitchingResult(eqx.Module):
    """What happened, at the asked times and at the events.

    Attributes:
        times: [s], shape (times,).
        x: states, (times, states).
        mode: modes, (times, modes).
        event_times: [s], (capacity,); infinite where there was no event.
        event_modes: mode after each event, (capacity, modes).
        events: number of events.
        steps: number of steps, rejected ones and those cut off included.
        completed: whether the end was reached within `max_steps` and the capacity;
            if not, the last state stands at all later times.
    """

    times: Times
    x: Float[Array, "times states"]
    mode: Float[Array, "times modes"]
    event_times: Float[Array, " capacity"]
    event_modes: Float[Array, "capacity modes"]
    events: Int[Array, ""]
    steps: Int[Array, ""]
    completed: Bool[Array, ""]


class _Carry(NamedTuple):
    t: Scalar
    x: State
    mode: Mode
    step: Scalar
    event_times: Float[Array, " capacity"]
    event_modes: Float[Array, "capacity modes"]
    events: Int[Array, ""]
    steps: Int[Array, ""]


def simulate_switching(
    system: AbstractSwitchingSystem,
    x0: State,
    mode0: Mode,
    times: Times,
    *,
    solver: dfx.AbstractERK = dfx.Tsit5(),
    step: Scalar | float | None = None,
    rtol: Scalar | float = 1e-6,
    atol: Float[Array, " states"] | Scalar | float = 1e-9,
    max_steps: int = 100_000,
    max_events: int = 1000,
    throw: bool = True,
) -> SwitchingResult:
    """Motion of a system that switches.

    Every asked time ends a step. A guard that becomes negative and positive again
    within one step is not seen: `step` bounds the steps. The result has no derivative
    by the event times that would be worth its cost; nothing here is differentiated.

    Args:
        system: the system.
        x0, mode0: state and mode at the first time; a mode whose guards are negative
            there switches at once.
        times: where the motion is wanted [s].
        solver: explicit Runge-Kutta method of diffrax with dense output.
        step: first and largest step [s]; the first interval of `times` unless given.
        rtol, atol: relative and absolute tolerance of a step.
        max_steps: bound on the steps of the whole motion.
        max_events: bound on the events; a system that switches without end reaches it.
        throw: whether an end before the last time is an error.

    Raises:
        RuntimeError: with `throw`, more steps or events than allowed.
    """
    x0, mode0 = jnp.asarray(x0), jnp.asarray(mode0, jnp.asarray(x0).dtype)
    times = jnp.asarray(times)
    largest = jnp.asarray(times[1] - times[0] if step is None else step, x0.dtype)
    atol = jnp.broadcast_to(jnp.asarray(atol, x0.dtype), x0.shape)
    field: Any = system.rates
    term: Any = dfx.ODETerm(lambda t, x, mode: field(t, x, mode))
    order = jnp.asarray(solver.order(term), x0.dtype)

    def attempt(t0, t1, x, mode):
        start = solver.init(term, t0, t1, x, mode)
        x1, error, dense, _, _ = solver.step(term, t0, t1, x, mode, start, True)
        return x1, error, dense

    def located(t0, t1, dense, mode, crossed):
        """Time of the first event of a step, and which guards it hit."""
        inside = solver.interpolation_cls(t0=t0, t1=t1, **dense)

        def halve(search):
            low, high, count = search
            middle = low + 0.5 * (high - low)
            below = jnp.any(system.guards(middle, inside.evaluate(middle), mode) < 0)
            low, high = jnp.where(below, low, middle), jnp.where(below, middle, high)
            return low, high, count + 1

        # in a batch every case comes here: without an event no halving
        enough = jnp.where(crossed, _BISECTIONS, 0)
        _, t, _ = jax.lax.while_loop(lambda s: s[2] < enough, halve, (t0, t1, 0))
        return t, system.guards(t, inside.evaluate(t), mode) < 0

    def event(carry: _Carry, t1, dense, crossing) -> _Carry:
        t, hit = located(carry.t, t1, dense, carry.mode, jnp.any(crossing))
        # the end of the step and the dense output there may differ by rounding
        hit = jnp.where(jnp.any(hit), hit, crossing)
        x, _, _ = attempt(carry.t, t, carry.x, carry.mode)
        x, mode = system.switched(t, x, carry.mode, hit)
        return carry._replace(
            t=t,
            x=x,
            mode=mode,
            event_times=carry.event_times.at[carry.events].set(t),
            event_modes=carry.event_modes.at[carry.events].set(mode),
            events=carry.events + 1,
        )

    def one_step(end, carry: _Carry) -> _Carry:
        left = end - carry.t
        last = carry.step >= left * (1 - 1e-9)
        t1 = jnp.where(last, end, carry.t + carry.step)
        x1, error, dense = attempt(carry.t, t1, carry.x, carry.mode)
        scale = atol + rtol * jnp.maximum(jnp.abs(carry.x), jnp.abs(x1))
        size = jnp.sqrt(jnp.mean((error / scale) ** 2))
        size = jnp.where(jnp.isfinite(size), jnp.maximum(size, 1e-10), 1e10)
        good = size < 1
        factor = jnp.clip(_SAFETY * size ** (-1 / order), _SHRINK, _GROW)
        tried = t1 - carry.t
        grown = jnp.maximum(carry.step, tried * factor)  # a short last step says little
        step = jnp.minimum(jnp.where(last & good, grown, tried * factor), largest)
        carry = carry._replace(step=step, steps=carry.steps + 1)
        crossing = good & (system.guards(t1, x1, carry.mode) < 0)
        x1 = system.accepted(t1, x1, carry.mode)
        onwards = carry._replace(
            t=jnp.where(good, t1, carry.t), x=jnp.where(good, x1, carry.x)
        )
        return jax.lax.cond(
            jnp.any(crossing),
            lambda: event(carry, t1, dense, crossing),
            lambda: onwards,
        )

    def unfinished(end, carry: _Carry):
        allowed = (carry.steps < max_steps) & (carry.events < max_events)
        return (carry.t < end) & allowed

    def sample(carry: _Carry, end):
        carry = jax.lax.while_loop(
            lambda c: unfinished(end, c), lambda c: one_step(end, c), carry
        )
        return carry, (carry.x, carry.mode)

    count = jnp.zeros((), jnp.int32)
    first = _Carry(
        times[0],
        x0,
        mode0,
        largest,
        jnp.full((max_events,), jnp.inf, x0.dtype),
        jnp.zeros((max_events, *mode0.shape), x0.dtype),
        count,
        count,
    )
    last, (x, mode) = jax.lax.scan(sample, first, times[1:])
    x = jnp.concatenate([x0[None], x])
    completed = last.t >= times[-1]
    if throw:
        x = eqx.error_if(
            x,
            ~completed,
            "the simulation ended early: more steps than `max_steps`, or more events "
            "than `max_events`; a system that switches ever faster needs a smooth law, "
            "another one larger bounds",
        )
    return SwitchingResult(
        times,
        x,
        jnp.concatenate([mode0[None], mode]),
        last.event_times,
        last.event_modes,
        last.events,
        last.steps,
        completed,
    )
