r"""Response of a gear with a memory to a given torque.

The torsion x and the memory z of the branch obey

$d\,\dot x = f - k(x) - b(x, z),\qquad \dot z = g(x, \dot x, z)$

for each axis by itself. As for a gear without a memory, the formula of Hermite and
Obreschkoff with the derivatives of f takes a sample at once; the equations of a step
are solved by Newton's method with one matrix per sample.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Scalar
from .._taylor import Series
from ..drivetrain import AbstractGearBranch, DriveTrain
from ._response import combine, pade


Augmented = Float[Array, "unknowns axes"]  # the torsion above the memory

_NEWTON_STEPS = 6  # linear convergence: the slope of the step's start serves for all


def gear_field(drives: DriveTrain, branch: AbstractGearBranch) -> Callable:
    """Rate of (x, z) as a function of (x, z) and the torque f."""

    def field(state: Augmented, torque: Float[Array, " axes"]) -> Augmented:
        torsion, memory = state[0], state[1:]
        resting = drives.gear_torque(torsion, jnp.zeros_like(torsion), memory)
        rate = (torque - resting) / drives.damping
        return jnp.concatenate([rate[None], branch.rates(torsion, rate, memory)])

    return field


def memory_response(field: Callable, state: Augmented, forcing: Series) -> Series:
    """Torsion and memory with derivatives, one order more than the forcing."""
    terms = [state]
    for k in range(forcing.order + 1):
        terms.append(_time_derivative(field, terms, forcing, k) / (k + 1))
    return Series(jnp.stack(terms))


def _time_derivative(field: Callable, terms: list, forcing: Series, order: int):
    """Taylor coefficient `order` of the field along a motion known so far."""

    def along(t):
        state, torque = terms[-1], forcing.coefficients[order]
        for k in range(order - 1, -1, -1):
            state = terms[k] + t * state
            torque = forcing.coefficients[k] + t * torque
        return field(state, torque)

    factorial = 1.0
    for k in range(order):
        along = _rate(along)
        factorial *= k + 1.0
    return along(jnp.zeros((), terms[0].dtype)) / factorial


def _rate(function: Callable) -> Callable:
    return lambda t: jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


def advance_memory(
    field: Callable, state: Augmented, before: Series, after: Series, dt: Scalar | float
) -> Augmented:
    """Torsion and memory one sample later.

    Args:
        field: of `gear_field`.
        state: torsion and memory at the start of the sample.
        before, after: torque f at its ends, order p.
        dt: length of the sample [s]; zero returns `state`.

    Returns:
        State at the end; local error of order 2 p + 2 in dt.
    """
    order = before.order + 1
    explicit, implicit = pade(order - 1, order)
    known = combine(explicit, memory_response(field, state, before), dt)
    slope = _slopes(lambda s: field(s, after.coefficients[0]), state)
    unit = jnp.eye(state.shape[0], dtype=state.dtype)
    matrix = unit[:, :, None] * implicit[-1]
    for weight in implicit[-2::-1]:  # the same polynomial of the slope, after Horner
        matrix = -dt * jnp.einsum("abn,bcn->acn", slope, matrix)
        matrix = matrix + weight * unit[:, :, None]
    now = state
    for _ in range(_NEWTON_STEPS):
        reached = combine(implicit, memory_response(field, now, after), -dt)
        now = now - solve_small(matrix, reached - known)
    return now


def _slopes(function: Callable, state: Augmented) -> Float[Array, "row column axes"]:
    """Derivative of a function of each axis by itself, the axes last."""
    columns = []
    for k in range(state.shape[0]):
        direction = jnp.zeros_like(state).at[k].set(1.0)
        columns.append(jax.jvp(function, (state,), (direction,))[1])
    return jnp.stack(columns, axis=1)


def solve_small(
    matrix: Float[Array, "row column axes"], right: Float[Array, "row axes"]
) -> Float[Array, "row axes"]:
    """Solution of a small system per axis by elimination, without pivoting.

    The matrices here are near the identity plus a stable part; no LAPACK, whose calls
    for batches side by side can wait for each other for ever.
    """
    n = right.shape[0]
    rows = [jnp.concatenate([matrix[k], right[k][None]]) for k in range(n)]
    for k in range(n):
        rows[k] = rows[k] / rows[k][k][None]
        for j in range(n):
            if j != k:
                rows[j] = rows[j] - rows[j][k][None] * rows[k]
    return jnp.stack([row[n] for row in rows])
