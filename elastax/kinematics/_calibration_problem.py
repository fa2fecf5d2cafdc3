"""The least-squares problem of a calibration, and what its poses can determine."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_optional_real, as_real, require_float64
from ._chain import SerialChain
from ._dependence import Dependence, dependent_columns
from ._joints import JointKind
from ._measurements import Measurements, Whitening
from ._parameters import ChainParameters, Vector


Rows = Float[Array, " rows"]
Whitenings = tuple[Whitening | None, ...]

# Schroer's bound, quoted in [Nahvi1996]: beyond it estimates are not reliable
RELIABLE_CONDITION = 100.0


class GaussianPrior(eqx.Module):
    """What is known of some deviations before anything is measured.

    Attributes:
        names: of the parameters.
        deviation: standard deviations [m] or [rad], shape (names,).
        mean: expected deviations from the nominal values; zero unless given.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    deviation: Float[Array, " names"] = eqx.field(converter=as_real)
    mean: Float[Array, " names"] | None = eqx.field(
        converter=as_optional_real, default=None
    )

    def __check_init__(self):
        check_fields(self)
        for array in (self.deviation, self.mean):
            if array is not None and array.shape != (len(self.names),):
                raise ValueError(
                    "a prior must have one `deviation` and one `mean` per name of "
                    f"{len(self.names)}, but has the shape {array.shape}"
                )
        check_values(
            "`deviation` of a prior must be positive",
            self.deviation,
            self.deviation > 0,
        )


class CalibrationProblem(eqx.Module):
    """Parameters of an arm that are sought, and the readings that tell about them.

    The unknowns x are deviations from the nominal values: first the parameters of the
    chain, then the offsets of encoders.

    Attributes:
        parameters: of the chain that are free.
        measurements: of one instrument or several.
        prior: on some of the unknowns.
        encoders: joints whose encoders have an unknown offset, counted from zero; they
            are named `encoder_1` and so on. The offset of a joint with an angle of its
            own in its convention is that angle, `theta`, already.
    """

    parameters: ChainParameters
    measurements: tuple[Measurements, ...] = eqx.field(
        converter=lambda x: (x,) if isinstance(x, Measurements) else tuple(x)
    )
    prior: GaussianPrior | None = None
    encoders: tuple[int, ...] = eqx.field(static=True, default=())

    def __check_init__(self):
        joints = self.parameters.chain.number
        if not self.measurements:
            raise ValueError("`measurements` must hold at least one set of readings")
        for part in self.measurements:
            if part.q.shape[1] != joints:
                raise ValueError(
                    f"`q` of the measurements must have {joints} columns, one per "
                    f"joint of the chain, but has the shape {part.q.shape}"
                )
        if any(not 0 <= k < joints for k in self.encoders):
            raise ValueError(
                f"`encoders` must name joints from 0 to {joints - 1}, but is "
                f"{self.encoders}"
            )
        if self.prior is not None:
            if missing := [n for n in self.prior.names if n not in self.names]:
                raise ValueError(
                    f"the prior names {missing}, which are no unknowns: these are "
                    f"{', '.join(self.names)}"
                )

    @property
    def names(self) -> tuple[str, ...]:
        encoders = tuple(f"encoder_{k + 1}" for k in self.encoders)
        return self.parameters.names + encoders

    @property
    def units(self) -> tuple[str, ...]:
        kinds = self.parameters.chain.kinds
        turns = [kinds[k] is JointKind.REVOLUTE for k in self.encoders]
        return self.parameters.units + tuple("rad" if t else "m" for t in turns)

    @property
    def number(self) -> int:
        """Number of unknowns."""
        return self.parameters.number + len(self.encoders)

    @property
    def rows(self) -> int:
        """Number of residuals, those of the prior included."""
        shape = jax.eval_shape(lambda: self.residuals(self.zero(), self.whitening()))
        return shape.shape[0]

    def select(self, names: tuple[str, ...]) -> "CalibrationProblem":
        """The problem with these unknowns only, in its own order.

        Raises:
            ValueError: there is no such unknown.
        """
        encoders = tuple(k for k in self.encoders if f"encoder_{k + 1}" in names)
        entries = tuple(e for e in self.parameters.entries if e.name in names)
        if unknown := [name for name in names if name not in self.names]:
            raise ValueError(
                f"the problem has no unknowns {unknown}: it has {', '.join(self.names)}"
            )
        chain = ChainParameters(self.parameters.chain, entries)
        return CalibrationProblem(chain, self.measurements, self.prior, encoders)

    def zero(self) -> Vector:
        """The nominal arm."""
        return jnp.zeros((self.number,), self.measurements[0].q.dtype)

    def chain(self, x: Vector) -> SerialChain:
        """The arm whose parameters deviate by x."""
        if self.parameters.number == 0:
            return self.parameters.chain
        return self.parameters.moved(x[: self.parameters.number])

    def offset(self, x: Vector) -> PerJoint | None:
        """Offsets of the encoders [rad] or [m]; none where all are exact."""
        if not self.encoders:
            return None
        zero = jnp.zeros((self.parameters.chain.number,), x.dtype)
        return zero.at[np.array(self.encoders)].set(x[self.parameters.number :])

    def whitening(self) -> Whitenings:
        """What `residuals` needs for encoder noise, linear about the nominal arm."""
        return tuple(m.whitening(self.parameters.chain) for m in self.measurements)

    def residuals(self, x: Vector, whitening: Whitenings) -> Rows:
        """Readings minus predictions over their deviations, then those of the prior."""
        chain, offset = self.chain(x), self.offset(x)
        parts = [
            measured.residuals(chain, offset, factors)
            for measured, factors in zip(self.measurements, whitening, strict=True)
        ]
        if self.prior is not None:
            places = np.array([self.names.index(name) for name in self.prior.names])
            known = x[places]
            mean = jnp.zeros_like(known) if self.prior.mean is None else self.prior.mean
            parts.append((mean - known) / self.prior.deviation)
        return jnp.concatenate(parts)

    def jacobian(
        self, x: Vector, whitening: Whitenings
    ) -> Float[Array, "rows parameters"]:
        """Derivative of the residuals by the unknowns.

        References:
            [KinModell] (3-41), stacked over the poses and weighted.
        """
        return jax.jacfwd(lambda y: self.residuals(y, whitening))(x)


