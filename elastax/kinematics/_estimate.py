"""Least-squares estimate of the parameters of an arm, with its uncertainty."""

import enum

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
import numpy as np
import optimistix as optx
import scipy.special
from jaxtyping import Array, Float, Int

from .._custom_types import PerJoint, Scalar, as_real, require_float64
from ._calibration_problem import CalibrationProblem, Rows
from ._chain import SerialChain
from ._levenberg_marquardt import LevenbergMarquardt
from ._parameters import Vector


class NoiseVariance(enum.Enum):
    """Where the variance of the readings comes from.

    GIVEN: the standard deviations of the instruments are right; intervals are those of
    the normal distribution.
    ESTIMATED: they are right up to a common factor, which the residuals give; intervals
    are those of Student's t distribution.
    """

    GIVEN = "given"
    ESTIMATED = "estimated"


class Estimate(eqx.Module):
    """Estimated parameters of an arm.

    Attributes:
        problem: what was estimated.
        deviation: from the nominal values [m] or [rad], in the order of
            `problem.names`.
        covariance: of the deviations, to first order.
        residuals: weighted, at the solution, those of the prior last.
        condition: condition number of the Jacobian there, columns of length one.
        result: whether the solver succeeded.
        steps: number of its steps.
        noise: where the variance of the readings came from.
    """

    problem: CalibrationProblem
    deviation: Vector
    covariance: Float[Array, "parameters parameters"]
    residuals: Rows
    condition: Scalar
    result: optx.RESULTS
    steps: Int[Array, ""]
    noise: NoiseVariance = eqx.field(static=True)

    def chain(self) -> SerialChain:
        """The estimated arm."""
        return self.problem.chain(self.deviation)

    def encoder_offset(self) -> PerJoint:
        """To be added to what the encoders show [rad] or [m], shape (joints,)."""
        offset = self.problem.offset(self.deviation)
        number = self.problem.parameters.chain.number
        return jnp.zeros((number,), self.deviation.dtype) if offset is None else offset

    def standard_deviation(self) -> Vector:
        """Of each parameter [m] or [rad]."""
        return jnp.sqrt(jnp.diagonal(self.covariance))

    def correlation(self) -> Float[Array, "parameters parameters"]:
        """Correlation matrix of the parameters."""
        size = self.standard_deviation()
        # all are zero if the variance is estimated from readings without any error
        size = jnp.where(size > 0, size, 1.0)
        return self.covariance / (size[:, None] * size[None, :])

    def half_width(self, level: float = 0.95) -> Vector:
        """Half the interval that covers a true deviation with probability `level`."""
        upper = 0.5 + 0.5 * level
        if self.noise is NoiseVariance.GIVEN:
            factor = scipy.special.ndtri(upper)
        else:
            factor = scipy.special.stdtrit(self.degrees_of_freedom, upper)
        return float(factor) * self.standard_deviation()

    def chi_square(self) -> Scalar:
        """Sum of the squared weighted residuals."""
        return jnp.sum(self.residuals**2)

    @property
    def degrees_of_freedom(self) -> int:
        """Readings less parameters; the mean of `chi_square` if the model is right."""
        return self.residuals.shape[0] - self.deviation.shape[0]

    def probability(self) -> float:
        """Probability of a larger `chi_square`, if arm and deviations are right.

        Values below some 0.001 say that the arm bends, that something was measured
        wrong, or that the instruments are less precise than stated.
        """
        freedom = self.degrees_of_freedom
        if freedom == 0:
            return 1.0
        chi_square = float(np.asarray(self.chi_square()))
        return float(scipy.special.gammaincc(freedom / 2, chi_square / 2))


