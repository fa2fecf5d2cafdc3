"""Fit of the parameters of any law to measurements of it."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import Scalar, as_real, require_float64


# Unknowns stay within this power of e about their start: nothing overflows on the way.
_REACH = 40.0


class LawFit(eqx.Module):
    """A law with fitted parameters, and how well they are determined.

    Attributes:
        law: the law, with the fitted values in place of those of the start.
        names: of the fitted parameters, as in `law`; entries of arrays are numbered.
        values: fitted.
        deviations: their standard errors, to first order; infinite where the
            measurements do not depend on a parameter, or on it and others only jointly.
        rms: root mean square of the residuals, in units of the outputs.
        determination: R^2, the outputs about their mean.
        result: whether the solver succeeded.
        steps: number of its steps.
    """

    law: Any
    names: tuple[str, ...] = eqx.field(static=True)
    values: Float[Array, " parameters"]
    deviations: Float[Array, " parameters"]
    rms: Scalar
    determination: Scalar
    result: optx.RESULTS
    steps: Int[Array, ""]

    def is_identifiable(self) -> Bool[Array, " parameters"]:
        """Whether the standard error of a parameter is finite and below its value.

        A parameter that is zero within its error counts as not identifiable: whether
        the law has that part cannot be said.
        """
        known = jnp.isfinite(self.deviations)
        return known & (self.deviations < jnp.abs(self.values))

    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the parameters that the measurements do not determine."""
        flags = np.asarray(self.is_identifiable())
        return tuple(name for name, known in zip(self.names, flags) if not known)


def fit_law(
    law: Any,
    function: Callable[[Any, Any], Float[Array, "..."]],
    inputs: Any,
    outputs: Float[Array, " samples *shape"],
    *,
    held: Callable[[Any], Any] | None = None,
    signed: Callable[[Any], Any] | None = None,
    deviation: Float[Array, ""] | float | None = None,
    starts: int = 1,
    solver: optx.AbstractLeastSquaresSolver | None = None,
    max_steps: int = 1000,
    throw: bool = True,
) -> LawFit:
    r"""Least-squares fit of the parameters of a law, by damped Gauss-Newton steps.

    Every floating-point leaf is free unless held. A free entry that is positive at the
    start stays positive: its logarithm is the unknown. Standard errors come from the
    Jacobian $J$ at the solution, $\sigma^2 (J^T J)^{-1}$; directions in which $J$
    vanishes to rounding have no variance, and the parameters that take part in them are
    reported as unidentifiable. Such parameters stay near their start. A law with
    conditions between its parameters is not asked about them on the way.

    Where sections of a law meet at a fitted place, as in `PiecewiseFriction`, the sum
    of squares has several minima: take some `starts` and the best of them.

    Args:
        law: friction, stiffness or any other module; its values are the start.
        function: output of the law at one sample of the inputs.
        inputs: array or tuple of arrays, samples along the leading axis.
        outputs: measured, samples along the leading axis.
        held: selects the leaf or leaves of the law that are not fitted, such as
            `lambda law: (law.steepness,)`.
        signed: selects those that may change their sign, such as an offset. Entries
            that are not positive at the start may anyway.
        deviation: standard deviation $\sigma$ of the outputs; estimated from the
            residuals unless given.
        starts: number of starts. The first is the law as given; the others have every
            free entry multiplied by a factor between one half and two, always the
            same ones.
        solver: Levenberg-Marquardt unless given.
        max_steps: largest number of steps from each start.
        throw: whether to raise if the solver fails; `result` says so otherwise.

    Raises:
        ValueError: single precision; nothing is free; too few samples.

    Examples:
        >>> law = CoulombViscousFriction(10.0, 30.0, 45.0)
        >>> torque = lambda law, speed: law.torque(speed)
        >>> fit = fit_law(law, torque, speed, measured, held=lambda law: law.steepness)
        >>> fit.law.viscous, fit.deviations, fit.unidentifiable()
    """
    require_float64("the fit of a law")
    free, fixed = eqx.partition(law, _is_free(law, held))
    start, unravel = jax.flatten_util.ravel_pytree(free)
    names = _names(free)
    count = start.shape[0]
    if count == 0:
        raise ValueError("a parameter must be free, but all are held")
    outputs = eqx.error_if(
        outputs, ~jnp.all(jnp.isfinite(outputs)), "`outputs` must be finite"
    )
    needed = count + (deviation is None)
    if outputs.size < needed:
        raise ValueError(
            f"{count} parameters need {needed} outputs at least, but there are "
            f"{outputs.size}: measure more or hold some"
        )
    scale = jnp.sqrt(jnp.mean(outputs**2)) if deviation is None else as_real(deviation)
    scale = jnp.where(scale > 0, scale, jnp.ones_like(scale))

    def residuals(values):
        full = eqx.combine(unravel(values), fixed)
        predicted = jax.vmap(lambda sample: function(full, sample))(inputs)
        return (predicted - outputs).ravel() / scale

    logarithmic = (start > 0) & ~_marks(free, signed)
    size = jnp.where(start == 0, 1.0, jnp.abs(start))

    def values_of(unknowns):
        power = _REACH * jnp.tanh(unknowns / _REACH)
        return jnp.where(logarithmic, size * jnp.exp(power), start + size * unknowns)

    if solver is None:
        solver = optx.LevenbergMarquardt(rtol=1e-10, atol=1e-10)

    def minimise(unknowns):
        solution = optx.least_squares(
            lambda unknowns, _: residuals(values_of(unknowns)),
            solver,
            unknowns,
            max_steps=max_steps,
            throw=False,
        )
        values = values_of(solution.value)
        steps = jnp.asarray(solution.stats["num_steps"])
        return values, solution.result, steps, jnp.sum(residuals(values) ** 2)

    found = jax.vmap(minimise)(_first_unknowns(logarithmic, starts))
    square = jnp.where(jnp.isnan(found[-1]), jnp.inf, found[-1])
    best = jnp.argmin(square)
    values, result, steps, square = jax.tree.map(lambda leaf: leaf[best], found)
    if throw:
        values = result.error_if(values, result != optx.RESULTS.successful)
    variance = 1.0
    if deviation is None:
        variance = square / (outputs.size - count)
    errors = jnp.sqrt(variance) * _root_covariance(jax.jacfwd(residuals)(values))
    spread = jnp.sum((outputs - jnp.mean(outputs, axis=0)[None]) ** 2)
    spread = jnp.where(spread > 0, spread, jnp.ones_like(spread))
    return LawFit(
        eqx.combine(unravel(values), fixed),
        names,
        values,
        errors,
        scale * jnp.sqrt(square / outputs.size),
        1.0 - square * scale**2 / spread,
        result,
        steps,
    )


