r"""Truncated Taylor arithmetic: a quantity together with its time derivatives.

A `Series` of order $p$ holds the coefficients $x_k = x^{(k)}(t_0)/k!$, $k = 0..p$,
along its leading axis. Whatever is written with the functions of this module runs on
plain arrays and on series alike, so that a recursion gives its own time derivatives:
the operation count grows with $p^2$, the size of the program hardly at all.

Sums and products follow the Leibniz rule; smooth functions of one argument are composed
from the derivatives of the function at the leading coefficient.
"""

import functools
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Series(eqx.Module):
    """Taylor coefficients of a time-dependent array.

    Attributes:
        coefficients: shape (order + 1, ...); entry k is the k-th derivative over k!.
    """

    coefficients: Float[Array, " terms *shape"]

    @property
    def order(self) -> int:
        return self.coefficients.shape[0] - 1

    @property
    def shape(self) -> tuple[int, ...]:
        return self.coefficients.shape[1:]

    @property
    def ndim(self) -> int:
        return self.coefficients.ndim - 1

    def __getitem__(self, index) -> "Series":
        index = index if isinstance(index, tuple) else (index,)
        return Series(self.coefficients[(slice(None), *index)])

    def __neg__(self) -> "Series":
        return Series(-self.coefficients)

    def __add__(self, other) -> "Series":
        if isinstance(other, Series):
            p = min(self.order, other.order) + 1
            return Series(self.coefficients[:p] + other.coefficients[:p])
        other = other if jnp.ndim(other) == 0 else jnp.asarray(other)[None]
        head = self.coefficients[:1] + other
        return Series(jnp.concatenate([head, self.coefficients[1:]]))

    def __radd__(self, other) -> "Series":
        return self + other

    def __sub__(self, other) -> "Series":
        return self + (-other)

    def __rsub__(self, other) -> "Series":
        return (-self) + other

    def __mul__(self, other) -> "Series":
        letters = "abcdef"[: self.ndim]
        return product(f"{letters},{letters}->{letters}", self, other)

    def __rmul__(self, other) -> "Series":
        return self * other

    def derivatives(self) -> Float[Array, " terms *shape"]:
        """Time derivatives of order 0 to `order`, shape (order + 1, ...)."""
        return self.coefficients * _factorials(self.order, self.ndim)

    def rate(self) -> "Series":
        """Time derivative, one order lower."""
        k = np.arange(1.0, self.order + 1).reshape(-1, *(1,) * self.ndim)
        return Series(self.coefficients[1:] * k)

    def truncated(self, order: int) -> "Series":
        """The same quantity with its derivatives up to `order`."""
        return Series(self.coefficients[: order + 1])


def _factorials(order: int, ndim: int) -> np.ndarray:
    factorials = np.array([float(math.factorial(k)) for k in range(order + 1)])
    return factorials.reshape(-1, *(1,) * ndim)


def from_derivatives(derivatives: Float[Array, " terms *shape"]) -> Series:
    """Series with the given time derivatives 0, 1, 2, ... along the leading axis."""
    order, ndim = derivatives.shape[0] - 1, derivatives.ndim - 1
    return Series(derivatives / _factorials(order, ndim))


def leading(x: Any) -> Any:
    """Value at the expansion point of an array or a series."""
    return x.coefficients[0] if isinstance(x, Series) else x


@functools.cache
def _leibniz(order: int) -> np.ndarray:
    """Constant tensor with ones where k = i + j."""
    i = np.arange(order + 1)
    return (i[:, None, None] == i[None, :, None] + i[None, None, :]).astype(float)


def product(subscripts: str, a: Any, b: Any) -> Any:
    """`jnp.einsum(subscripts, a, b)` where either operand may be a `Series`.

    Of two series the product has the lower order.
    """
    if not isinstance(a, Series) and not isinstance(b, Series):
        return jnp.einsum(subscripts, a, b)
    inputs, output = subscripts.split("->")
    left, right = inputs.split(",")
    if not isinstance(b, Series):
        if jnp.ndim(b) == 0:
            return Series(a.coefficients * b)
        return Series(
            jnp.einsum(f"Z{left},{right}->Z{output}", a.coefficients, jnp.asarray(b))
        )
    if not isinstance(a, Series):
        if jnp.ndim(a) == 0:
            return Series(b.coefficients * a)
        return Series(
            jnp.einsum(f"{left},Z{right}->Z{output}", jnp.asarray(a), b.coefficients)
        )
    order = min(a.order, b.order)
    tensor = jnp.asarray(_leibniz(order), a.coefficients.dtype)
    return Series(
        jnp.einsum(
            f"ZXY,X{left},Y{right}->Z{output}",
            tensor,
            a.coefficients[: order + 1],
            b.coefficients[: order + 1],
        )
    )


