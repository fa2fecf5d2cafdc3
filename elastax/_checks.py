"""Validation at construction: shapes by annotation, values by condition."""

import dataclasses

import equinox as eqx
import jax
import jax.core
import numpy as np
from jaxtyping import jaxtyped


def is_concrete(*arrays) -> bool:
    """Whether every array holds numbers now, instead of being traced."""
    return not any(isinstance(array, jax.core.Tracer) for array in arrays)


def check_fields(module: eqx.Module) -> None:
    """Check every field of `module` against its jaxtyping annotation.

    Axis names are shared by the fields, so that equal names must agree in size.

    Raises:
        ValueError: a field has another shape or type than its annotation.
    """
    with jaxtyped("context"):
        for field in dataclasses.fields(module):
            value = getattr(module, field.name)
            if isinstance(field.type, str) or not hasattr(field.type, "dtype"):
                continue
            if isinstance(value, jax.ShapeDtypeStruct) or not hasattr(value, "shape"):
                continue
            if not isinstance(value, field.type):
                raise ValueError(
                    f"`{field.name}` of {type(module).__name__} must have the shape "
                    f"[{field.type.dim_str}], agreeing with the other fields, but has "
                    f"{tuple(value.shape)}"
                )


def check_values(message: str, value, condition) -> None:
    """Raise `ValueError` where a concrete `condition` is false.

    Args:
        message: what must hold, such as "`mass` must be positive".
        value: the offending quantity, printed.
        condition: boolean array; traced ones are not checked.
    """
    if is_concrete(value, condition) and not np.all(np.asarray(condition)):
        raise ValueError(f"{message}, but is {np.array2string(np.asarray(value))}")
