"""Scaling of a state-space system, so that ranks can be told from rounding."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np


_SWEEPS = 12


class Balanced(NamedTuple):
    """Scaled matrices, with the same zeros and, scaled back, the same transfer.

    Attributes:
        A, B, C, D: scaled.
        state, inputs, outputs: factors: x = state * scaled x, and so on.
    """

    A: Any
    B: Any
    C: Any
    D: Any
    state: Any
    inputs: Any
    outputs: Any


def balanced(A, B, C, D) -> Balanced:
    r"""States, inputs and outputs scaled until rows and columns have like norms.

    Powers of two, so that scaling rounds nothing; JAX's own are exact to rounding.
    NumPy arrays stay such.

    References:
        [Osborne1960].
    """
    xp: Any = np if isinstance(A, np.ndarray) else jnp
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    inside = 1.0 - xp.eye(n, dtype=A.dtype)
    # powers of two have no derivative
    fixed = (A, B, C) if xp is np else jax.lax.stop_gradient((A, B, C))

    def sweep(_, factors):
        state, inputs, outputs = factors
        A, B, C = fixed
        a = A * inside * state[None] / state[:, None]
        b = B * inputs[None] / state[:, None]
        c = C * state[None] / outputs[:, None]
        rows = xp.sqrt(xp.sum(a**2, axis=1) + xp.sum(b**2, axis=1))
        columns = xp.sqrt(xp.sum(a**2, axis=0) + xp.sum(c**2, axis=0))
        state = state * _power(xp, rows / xp.where(columns > 0, columns, 1.0), 0.5)
        size = xp.max(xp.abs(A) * state[None] / state[:, None], initial=0.0)
        size = xp.where(size > 0, size, 1.0)
        b = B * inputs[None] / state[:, None]
        c = C * state[None] / outputs[:, None]
        inputs = inputs * _power(xp, size / _norm(xp, b, 0))
        outputs = outputs * _power(xp, _norm(xp, c, 1) / size)
        return state, inputs, outputs

    factors = tuple(xp.ones((k,), A.dtype) for k in (n, m, p))
    if xp is np:
        for k in range(_SWEEPS):
            factors = sweep(k, factors)
    else:
        factors = jax.lax.fori_loop(0, _SWEEPS, sweep, factors)
    state, inputs, outputs = factors
    return Balanced(
        A * state[None] / state[:, None],
        B * inputs[None] / state[:, None],
        C * state[None] / outputs[:, None],
        D * inputs[None] / outputs[:, None],
        state,
        inputs,
        outputs,
    )


def _norm(xp, matrix, axis: int):
    size = xp.sqrt(xp.sum(matrix**2, axis=axis))
    return xp.where(size > 0, size, 1.0)


def _power(xp, factor, exponent: float = 1.0):
    """The next power of two to `factor ** exponent`; one where that is no number."""
    good = (factor > 0) & xp.isfinite(factor)
    safe = xp.where(good, factor, 1.0)
    return xp.exp2(xp.round(exponent * xp.log2(safe)))
