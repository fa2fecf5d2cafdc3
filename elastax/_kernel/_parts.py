"""Kernels whose derivatives go part by part."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

import equinox as eqx
import jax

from ._decorator import kernel


Function = TypeVar("Function", bound=Callable)


def moving_jvp(function: Callable, primals: Sequence[Any], tangents: Sequence[Any]):
    """`jax.jvp` along tangents that are `None` where nothing moves.

    Args:
        function: of the primals.
        primals: pytrees of arrays.
        tangents: the same trees, with `None` in place of zeros.
    """
    leaves, treedef = jax.tree.flatten(tuple(primals))
    rates = treedef.flatten_up_to(tuple(tangents))
    moving = [k for k, rate in enumerate(rates) if rate is not None]

    def along(*values):
        filled = list(leaves)
        for k, value in zip(moving, values):
            filled[k] = value
        return function(*jax.tree.unflatten(treedef, filled))

    start = tuple(leaves[k] for k in moving)
    return jax.jvp(along, start, tuple(rates[k] for k in moving))


def kernel_in_parts(function: Function) -> Function:
    """One kernel for values, while derivatives are those of the kernels within.

    For a function that calls others with rules of their own: as a part of one large
    kernel such a rule would be evaluated anew for every tangent.
    """
    whole = kernel(function)

    @eqx.filter_custom_jvp
    def value(*args):
        return whole(*args)

    value.def_jvp(lambda primals, tangents: moving_jvp(function, primals, tangents))

    @functools.wraps(function)
    def wrapper(*args):
        return value(*args)

    return cast(Function, wrapper)
