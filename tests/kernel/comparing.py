"""What the tests of kernels share: is it a kernel, and does it agree with the plain?"""

import jax
import jax.numpy as jnp
import numpy as np
from elastax._kernel import kernel
from elastax._kernel._program import Program, trace


X = jnp.array([0.3, -1.2, 2.5])
Y = jnp.array([-0.7, 0.4, 1.1])
M = jnp.array([[2.0, 0.3, -0.1], [0.3, 3.0, 0.2], [-0.1, 0.2, 1.5]])


def program_of(function, *args) -> Program:
    """Program of a function of arrays that returns one array or a list."""
    flat = lambda *xs: jax.tree.leaves(function(*xs))
    return trace(flat, args, "program")


def is_kernel(function, *args) -> bool:
    """Whether all that the function lowers to is kernels."""
    return "mhlo.fusion" in jax.jit(lambda *xs: function(*xs)).lower(*args).as_text()


def assert_same(actual, desired, rtol: float = 1e-12, atol: float = 1e-14) -> None:
    """Assert equal structure, shapes, types and values, NaN included."""
    assert jax.tree.structure(actual) == jax.tree.structure(desired)
    for one, other in zip(jax.tree.leaves(actual), jax.tree.leaves(desired)):
        assert one.shape == other.shape and one.dtype == other.dtype
        np.testing.assert_allclose(one, other, rtol=rtol, atol=atol)


def assert_agrees(function, *args, fused: bool | None = None, rtol=1e-12) -> None:
    """Assert that the kernel of a function gives what the function gives.

    Args:
        function: of arrays.
        args: arrays.
        fused: whether the kernel must be one, or must not; `None` for either.
        rtol: bound on the relative difference.
    """
    compiled = kernel(function)
    if fused is not None:
        assert is_kernel(compiled, *args) == fused
    one = jax.jit(lambda *xs: compiled(*xs))(*args)
    other = jax.jit(lambda *xs: function(*xs))(*args)
    assert_same(one, other, rtol=rtol)
