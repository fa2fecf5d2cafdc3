"""Rank of the Jacobians by parameters and by joints, and what depends on what."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from .._custom_types import PerJoint, require_float64
from ._axis_lines import axis_lines, characteristic_length
from ._chain import SerialChain
from ._dependence import dependent_columns
from ._jacobian import jacobian
from ._parameters import ChainParameters, stacked_jacobian


class Combination(NamedTuple):
    """A column of a Jacobian as a sum of others.

    Attributes:
        name: of what depends.
        terms: names and factors [m] and [rad], largest effect first.
    """

    name: str
    terms: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        parts = [f"{factor:+.4g} {name}" for name, factor in self.terms]
        return f"{self.name} = {' '.join(parts) or '0'}"


class Singularity(NamedTuple):
    """Rank of a Jacobian, and what depends on what.

    Attributes:
        names: of the columns.
        rank: number of independent ones.
        full: rank where it is regular.
        dependent: the other columns as sums of independent ones.
        smallest: the last of as many singular values as the full rank has, lengths
            divided by the characteristic length.
        condition: largest over smallest singular value of the independent columns, each
            scaled to length one.
    """

    names: tuple[str, ...]
    rank: int
    full: int
    dependent: tuple[Combination, ...]
    smallest: float
    condition: float

    @property
    def is_singular(self) -> bool:
        return self.rank < self.full

    def __str__(self) -> str:
        first = (
            f"rank {self.rank} of {self.full}, smallest singular value "
            f"{self.smallest:.3g}, condition {self.condition:.3g}"
        )
        return "\n".join([first, *(f"  {c}" for c in self.dependent)])


def parameter_singularity(
    parameters: ChainParameters,
    poses: Float[Array, "poses joints"],
    *,
    length: float | None = None,
    tolerance: float = 1e-8,
) -> Singularity:
    """Rank of the parameters' Jacobian over some poses.

    Args:
        parameters: of a chain whose numbers are not traced.
        poses: joint coordinates [rad] or [m].
        length: characteristic length [m]; `characteristic_length` unless given.
        tolerance: of `dependent_columns`.

    References:
        [KinModell] (3-40), (3-41).
    """
    length = characteristic_length(parameters.chain) if length is None else length
    matrix, scale = scaled_jacobian(parameters, poses, length)
    return _singularity(parameters.names, matrix, scale, matrix.shape[1], tolerance)


def drive_singularity(
    chain: SerialChain,
    q: PerJoint,
    *,
    length: float | None = None,
    tolerance: float = 1e-8,
) -> Singularity:
    """Rank of the joints' Jacobian in one pose.

    Full rank is six, or the number of joints if that is less: by (3-40) as printed
    every pose of a redundant arm were singular.

    Args:
        chain: not traced.
        q: joint coordinates [rad] or [m], shape (joints,).
        length: characteristic length [m]; `characteristic_length` unless given.
        tolerance: of `dependent_columns`.

    References:
        [KinModell] (3-40), (3-42).
    """
    length = characteristic_length(chain) if length is None else length
    scale = np.where(axis_lines(chain).turns, 1.0, length)
    matrix = np.array(jacobian(chain, q), float) * scale
    matrix[:3] /= length
    names = tuple(f"axis_{k}" for k in range(1, chain.number + 1))
    return _singularity(names, matrix, scale, min(6, chain.number), tolerance)


def scaled_jacobian(
    parameters: ChainParameters, poses, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Parameter Jacobians of some poses, stacked, with a length as the unit.

    Returns:
        Shape (6 poses, parameters), and what every column was multiplied by.
    """
    scale = np.array([length if unit == "m" else 1.0 for unit in parameters.units])
    matrix = np.array(stacked_jacobian(parameters, poses), float) * scale
    matrix.reshape(-1, 6, len(scale))[:, :3] /= length
    return matrix, scale


def combinations(
    names, independent, dependent, factors: np.ndarray, scale: np.ndarray
) -> tuple[Combination, ...]:
    """Dependent columns in names.

    Args:
        names: of all columns.
        independent, dependent: indices of columns.
        factors: shape (independent, dependent), of the columns times `scale`.
        scale: of all columns.
    """
    found = []
    for k, effect in zip(dependent, factors.T, strict=True):
        order = sorted(range(len(independent)), key=lambda row: -abs(effect[row]))
        terms = [
            (names[independent[r]], float(effect[r] * scale[independent[r]] / scale[k]))
            for r in order
            if abs(effect[r]) > 1e-6
        ]
        found.append(Combination(names[k], tuple(terms)))
    return tuple(found)


def _singularity(names, matrix, scale, full: int, tolerance: float) -> Singularity:
    require_float64("the rank of a Jacobian")
    kept, left, factors, condition = dependent_columns(matrix, tolerance)
    values = np.linalg.svd(matrix, compute_uv=False)
    smallest = float(values[full - 1]) if full <= len(values) else 0.0
    dependent = combinations(names, kept, left, factors, scale)
    return Singularity(tuple(names), len(kept), full, dependent, smallest, condition)
