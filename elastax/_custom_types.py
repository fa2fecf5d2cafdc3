"""Array aliases with named axes, and the converter of real parameters."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


Scalar = Float[Array, ""]
PerJoint = Float[Array, " joints"]
PerElastic = Float[Array, " elastic"]
Vector3 = Float[Array, "3"]
Matrix3 = Float[Array, "3 3"]
Transform = Float[Array, "4 4"]
Times = Float[Array, " times"]


def as_real(value: Any) -> Array:
    """`value` as a floating-point array of a definite type.

    Numbers and integer arrays take the default float type.
    """
    default = jax.dtypes.canonicalize_dtype(jnp.float64)
    if isinstance(value, int | float | np.ndarray | np.generic):
        array = np.asarray(value)
        real = np.issubdtype(array.dtype, np.floating)
        # unlike `jnp.asarray`, this compiles nothing: records hold dozens of arrays
        return jax.device_put(array if real else array.astype(default))
    array = jnp.asarray(value)
    real = jnp.issubdtype(array.dtype, jnp.floating)
    return jnp.asarray(array, array.dtype if real else default)


def as_optional_real(value: Any) -> Array | None:
    """Like `as_real`, but `None` stays `None`."""
    return None if value is None else as_real(value)


def require_float64(what: str) -> None:
    """Raise unless double precision is switched on.

    Args:
        what: the computation that needs it, for the message.

    Raises:
        ValueError: JAX runs in single precision.
    """
    if jnp.zeros(()).dtype != jnp.float64:
        raise ValueError(
            f"{what} needs double precision: call "
            '`jax.config.update("jax_enable_x64", True)` before any other JAX call'
        )