class Identifiability(NamedTuple):
    """What the poses of a calibration can determine.

    Attributes:
        names: of the unknowns that were asked for.
        dependence: of the columns of the weighted Jacobian, in the order of `names`.
        expected: standard deviations that the independent unknowns will have [m] or
            [rad], before anything is measured.
        weakest: combination of the independent unknowns that is determined worst, a
            unit vector; each unknown is counted in units of its effect on the readings.
    """

    names: tuple[str, ...]
    dependence: Dependence
    expected: np.ndarray
    weakest: np.ndarray

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Unknowns that can be told apart."""
        return tuple(self.names[k] for k in self.dependence.independent)

    @property
    def dependent(self) -> tuple[str, ...]:
        """Unknowns that do what others in front of them do already."""
        return tuple(self.names[k] for k in self.dependence.dependent)

    @property
    def condition(self) -> float:
        """Condition number of the independent columns, each of length one."""
        return self.dependence.condition

    @property
    def reliable(self) -> bool:
        """Whether the condition number stays below `RELIABLE_CONDITION`."""
        return self.condition < RELIABLE_CONDITION

    def combinations(self) -> dict[str, str]:
        """How each dependent unknown acts, in words."""
        columns = self.dependence.combination.T
        return {
            name: f"acts like {text}" if text else "has no effect on the readings"
            for name, text in zip(
                self.dependent, map(self._combination, columns), strict=True
            )
        }

    def weakest_combination(self) -> str:
        """The worst determined combination, without its small terms."""
        return _sum(self.weakest, self.identifiable, 0.2, "{:.2f} {}")

    def _combination(self, factors: np.ndarray) -> str:
        return _sum(factors, self.identifiable, 1e-6, "{:.4g} {}")


def identifiability(
    problem: CalibrationProblem, *, tolerance: float = 1e-8
) -> Identifiability:
    """Which parameters the measured poses can determine, at the nominal arm.

    Of parameters that do the same the first is kept, in the order of the problem. A
    prior counts as a reading.

    Args:
        problem: concrete numbers; readings do not matter, poses do.
        tolerance: of `dependent_columns`.

    Raises:
        ValueError: no parameter has an effect on the readings.

    References:
        [KinModell] (3-41): parameter singularities.
    """
    require_float64("a calibration")
    matrix = np.asarray(_nominal_jacobian(problem))
    dependence = dependent_columns(matrix, tolerance, rounding=1e-12)
    if not dependence.independent:
        raise ValueError(
            f"none of {', '.join(problem.names)} has an effect on the readings"
        )
    kept = matrix[:, list(dependence.independent)]
    lengths = np.linalg.norm(kept, axis=0)
    _, values, directions = np.linalg.svd(kept / lengths, full_matrices=False)
    expected = np.linalg.norm(directions / values[:, None], axis=0) / lengths
    return Identifiability(problem.names, dependence, expected, directions[-1])


# Compiled, unlike what is meant to be transformed: this entry takes concrete numbers
# only, and the 160 operations one by one would take six times as long to compile.
@eqx.filter_jit
def _nominal_jacobian(problem: CalibrationProblem) -> Float[Array, "rows parameters"]:
    return problem.jacobian(problem.zero(), problem.whitening())


def _sum(factors: np.ndarray, names: tuple[str, ...], share: float, form: str) -> str:
    """Terms of a linear combination, largest first, as text."""
    size = np.abs(factors)
    largest = size.max(initial=0.0)
    places = [k for k in np.argsort(-size, kind="stable") if size[k] > share * largest]
    terms = []
    for k in places:
        sign = "-" if factors[k] < 0 else ("+" if terms else "")
        terms.append(f"{sign}{' ' if terms else ''}{form.format(size[k], names[k])}")
    return " ".join(terms)
