"""Calibration of an arm: what can be estimated, the estimate, and a report of both."""

import equinox as eqx
import numpy as np
import optimistix as optx

from .._custom_types import Scalar
from ._calibration_problem import (
    RELIABLE_CONDITION,
    CalibrationProblem,
    Identifiability,
    identifiability,
)
from ._chain import SerialChain
from ._estimate import Estimate, NoiseVariance, estimate_parameters


class Calibration(eqx.Module):
    """A calibration: the estimate, and what could not be estimated.

    Attributes:
        estimate: of the parameters that were kept.
        identifiability: of those that were asked for.
    """

    estimate: Estimate
    identifiability: Identifiability

    def chain(self) -> SerialChain:
        """The estimated arm."""
        return self.estimate.chain()

    def table(self, level: float = 0.95) -> str:
        """The result for a reader: lengths in mm, angles in mrad."""
        estimate = self.estimate
        scaled = lambda x: 1e3 * np.asarray(x)
        rows = zip(
            estimate.problem.names,
            estimate.problem.units,
            scaled(estimate.deviation),
            scaled(estimate.standard_deviation()),
            scaled(estimate.half_width(level)),
            strict=True,
        )
        width = max(9, *(len(name) for name in estimate.problem.names))
        lines = [
            f"{'parameter':<{width}}  unit  deviation   std.dev.  "
            f"{100 * level:.0f} % interval"
        ]
        lines += [
            f"{name:<{width}}  m{unit:<3}  {x:9.4f}  {s:9.4f}  [{x - h:.4f}, "
            f"{x + h:.4f}]"
            for name, unit, x, s, h in rows
        ]
        return "\n".join(lines + self._remarks())

    def _remarks(self) -> list[str]:
        """Lines below the table."""
        estimate, report = self.estimate, self.identifiability
        chi_square = float(np.asarray(estimate.chi_square()))
        lines = [
            f"chi-square {chi_square:.1f} at {estimate.degrees_of_freedom} degrees of "
            f"freedom, probability {estimate.probability():.3f}",
            f"condition number {float(np.asarray(estimate.condition)):.3g}"
            + ("" if report.reliable else f", beyond {RELIABLE_CONDITION:g}"),
            f"determined worst: {report.weakest_combination()}",
        ]
        for name, text in report.combinations().items():
            lines.append(f"held at its nominal value: {name}, {text}")
        if estimate.result != optx.RESULTS.successful:
            lines.append("the solver did not succeed: do not use these numbers")
        return lines


def calibrate(
    problem: CalibrationProblem,
    *,
    exclude_dependent: bool = False,
    tolerance: float = 1e-8,
    noise: NoiseVariance = NoiseVariance.GIVEN,
    characteristic_length: Scalar | float = 1.0,
    solver: optx.AbstractLeastSquaresSolver | None = None,
    max_steps: int = 100,
    throw: bool = True,
) -> Calibration:
    """Identify the parameters of an arm from measured poses.

    Axes that are parallel, or nearly so, need `HayatiJoints` or `RPYJoints` between
    them: Denavit-Hartenberg parameters cannot describe every tilt of parallel axes, and
    the readings hardly determine those of nearly parallel ones.

    Args:
        problem: concrete parameters and readings.
        exclude_dependent: whether parameters that do what others do already stay at
            their nominal values; they are an error otherwise.
        tolerance: of `dependent_columns`, at the nominal arm.
        noise, characteristic_length, solver, max_steps, throw: as for
            `estimate_parameters`.

    Raises:
        ValueError: dependent parameters, too few readings, or single precision.

    References:
        [KinModell] (3-41): dependent parameters are told by the rank of the Jacobian.
    """
    report = identifiability(problem, tolerance=tolerance)
    if report.dependent and not exclude_dependent:
        how = "; ".join(f"{n} {text}" for n, text in report.combinations().items())
        raise ValueError(
            f"the measured poses cannot tell these parameters apart: {how}. Leave them "
            "out, give them a prior or say `exclude_dependent=True`"
        )
    # concrete numbers only, as in `identifiability`, hence compiled as one program
    estimate = eqx.filter_jit(estimate_parameters)(
        problem.select(report.identifiable),
        noise=noise,
        characteristic_length=characteristic_length,
        solver=solver,
        max_steps=max_steps,
        throw=throw,
    )
    return Calibration(estimate, report)