def estimate_parameters(
    problem: CalibrationProblem,
    *,
    noise: NoiseVariance = NoiseVariance.GIVEN,
    characteristic_length: Scalar | float = 1.0,
    solver: optx.AbstractLeastSquaresSolver | None = None,
    max_steps: int = 100,
    throw: bool = True,
) -> Estimate:
    r"""Least-squares estimate of the parameters, without asking whether there is one.

    Minimises $\sum r^2$ of the weighted residuals. The covariance is
    $(J^T J)^{-1}$ at the solution, times $\chi^2$ over the degrees of freedom if the
    variance is estimated. Pure: `jax.vmap` over the readings runs many data sets at
    once, `throw=False` then; derivatives by the readings are those of the minimum.
    Dependent parameters come out with enormous deviations: call `identifiability` or
    `calibrate` first.

    Args:
        problem: parameters and readings.
        noise: where the variance of the readings comes from.
        characteristic_length: length that counts as much as 1 rad for the solver [m].
        solver: Levenberg-Marquardt unless given.
        max_steps: largest number of steps.
        throw: whether to raise if the solver fails; `result` says so otherwise.

    Raises:
        ValueError: too few readings; single precision.

    References:
        [KinModell] (3-100), (3-137).
    """
    require_float64("a calibration")
    _check_rows(problem, noise)
    problem = _finite(problem)
    whitening = problem.whitening()
    is_length = np.array([unit == "m" for unit in problem.units])
    length = as_real(characteristic_length)
    unit = jnp.where(is_length, length, jnp.ones_like(length))
    if solver is None:
        # the last step moves no residual by more than 1e-6 of its deviation, and what
        # is missing then is far less
        solver = LevenbergMarquardt(rtol=1e-6, atol=1e-6)
    solution = optx.least_squares(
        _residuals,
        solver,
        problem.zero(),
        (problem, whitening, unit),
        max_steps=max_steps,
        throw=throw,
    )
    deviation = unit * solution.value
    residuals, slope = _value_and_jacobian(
        lambda x: problem.residuals(x, whitening), deviation
    )
    covariance, condition = _spread(slope)
    if noise is NoiseVariance.ESTIMATED:
        freedom = residuals.shape[0] - deviation.shape[0]
        covariance = covariance * (jnp.sum(residuals**2) / freedom)
    return Estimate(
        problem,
        deviation,
        covariance,
        residuals,
        condition,
        solution.result,
        jnp.asarray(solution.stats["num_steps"]),
        noise,
    )


# Defined once, so that a second data set of the same size compiles nothing.
@eqx.filter_custom_jvp
def _residuals(y, args) -> Rows:
    """Residuals at scaled unknowns, whose tangent is a product with one matrix.

    Levenberg-Marquardt steps apply the Jacobian several times. Written out it is
    evaluated once, together with the residuals, and compiled once.
    """
    problem, whitening, unit = args
    return problem.residuals(unit * y, whitening)


@_residuals.def_jvp
def _residuals_jvp(primals, tangents):
    (y, args), (change, args_change) = primals, tangents

    def residuals(y, args):
        problem, whitening, unit = args
        return problem.residuals(unit * y, whitening)

    value, slope = _value_and_jacobian(lambda x: residuals(x, args), y)
    moved = None if change is None else slope @ change
    if len(jax.tree.leaves(args_change)) > 0:
        _, by_args = eqx.filter_jvp(lambda a: residuals(y, a), (args,), (args_change,))
        moved = by_args if moved is None else moved + by_args
    return value, moved


def _value_and_jacobian(function, x):
    def twice(x):
        value = function(x)
        return value, value

    slope, value = jax.jacfwd(twice, has_aux=True)(x)
    return value, slope


def _check_rows(problem: CalibrationProblem, noise: NoiseVariance) -> None:
    least = problem.number + (noise is NoiseVariance.ESTIMATED)
    if problem.rows < least:
        raise ValueError(
            f"{problem.number} parameters need {least} readings at least, but there "
            f"are {problem.rows}: measure more poses or free fewer parameters"
        )


def _finite(problem: CalibrationProblem) -> CalibrationProblem:
    """The problem, which raises at run time where a reading is not finite."""
    readings = lambda p: tuple(m.readings for m in p.measurements)
    bad = jnp.any(jnp.stack([~jnp.all(jnp.isfinite(x)) for x in readings(problem)]))
    checked = eqx.error_if(
        readings(problem), bad, "`readings` must be finite: leave such poses out"
    )
    return eqx.tree_at(readings, problem, checked)


def _spread(
    jacobian: Float[Array, "rows parameters"],
) -> tuple[Float[Array, "parameters parameters"], Scalar]:
    """Inverse of the information matrix, and the condition of the scaled columns."""
    lengths = jnp.linalg.norm(jacobian, axis=0)
    lengths = jnp.where(lengths > 0, lengths, 1.0)
    scaled = jacobian / lengths[None]
    upper = jnp.linalg.qr(scaled, mode="r")
    # what is not determined at all gets an enormous variance instead of infinity
    tiny = jnp.finfo(upper.dtype).eps
    diagonal = jnp.diagonal(upper)
    lost = jnp.abs(diagonal) < tiny
    upper = upper + jnp.diag(jnp.where(lost, tiny - diagonal, 0.0))
    identity = jnp.eye(upper.shape[0], dtype=upper.dtype)
    root = jsl.solve_triangular(upper, identity)
    # Singular values of the inverse, not of the columns: batched LAPACK calls that do
    # not wait for one another can block each other for ever on a processor.
    values = jnp.linalg.svd(root, compute_uv=False)
    root = root / lengths[:, None]
    return root @ root.T, values[0] / values[-1]