def linear(function: Callable, x: Any) -> Any:
    """Apply a linear map, acting on arrays, to an array or to each coefficient."""
    if isinstance(x, Series):
        return Series(jax.vmap(function)(x.coefficients))
    return function(x)


def concatenate(parts: Any, axis: int = 0) -> Any:
    """`jnp.concatenate` of arrays, or of series of equal order."""
    if isinstance(parts[0], Series):
        return Series(
            jnp.concatenate([part.coefficients for part in parts], axis=axis + 1)
        )
    return jnp.concatenate(parts, axis=axis)


def stack(parts: Any, axis: int = 0) -> Any:
    """`jnp.stack` of arrays, or of series of equal order."""
    if isinstance(parts[0], Series):
        return Series(jnp.stack([p.coefficients for p in parts], axis=axis + 1))
    return jnp.stack(parts, axis=axis)


LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    LEVI_CIVITA[_i, _j, _k] = 1.0
    LEVI_CIVITA[_i, _k, _j] = -1.0


def skew(vector: Any) -> Any:
    r"""Matrix $\tilde a$ with $\tilde a b = a \times b$, shape (..., 3, 3).

    References:
        [Reiner2010] (A.2).
    """
    tensor = jnp.asarray(LEVI_CIVITA, leading(vector).dtype)
    return linear(lambda v: -jnp.tensordot(v, tensor, axes=(-1, 2)), vector)


def cross(a: Any, b: Any) -> Any:
    """Cross product along the last axis of arrays or series of equal shape."""
    letters = "abcdef"[: a.ndim - 1]
    return product(f"{letters}uv,{letters}v->{letters}u", skew(a), b)


def compose(function: Callable, x: Any) -> Any:
    """`function(x)` for a smooth function that acts on every element by itself.

    The derivatives of `function` at the leading coefficient come from nested `jvp`; the
    composition is Horner's scheme in the increment.
    """
    if not isinstance(x, Series):
        return function(x)
    x0, order = x.coefficients[0], x.order
    derivatives, f = [], function
    for _ in range(order + 1):
        derivatives.append(f(x0))
        f = _derivative(f)
    increment = Series(x.coefficients.at[0].set(0.0))
    total = Series(
        jnp.zeros_like(x.coefficients)
        .at[0]
        .set(derivatives[order] / math.factorial(order))
    )
    for k in range(order - 1, -1, -1):
        total = total * increment + derivatives[k] / math.factorial(k)
    return total


def _derivative(function: Callable) -> Callable:
    return lambda x: jax.jvp(function, (x,), (jnp.ones_like(x),))[1]


def sin_cos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine of an array or a series, by their coupled recurrence."""
    if not isinstance(x, Series):
        return jnp.sin(x), jnp.cos(x)
    a = x.coefficients
    zero = jnp.zeros_like(a[0])
    sine, cosine = [jnp.sin(a[0])], [jnp.cos(a[0])]
    for k in range(1, x.order + 1):
        terms = [(i * a[i], k - i) for i in range(1, k + 1)]
        sine.append(sum((r * cosine[j] for r, j in terms), zero) / k)
        cosine.append(-sum((r * sine[j] for r, j in terms), zero) / k)
    return Series(jnp.stack(sine)), Series(jnp.stack(cosine))


def solve_positive(matrix: Any, right: Any) -> Any:
    r"""Solution of $A x = b$ for a symmetric positive definite $A$ and a vector $b$.

    For series $A_0 x_k = b_k - \sum_{i=1}^{k} A_i x_{k-i}$: one factorisation.
    """
    factor = jax.scipy.linalg.cho_factor(leading(matrix))
    if not isinstance(matrix, Series):
        return jax.scipy.linalg.cho_solve(factor, right)
    a, b = matrix.coefficients, right.coefficients
    x = []
    for k in range(min(matrix.order, right.order) + 1):
        rest = b[k] - sum(
            (a[i] @ x[k - i] for i in range(1, k + 1)), jnp.zeros_like(b[k])
        )
        x.append(jax.scipy.linalg.cho_solve(factor, rest))
    return Series(jnp.stack(x))