def _is_free(law, held):
    """For every leaf whether it is fitted."""
    free = jax.tree.map(eqx.is_inexact_array, law)
    if held is None:
        return free
    return eqx.tree_at(_as_leaves(held), free, replace_fn=lambda _: False)


def _as_leaves(select):
    """`select`, giving all leaves of what it selects."""
    return lambda law: jax.tree.leaves(select(law))


def _marks(free, select):
    """For every entry of the raveled free leaves whether `select` takes it."""
    marks = jax.tree.map(lambda leaf: np.zeros(leaf.shape), free)
    if select is not None:
        whole = lambda leaf: np.ones(np.shape(leaf))
        marks = eqx.tree_at(_as_leaves(select), marks, replace_fn=whole)
    flat = [np.ravel(mark) for mark in jax.tree.leaves(marks)]
    return np.concatenate(flat) > 0


def _first_unknowns(logarithmic, starts):
    """Unknowns of every start; zero is the law as given."""
    powers = np.random.default_rng(0).uniform(-1.0, 1.0, (starts, logarithmic.size))
    powers[0] = 0.0
    power = np.log(2.0) * powers
    return jnp.where(logarithmic, power, np.expm1(power))


def _names(free):
    names = []
    for path, leaf in jax.tree_util.tree_flatten_with_path(free)[0]:
        name = jax.tree_util.keystr(path).lstrip(".")
        if leaf.ndim == 0:
            names.append(name)
        else:
            entries = np.ndindex(*leaf.shape)
            names += [f"{name}[{', '.join(map(str, entry))}]" for entry in entries]
    return tuple(names)


def _root_covariance(jacobian):
    r"""Roots of the diagonal of $(J^T J)^{-1}$, infinite where it does not exist."""
    largest = jnp.max(jnp.abs(jacobian), axis=0)
    safe = jnp.where(largest > 0, largest, 1.0)
    length = safe * jnp.linalg.norm(jacobian / safe[None], axis=0)
    length = jnp.where(length > 0, length, 1.0)
    _, size, right = jnp.linalg.svd(jacobian / length[None], full_matrices=False)
    precision = jnp.finfo(size.dtype).eps
    lost = size <= max(jacobian.shape) * precision * size[0]
    # Where a parameter plays no part, a vector of the null space holds rounding.
    involved = jnp.any(lost[:, None] & (jnp.abs(right) > jnp.sqrt(precision)), axis=0)
    inverse = jnp.where(lost, 0.0, 1.0 / jnp.where(lost, 1.0, size))
    root = jnp.linalg.norm(right * inverse[:, None], axis=0) / length
    return jnp.where(involved, jnp.inf, root)
