"""Relative degree and decoupling matrix of nonlinear systems."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._balancing import balanced
from ._control_system import ControlSystem, linearise
from ._lie import input_lie_derivative, lie_derivative


_ROUNDING = 1e-10  # of nested derivatives, over slope times field in balanced states
_REGULAR = 1e-9  # smallest over largest singular value of a decoupling matrix
_NEAR = 1e-3  # how far "near" points are, over the size of the state


class RelativeDegree(eqx.Module):
    """Vector relative degree at a point.

    Attributes:
        degrees: r_i, one per output.
        decoupling: A(x) of (3.16), shape (outputs, inputs).
        singular_values: of the decoupling matrix, rows scaled to one.
    """

    decoupling: Float[Array, "outputs inputs"]
    singular_values: Float[Array, " values"]
    degrees: tuple[int, ...] = eqx.field(static=True)

    @property
    def total(self) -> int:
        """Sum of the degrees; the zero dynamics have so many states less."""
        return sum(self.degrees)


def decoupling_matrix(
    system: ControlSystem, x, degrees: tuple[int, ...]
) -> Float[Array, "outputs inputs"]:
    r"""Rows $L_g L_f^{r_i - 1} h_i$ of (3.16); jittable.

    Args:
        system: the system.
        x: state.
        degrees: r_i, at least one.
    """
    rows = []
    for i, degree in enumerate(degrees):
        output = lambda x, i=i: system.output(x)[i]
        lower = lie_derivative(system.drift, output, degree - 1)
        rows.append(input_lie_derivative(system.input_matrix, lower)(x))
    return jnp.stack(rows)


def relative_degree(system: ControlSystem, x) -> RelativeDegree:
    r"""Relative degree of every output at a state.

    r_i is the order of the first time derivative of an output in which an input
    appears: $L_g L_f^k h_i = 0$ for $k < r_i - 1$ near the state, and not for
    $k = r_i - 1$ at it. Zeros are told from rounding by the size of the products that a
    derivative sums, in states that are balanced at the point, and from zeros at this
    point alone by points near it.

    Args:
        system: affine in its inputs.
        x: state, shape (states,).

    Raises:
        ValueError: the degree is not defined at the state: no input reaches an output,
            a derivative vanishes there but not near it, or the decoupling matrix is
            singular.

    References:
        [Reiner2010] (3.5), (3.15), (3.16); [Isidori1995].
    """
    x = jnp.asarray(x)
    system.check(x)
    if system.outputs > system.inputs:
        raise ValueError(
            f"{system.outputs} outputs cannot be set by {system.inputs} inputs: a "
            "relative degree needs at most as many outputs as inputs"
        )
    spread = _NEAR * (1.0 + np.abs(np.asarray(x)))
    draw = np.random.default_rng(0).uniform(-1.0, 1.0, (3, system.states))
    points = np.concatenate([np.zeros_like(draw[:1]), draw * spread]) + np.asarray(x)
    linear = linearise(system, x, np.zeros((system.inputs,), x.dtype))
    matrices = (linear.A, linear.B, linear.C, linear.D)
    scale = balanced(*map(np.asarray, matrices)).state
    degrees: dict[int, int] = {}
    for order in range(system.states):
        row, size = map(np.asarray, _rows(system, order, scale, points))
        there = np.any(np.abs(row) > _ROUNDING * size, axis=2)
        for i in range(system.outputs):
            if i in degrees:
                continue
            if there[0, i]:
                degrees[i] = order + 1
            elif there[1:, i].any():
                raise ValueError(
                    "the relative degree is not defined at this state: an input "
                    f"appears in derivative {order + 1} of `{system.names.outputs[i]}` "
                    "near it, but not at it; choose another state or output"
                )
        if len(degrees) == system.outputs:
            break
    for i, name in enumerate(system.names.outputs):
        if i not in degrees:
            raise ValueError(
                f"no input reaches the output `{name}` by any derivative: its relative "
                "degree is not defined"
            )
    found = tuple(degrees[i] for i in range(system.outputs))
    matrix, values = _decoupled(system, x, found)
    if float(values[-1]) <= _REGULAR * float(values[0]):
        raise ValueError(
            f"the relative degree is not defined at this state: the decoupling matrix "
            f"of the degrees {found} is singular (singular values "
            f"{float(values[0]):.3g} to {float(values[-1]):.3g}); choose another state "
            "or other outputs, or extend the inputs by integrators"
        )
    return RelativeDegree(matrix, values, found)


def scaled_singular_values(matrix) -> Float[Array, " values"]:
    """Singular values of a decoupling matrix, its rows scaled to length one."""
    length = jnp.linalg.norm(matrix, axis=1, keepdims=True)
    return jnp.linalg.svd(matrix / jnp.where(length > 0, length, 1.0), compute_uv=False)


@eqx.filter_jit
def _decoupled(system: ControlSystem, x, degrees: tuple[int, ...]):
    matrix = decoupling_matrix(system, x, degrees)
    return matrix, scaled_singular_values(matrix)


@eqx.filter_jit
def _rows(system: ControlSystem, order: int, scale, points):
    """L_g L_f^k h of all outputs, and what rounding can make of it, at points."""
    lower = lie_derivative(system.drift, system.output, order)

    def at(x):
        slope, fields = jax.jacfwd(lower)(x), system.input_matrix(x)
        slope_size = jnp.linalg.norm(slope * scale[None], axis=1)
        field_size = jnp.linalg.norm(fields / scale[:, None], axis=0)
        return slope @ fields, slope_size[:, None] * field_size[None]

    return jax.vmap(at)(points)
