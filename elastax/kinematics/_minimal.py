r"""Minimal and complete parameter sets of serial chains.

An axis that turns is a line and has four parameters, one that slides a direction and
has two; the tool's pose at q = 0 has six. A model that says all of this and nothing
twice has $n_K = 4 r_K + 2 t_K + 6$ parameters, mounting and tool pose included.
"""

from collections.abc import Iterable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import require_float64
from ._axis_lines import axis_lines, characteristic_length
from ._chain import SerialChain
from ._convention_properties import convention_properties
from ._convert import to_mixed, to_rpy
from ._dependence import dependent_columns
from ._joints import JointKind
from ._parameters import ChainParameters, joint_groups
from ._singularities import Combination, combinations, scaled_jacobian
from ._structured import StructuredJoints


# shares of a column that must be new for it to be taken, one round after the other
_SHARES = (0.5, 0.2, 0.05, 1e-2, 1e-3, 1e-4, 1e-5)


def parameter_count(chain: SerialChain) -> int:
    """Parameters of a minimal, complete model with mounting and tool pose.

    References:
        [KinModell] (3-10).
    """
    revolute = sum(kind is JointKind.REVOLUTE for kind in chain.kinds)
    return 4 * revolute + 2 * (chain.number - revolute) + 6


class MinimalModel(NamedTuple):
    """Parameters that say everything about a chain, and nothing twice.

    Attributes:
        parameters: the minimal set, of the chain in its final convention.
        excluded: the other parameters, each as a sum of those of the set.
        condition: largest over smallest singular value of the set's Jacobian over the
            poses, lengths over `length`.
        length: characteristic length [m].
        conversion: why the convention was changed; empty if it was not.
    """

    parameters: ChainParameters
    excluded: tuple[Combination, ...]
    condition: float
    length: float
    conversion: str

    def __str__(self) -> str:
        conventions = _conventions(self.parameters.chain)
        lines = [
            f"{self.parameters.number} parameters of {conventions}, condition "
            f"{self.condition:.3g} with lengths over {self.length:.4g} m",
            f"kept: {', '.join(self.parameters.names)}",
            "excluded:",
            *(f"  {combination}" for combination in self.excluded),
        ]
        return "\n".join([self.conversion, *lines] if self.conversion else lines)


def minimal_model(
    chain: SerialChain,
    *,
    keep: Iterable[str] = (),
    poses: Float[Array, "poses joints"] | None = None,
    tolerance: float = 1e-6,
) -> MinimalModel:
    """A minimal, complete parameter set of a chain in any convention, mixed ones too.

    Parameters of the joints are preferred to those of mounting and tool, and among each
    those in front, as long as the set stays well conditioned. If the chain's convention
    cannot move every axis a little (Denavit-Hartenberg joints at parallel axes), or
    keeps parts as structure, the chain is converted: by `to_mixed`, and by `to_rpy`
    where that is not enough either.

    Args:
        chain: its numbers must not be traced.
        keep: names of parameters that the set must hold.
        poses: joint coordinates that tell the parameters apart [rad] or [m]; random
            ones of all directions unless given.
        tolerance: a parameter is excluded if no more than this share of its effect is
            not that of others. With Denavit-Hartenberg joints the share is about the
            square of the angle between nearly parallel axes [rad]: those below a
            milliradian are converted unless it is changed.

    Raises:
        ValueError: parameters of `keep` do not exist or depend on each other, or the
            poses are too few to tell the parameters apart.

    References:
        [KinModell] (3-10), (3-41), section 3.1.
    """
    require_float64("a minimal model")
    count, length = parameter_count(chain), characteristic_length(chain)
    poses = generic_poses(chain) if poses is None else poses
    conversion, keep = "", tuple(keep)
    for convert in (None, to_mixed, to_rpy):
        if convert is None and _has_structure(chain):
            conversion = "parts of the placement were structure, no parameters"
            continue
        converted = chain if convert is None else convert(chain)
        everything = ChainParameters.of(converted)
        matrix, scale = scaled_jacobian(everything, poses, length)
        kept = _select(matrix, _places(everything, keep), tolerance)
        if len(kept) == count:
            break
        conversion = conversion or _why(chain, tolerance)
    else:
        raise ValueError(
            f"`poses` must tell {count} parameters apart, but these {len(poses)} tell "
            f"{len(kept)}: give more of them, in all directions"
        )
    left = [k for k in range(everything.number) if k not in kept]
    factors = np.linalg.lstsq(matrix[:, kept], matrix[:, left], rcond=None)[0]
    values = np.linalg.svd(matrix[:, kept], compute_uv=False)
    if conversion:
        conversion = f"{conversion}: converted to {_conventions(converted)}"
    return MinimalModel(
        everything.select(everything.names[k] for k in kept),
        combinations(everything.names, kept, left, factors, scale),
        float(values[0] / values[-1]),
        length,
        conversion,
    )


def generic_poses(
    chain: SerialChain, number: int = 30, seed: int = 0
) -> Float[Array, "poses joints"]:
    """Joint coordinates in all directions: a turn of hinges, an arm's length of slides.

    Args:
        chain: not traced.
        number: of poses.
        seed: of the generator; equal seeds give equal poses.
    """
    reach = np.where(axis_lines(chain).turns, np.pi, characteristic_length(chain))
    uniform = np.random.default_rng(seed).uniform(-1, 1, (number, chain.number))
    return jnp.asarray(uniform * reach, chain.base.dtype)


def _select(matrix: np.ndarray, first: list[int], tolerance: float) -> list[int]:
    """Columns that span the range, ascending: `first`, and others well apart."""
    found = dependent_columns(matrix[:, first], tolerance)
    if found.dependent:
        raise ValueError(
            "the parameters of `keep` must not depend on each other, but do: leave out "
            f"{len(found.dependent)} of them"
        )
    norms = np.linalg.norm(matrix, axis=0)
    rest = matrix / np.where(norms > 0, norms, 1.0)
    kept: list[int] = []
    rounds = [(tolerance, first)]
    rounds += [(s, range(len(norms))) for s in (*_SHARES, tolerance) if s >= tolerance]
    for share, columns in rounds:
        for k in columns:
            length = np.linalg.norm(rest[:, k])
            if k in kept or length <= share:
                continue
            kept.append(k)
            direction = rest[:, k] / length
            for _ in range(2):  # the second projection removes what rounding left
                rest = rest - np.outer(direction, direction @ rest)
    return sorted(kept)


def _places(parameters: ChainParameters, names: tuple[str, ...]) -> list[int]:
    if names:
        parameters.select(names)  # refuses unknown names
    return [parameters.names.index(name) for name in names]


def _has_structure(chain: SerialChain) -> bool:
    return any(isinstance(g, StructuredJoints) for g in joint_groups(chain.joints))


def _conventions(chain: SerialChain) -> str:
    names = [type(group).__name__ for group in joint_groups(chain.joints)]
    return " + ".join(name.removesuffix("Joints") for name in names)


def _why(chain: SerialChain, tolerance: float) -> str:
    # displacements are measured in the arm's size, shares of columns in their own
    found = convention_properties(chain, tolerance=10 * tolerance).joints
    joints = ", ".join(str(j.joint) for j in found if not j.is_complete)
    return f"{_conventions(chain)} cannot move every axis a little (joints {joints})"
