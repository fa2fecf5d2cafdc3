"""Comparisons, derivative checks and test vectors shared by the tests."""

import json
import pathlib
import re
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np


VECTORS = pathlib.Path(__file__).resolve().parent / "vectors"


def assert_close(actual, desired, *, rtol: float, atol: float = 0.0) -> None:
    """Assert that two pytrees agree leaf by leaf, in shape and in value.

    Args:
        actual: pytree of arrays and numbers; other leaves must be equal.
        desired: pytree of the same structure; where `actual` has an array, nested lists
            of numbers will do.
        rtol: bound on the difference over the desired magnitude.
        atol: bound that is added to it.
    """
    leaves, structure = jax.tree_util.tree_flatten_with_path(actual)
    try:
        others = structure.flatten_up_to(desired)
    except (TypeError, ValueError) as error:
        raise AssertionError(f"the structures differ: {error}") from None
    for (path, leaf), other in zip(leaves, others, strict=True):
        name = f"at {jax.tree_util.keystr(path)}" if path else ""
        if not eqx.is_array_like(leaf):
            assert leaf == other, f"{leaf} != {other} {name}"
            continue
        left, right = np.asarray(leaf), np.asarray(other)
        assert left.shape == right.shape, f"{left.shape} != {right.shape} {name}"
        for side, values in (("actual", left), ("desired", right)):
            assert not np.any(np.isnan(values)), f"NaN in `{side}` {name}: {values}"
        np.testing.assert_allclose(left, right, rtol=rtol, atol=atol, err_msg=name)


def assert_gradient(
    function: Callable[..., Any],
    *args,
    order: int = 1,
    rtol: float = 1e-6,
    step: float = 1e-4,
    seed: int = 0,
) -> None:
    """Assert that forward and reverse derivatives agree with central differences.

    Every floating-point leaf of `args` is scaled to order one, entry by entry, and
    moved along a random direction. The difference of four points leaves a truncation
    error of `step**4` and a rounding error of the machine's over `step`.

    Args:
        function: takes `args` and returns a pytree; its floating-point leaves count.
        order: 1, or 2 for the derivatives of the forward and of the reverse one.
        rtol: bound on the difference over the largest derivative of the same output.
        step: of the scaled leaves.
        seed: of the random directions.
    """
    moving, fixed = eqx.partition(args, eqx.is_inexact_array)
    scales, unravel = jax.flatten_util.ravel_pytree(jax.tree.map(_scale, moving))
    start, _ = jax.flatten_util.ravel_pytree(moving)
    if start.size == 0:
        raise ValueError("`args` must hold a floating-point array, but do not")

    def outputs(point):
        result = function(*eqx.combine(unravel(point * scales), fixed))
        return jax.tree.leaves(eqx.filter(result, eqx.is_inexact_array))

    generator = np.random.default_rng(seed)
    _check_derivatives(outputs, start / scales, order, rtol, step, generator)


def _scale(leaf):
    """Magnitude of every entry; small ones take a thousandth of the largest."""
    size = jnp.abs(leaf)
    largest = jnp.max(size, initial=0.0)
    return jnp.where(largest > 0, jnp.maximum(size, 1e-3 * largest), 1.0)


def _check_derivatives(outputs, point, order, rtol, step, generator) -> None:
    """Check the derivatives of `outputs`, a function from a vector to a list."""
    shapes = jax.eval_shape(outputs, point)
    if not shapes:
        raise ValueError("`function` must return a floating-point array, but does not")
    random = lambda shape: jnp.asarray(generator.standard_normal(shape))
    direction = random(point.shape)
    weights = jax.tree.map(lambda shape: random(shape.shape), shapes)

    def forward(point):
        return jax.jvp(outputs, (point,), (direction,))[1]

    def reverse(point):
        return list(jax.vjp(outputs, point)[1](weights))

    @jax.jit
    def evaluate(point):
        steps = step * jnp.array([-2.0, -1.0, 1.0, 2.0])
        values = jax.lax.map(lambda length: outputs(point + length * direction), steps)
        return values, forward(point), reverse(point)[0]

    values, tangents, cotangent = jax.device_get(evaluate(point))
    stencil = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)
    left = rounding = 0.0
    for value, tangent, weight in zip(values, tangents, weights, strict=True):
        weight = np.asarray(weight)
        assert np.all(np.isfinite(value)), f"the function is not finite: {value}"
        assert np.all(np.isfinite(tangent)), f"forward derivative: {tangent}"
        if tangent.size == 0:
            continue
        noise = 20.0 * np.finfo(value.dtype).eps * np.max(np.abs(value)) / step
        difference = np.tensordot(stencil, value, axes=1)
        np.testing.assert_allclose(
            tangent,
            difference,
            rtol=0.0,
            atol=rtol * np.max(np.abs(difference)) + noise,
            err_msg="forward derivative against central differences",
        )
        left += np.sum(weight * tangent)
        rounding += np.sum(np.abs(weight * tangent))
    assert np.all(np.isfinite(cotangent)), f"reverse derivative: {cotangent}"
    right = np.sum(cotangent * direction)
    rounding += np.sum(np.abs(cotangent * direction))
    np.testing.assert_allclose(
        right,
        left,
        rtol=0.0,
        atol=1e-10 * rounding,
        err_msg="reverse derivative against the forward one",
    )
    if order > 1:
        for derivative in (forward, reverse):
            _check_derivatives(derivative, point, order - 1, rtol, step, generator)


def load_vectors(equation: str) -> list[dict[str, Any]]:
    """The test vectors of an equation, computed independently of the package.

    A vector has the keys `eq`, `description`, `inputs`, `outputs` and `tol`. A value of
    `outputs` is met within `tol` times its magnitude, or times one where that is less.

    Args:
        equation: a label such as "2.9" or "Reiner 3.32". Labels that continue it are
            taken as well ("2.4 (recommended)"), longer numbers are not ("2.9a",
            "2.3.1"); where a label equals it, only that one is taken.

    Raises:
        ValueError: there is none.
    """
    vectors = [
        vector
        for path in sorted(VECTORS.glob("*.json"))
        for vector in json.loads(path.read_text(encoding="utf-8"))
    ]
    label = re.compile(re.escape(equation) + r"(?!\w|\.\d)")
    found = [vector for vector in vectors if vector["eq"] == equation]
    found = found or [vector for vector in vectors if label.match(vector["eq"])]
    if not found:
        labels = ", ".join(sorted({vector["eq"] for vector in vectors}))
        raise ValueError(f"`equation` must be one of {labels}, but is {equation}")
    return found
