"""The decorator that turns a function of small arrays into a kernel."""

import contextlib
import contextvars
import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np

from ._primitive import kernel_p
from ._program import Program, trace


_ENABLED = contextvars.ContextVar("elastax_kernels", default=True)


@contextlib.contextmanager
def written_out():
    """Trace functions under `kernel` as they are written, the reference route.

    What `jax.jit` has traced before stays as it was traced.
    """
    token = _ENABLED.set(False)
    try:
        yield
    finally:
        _ENABLED.reset(token)


Function = TypeVar("Function", bound=Callable)


def _is_number(leaf: Any) -> bool:
    """A floating-point number or array, traced or not."""
    dtype = getattr(leaf, "dtype", None)
    if dtype is None:
        return isinstance(leaf, float)
    return jnp.issubdtype(dtype, np.floating)


def _varies(leaf: Any) -> bool:
    """Whether it differs, as far as JAX keeps account, between devices."""
    return bool(jax.typeof(leaf).manual_axis_type.varying)


def _is_constant(leaf: Any) -> bool:
    """Something that may be part of the key under which a program is kept."""
    return isinstance(leaf, (bool, int, str)) or callable(leaf)


def kernel(function: Function) -> Function:
    """Compile a function of pytrees of small floating-point arrays as one kernel.

    The result is called, differentiated and batched like the function. All arrays must
    have one floating-point type; a call with others runs the function as it is. The
    function is traced once for every structure and every set of shapes, never for
    values, and must depend on its arguments alone.
    """
    programs: dict[Any, tuple[Program, Any] | None] = {}

    def traced(treedef, numeric, leaves) -> tuple[Program, Any] | None:
        structures = []

        def flat(*numbers):
            given = iter(numbers)
            filled = [next(given) if n else x for n, x in zip(numeric, leaves)]
            args, kwargs = jax.tree.unflatten(treedef, filled)
            outputs, structure = jax.tree.flatten(function(*args, **kwargs))
            structures.append(structure)
            return outputs

        numbers = [x for n, x in zip(numeric, leaves) if n]
        name = getattr(function, "__name__", "function")
        program = trace(flat, numbers, name)
        dtype = numbers[0].dtype
        plain = program.closed.effects or not program.outputs
        if plain or any(a.dtype != dtype for a in program.outputs):
            return None
        return program, structures[0]

    @functools.wraps(function)
    def wrapper(*args, **kwargs):
        if not _ENABLED.get():
            return function(*args, **kwargs)
        leaves, treedef = jax.tree.flatten((args, kwargs))
        numeric = tuple(_is_number(x) for x in leaves)
        leaves = [jnp.asarray(x) if n else x for n, x in zip(numeric, leaves)]
        numbers = [x for n, x in zip(numeric, leaves) if n]
        constants = [x for n, x in zip(numeric, leaves) if not n]
        if (
            not numbers
            or any(x.dtype != numbers[0].dtype or _varies(x) for x in numbers)
            or not all(map(_is_constant, constants))
        ):
            return function(*args, **kwargs)
        shapes = tuple(x.shape for x in numbers)
        kinds = (numeric, numbers[0].dtype, jax.dtypes.canonicalize_dtype(float))
        # with the types, as True == 1
        key = (treedef, kinds, tuple((type(x), x) for x in constants), shapes)
        if key not in programs:
            programs[key] = traced(treedef, numeric, leaves)
        found = programs[key]
        if found is None:
            return function(*args, **kwargs)
        program, structure = found
        outputs = kernel_p.bind(*numbers, program=program, levels=())
        return jax.tree.unflatten(structure, outputs)

    return cast(Function, wrapper)
