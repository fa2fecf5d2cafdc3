r"""Zeros of square systems, jittable, vmapped and differentiable.

The reduction of `zero_structure` with ranks that are known beforehand, which a family
of robots shares: the orders of the infinite zeros, for most systems the relative
degrees. What is left is the matrix of the zero dynamics, $A - B D^{-1} C$ of the
reduced system.

Derivatives do not go through the reduction: a simple zero z with
$P(z)\,(x, u) = 0$ and $(y, v)^H P(z) = 0$ moves by
$\delta z = (y, v)^H\,\delta S\,(x, u) / (y^H x)$, where S = [A, B; C, D].
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex

from .._custom_types import require_float64
from ._balancing import balanced


_ITERATIONS = 3
_OFF = 1e-12  # of the shift that keeps a singular matrix solvable


def transmission_zeros(
    A, B, C, D, degrees: tuple[int, ...]
) -> Complex[Array, " zeros"]:
    """Invariant zeros of a square system of known relative degrees [1/s].

    Zeros of multiplicity above one have no derivative; a system whose infinite zeros
    are others than `degrees` gets wrong ones, which `zero_structure` tells.

    Args:
        A, B, C, D: the system, as many inputs as outputs; shapes (states, states),
            (states, channels), (channels, states), (channels, channels).
        degrees: orders of the infinite zeros, one per output in any order; 0 for
            outputs that the inputs reach at once.

    Returns:
        Sorted by real part, shape (states - sum of degrees,).

    References:
        [EmamiNaeini1982] for the reduction; the derivative is that of an eigenvalue of
        a pencil.
    """
    require_float64("zeros")
    A, B, C, D = (jnp.asarray(x) for x in (A, B, C, D))
    n, m = A.shape[0], B.shape[1]
    if C.shape[0] != m or len(degrees) != m:
        raise ValueError(
            "the differentiable zeros need as many outputs as inputs and a degree for "
            f"each: there are {m} inputs, {C.shape[0]} outputs, degrees {degrees}"
        )
    if sum(degrees) > n:
        raise ValueError(f"degrees {degrees} sum to more than the {n} states")
    return _zeros(tuple(degrees), A, B, C, D)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _zeros(degrees, A, B, C, D):
    A, B, C, D = balanced(A, B, C, D)[:4]
    values = jnp.linalg.eigvals(_zero_dynamics(A, B, C, D, degrees))
    return values[jnp.lexsort((values.imag, values.real))]


@_zeros.defjvp
def _tangent(degrees, primals, tangents):
    zeros = _zeros(degrees, *primals)
    scaled = balanced(*primals)
    system = jnp.block([[scaled.A, scaled.B], [scaled.C, scaled.D]])
    dA, dB, dC, dD = tangents
    change = jnp.block([[dA, dB], [dC, dD]])
    right = jnp.concatenate([scaled.state, scaled.inputs])
    left = jnp.concatenate([scaled.state, scaled.outputs])
    change = change * right[None] / left[:, None]
    n = scaled.A.shape[0]
    whole = system.astype(zeros.dtype)
    identity = jnp.diag((jnp.arange(system.shape[0]) < n).astype(zeros.dtype))
    largest = jnp.max(jnp.abs(zeros), initial=0.0)

    def move(z):
        off = _OFF * (jnp.abs(z) + 1e-6 * largest + jnp.finfo(largest.dtype).tiny)
        factors = jax.scipy.linalg.lu_factor(
            whole - (z + off.astype(z.dtype)) * identity
        )
        x = _null_vector(factors, 0, jnp.zeros_like(z))
        # one after the other: batched solves at the same time can wait for each other
        y = _null_vector(factors, 2, 0.0 * x[0])
        weight = y.conj()[:, None] * x[None] / (y[:n].conj() @ x[:n])
        real, imaginary = jnp.sum(weight.real * change), jnp.sum(weight.imag * change)
        return jax.lax.complex(real, imaginary)

    return zeros, jax.lax.map(move, zeros)


def _null_vector(factors, transposed: int, start):
    """By inverse iteration from a vector that is hardly ever orthogonal to it."""
    size, kind = factors[0].shape[0], factors[0].dtype
    x = jnp.cos(1.0 + jnp.arange(size, dtype=factors[0].real.dtype)).astype(kind)

    def step(_, x):
        x = jax.scipy.linalg.lu_solve(factors, x, trans=transposed)
        return x / jnp.linalg.norm(x).astype(kind)

    return jax.lax.fori_loop(0, _ITERATIONS, step, x + start)


def _zero_dynamics(A, B, C, D, degrees):
    m = len(degrees)
    for order in range(max(degrees, default=0)):
        rank = sum(r <= order for r in degrees)
        if rank:
            left, _, _ = jnp.linalg.svd(D)
            C, D = left.T @ C, left.T @ D
        seen = m - rank
        basis, _ = jnp.linalg.qr(C[rank:].T, mode="complete")
        turn = jnp.concatenate([basis[:, seen:], basis[:, :seen]], axis=1)
        A, B, C_1 = turn.T @ A @ turn, turn.T @ B, C[:rank] @ turn
        n = A.shape[0] - seen
        A, B, C, D = (
            A[:n, :n],
            B[:n],
            jnp.concatenate([A[n:, :n], C_1[:, :n]]),
            jnp.concatenate([B[n:], D[:rank]]),
        )
    if not m:
        return A
    return A - B @ jnp.linalg.solve(D, C)
