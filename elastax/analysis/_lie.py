r"""Lie derivatives by automatic differentiation.

$L_f h = \frac{\partial h}{\partial x} f$, the rate of h along the field f: one
Jacobian-vector product, whose repetition needs no formula.
"""

from collections.abc import Callable

import jax


def lie_derivative(field: Callable, function: Callable, order: int = 1) -> Callable:
    r"""The function $L_f^k h$ of the state.

    Args:
        field: f, from the state to its rate.
        function: h, from the state to an array.
        order: k, 0 for the function itself.

    References:
        [Reiner2010] (A.1), section A.3.

    Examples:
        >>> lie_derivative(system.drift, system.output, 2)(x)
    """
    if order < 0:
        raise ValueError(f"`order` must not be negative, but is {order}")
    if order == 0:
        return function
    lower = lie_derivative(field, function, order - 1)
    return lambda x: jax.jvp(lower, (x,), (field(x),))[1]


def input_lie_derivative(input_matrix: Callable, function: Callable) -> Callable:
    r"""The function $L_g h$, one column per input field.

    Args:
        input_matrix: g, from the state to (states, inputs).
        function: h, from the state to an array.
    """

    def derivative(x):
        along = lambda column: jax.jvp(function, (x,), (column,))[1]
        return jax.vmap(along, in_axes=1, out_axes=-1)(input_matrix(x))

    return derivative
