"""Different laws on the axes of one robot, each acting on its own axes alone."""

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array


Axes = tuple[tuple[int, ...], ...]


def check_axes(laws: Sequence[Any], axes: Axes) -> None:
    """Check that every axis, from 0 without a gap, has one law.

    Raises:
        ValueError: it has none or more, or the numbers of laws and groups differ.
    """
    if len(laws) != len(axes):
        raise ValueError(
            f"`axes` must have a group for each of the {len(laws)} laws, but has "
            f"{len(axes)}"
        )
    given = sorted(axis for group in axes for axis in group)
    if not given or given != list(range(len(given))) or not all(axes):
        raise ValueError(
            f"`axes` must name every axis from 0 once and leave no law without an "
            f"axis, but is {axes}"
        )


def on_axes(value: Array | float, group: tuple[int, ...]) -> Array:
    """Entries of the last axis that belong to the `group`; a scalar is for all."""
    value = jnp.asarray(value)
    return value if value.ndim == 0 else value[..., np.array(group)]


def along_axes(axes: Axes, functions: Sequence[Callable], argument: Array) -> Array:
    """Apply to every group of the last axis its own elementwise function."""
    order = [axis for group in axes for axis in group]
    if argument.shape[-1] != len(order):
        raise ValueError(
            f"the laws hold for {len(order)} axes, but the argument has "
            f"{argument.shape[-1]}"
        )
    parts = [
        function(on_axes(argument, group))
        for function, group in zip(functions, axes, strict=True)
    ]
    joined = jnp.concatenate(parts, axis=-1)
    if order == sorted(order):
        return joined
    return joined[..., np.argsort(order)]
