r"""What the joint conventions of a chain can say about its axes, and where they fail.

A joint's parameters place an axis in the frame in front. Of the six small displacements
of a frame on that axis, turning about it and shifting along it are left to the
neighbour's parameters, so that four remain (three fewer where an axis is prismatic: it
has a direction but no place). The parameters are complete where they make these
displacements, and redundant where they are more than needed.
"""

from typing import NamedTuple

import numpy as np

from .._custom_types import require_float64
from ._axis_lines import axis_lines, characteristic_length
from ._chain import SerialChain
from ._dependence import dependent_columns
from ._joints import FrameJoints, RPYJoints
from ._link_conventions import HayatiJoints, ModifiedDHJoints
from ._parameters import ChainParameters, factor_slopes, joint_groups
from ._singularities import Combination, combinations


class JointProperties(NamedTuple):
    """Rows of the tables 3-1 to 3-4 for one joint of a chain as it stands.

    Attributes:
        joint: its number, from one.
        convention: class of its parameters.
        parameters: their names.
        dependent: parameters that do to the joint's own transform what others do.
        redundant: parameters that do what others and the neighbour's do; at the ends of
            the chain, what the pose of tool or base does.
        missing: how many displacements of the axis no parameters make.
        amplification: the worst change of the parameters for a unit displacement of the
            axis, lengths over the arm's size; infinite where some are missing.
        covers_all: whether the convention can place any axis at all.
    """

    joint: int
    convention: str
    parameters: tuple[str, ...]
    dependent: tuple[Combination, ...]
    redundant: tuple[Combination, ...]
    missing: int
    amplification: float
    covers_all: bool

    @property
    def is_complete(self) -> bool:
        """Whether small parameters make every small displacement of the axis.

        Where they do, the parameters are a continuous function of the geometry.
        """
        return self.missing == 0

    @property
    def loses_rank(self) -> bool:
        """Whether displacements or parameters are lost in this place."""
        return self.missing > 0 or len(self.dependent) > 0


class ConventionProperties(NamedTuple):
    """Properties of all joints; prints as a table."""

    joints: tuple[JointProperties, ...]

    def __str__(self) -> str:
        titles = (
            "joint",
            "convention",
            "parameters",
            "dependent",
            "redundant",
            "complete here",
            "everywhere",
            "amplification",
        )
        rows = [
            (
                f"{j.joint}",
                j.convention.removesuffix("Joints"),
                f"{len(j.parameters)}",
                ", ".join(c.name for c in j.dependent) or "-",
                ", ".join(c.name for c in j.redundant) or "-",
                "yes" if j.is_complete else f"{j.missing} missing",
                "yes" if j.covers_all else "no",
                f"{j.amplification:.3g}",
            )
            for j in self.joints
        ]
        table = [titles, *rows]
        widths = [max(map(len, column)) for column in zip(*table)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in table]
        return "\n".join(lines)


def convention_properties(
    chain: SerialChain, *, tolerance: float = 1e-8
) -> ConventionProperties:
    r"""Rank loss, completeness, continuity and minimality of every joint.

    What the tables claim, and what holds of the displacements of the next axis:

    - Denavit-Hartenberg (3-2) loses rank for parallel axes: yes, the determinant is
      $\sin^2\alpha$. "Complete, continuous" is right for finite parameters, and for the
      transform as their function; but small displacements of parallel axes do not have
      small parameters, as the common normal jumps.
    - Hayati-Mirmirani (3-3) loses rank for orthogonal axes and for those that meet in
      the origin of the first frame: yes, the determinant is
      $a\cos\alpha\cos^2\beta$.
    - Veitschegger-Wu (3-4) loses rank for axes that meet the z axis and for those
      parallel to the x-y plane: only for some of them, where $\cos\beta = 0$ (the next
      axis points along x) or $a = \sin\alpha = 0$ (it meets z in the origin and leans
      along x). Identical axes are among the latter, which the convention was made to
      mend. The five parameters depend on each other where $a = \cos\alpha = 0$.
    - Roll-pitch-yaw (3-1) loses rank at $\Theta_y = \pm 90$ degrees only: yes.

    Args:
        chain: in any convention whose parameters are all numbers; not traced.
        tolerance: of `dependent_columns`.

    Raises:
        ValueError: the chain is traced, or keeps parts of its placement as structure.

    References:
        [KinModell] tables 3-1 to 3-4, (3-41).
    """
    numbers = range(1, chain.number + 1)
    local = _Local(chain)
    return ConventionProperties(
        tuple(local.properties(joint, tolerance) for joint in numbers)
    )


def joint_properties(
    chain: SerialChain, joint: int, *, tolerance: float = 1e-8
) -> JointProperties:
    """Properties of one joint, as `convention_properties`.

    Args:
        chain, tolerance: as there.
        joint: its number, from one.

    Raises:
        ValueError: there is no such joint, or as there.
    """
    if not 1 <= joint <= chain.number:
        raise ValueError(f"`joint` must be from 1 to {chain.number}, but is {joint}")
    return _Local(chain).properties(joint, tolerance)


class _Local:
    """Transforms of the joints and their slopes, as numbers."""

    def __init__(self, chain: SerialChain):
        require_float64("the rank of a joint convention")
        self.lines = axis_lines(chain)
        self.number = chain.number
        self.size = characteristic_length(chain)
        self.parameters = ChainParameters.of(chain, base=False, tool=False)
        factors, slopes = factor_slopes(self.parameters, chain.base.dtype)
        self.factors, self.slopes = np.asarray(factors), np.asarray(slopes)
        self.axis = np.asarray(chain.joints.frames().axis, float)
        self.groups = [
            group for group in joint_groups(chain.joints) for _ in range(group.number())
        ]

    def properties(self, joint: int, tolerance: float) -> JointProperties:
        group, entries = self.groups[joint - 1], self.parameters.entries
        which = [e for e, entry in enumerate(entries) if entry.joint == joint]
        names = tuple(entries[e].name for e in which)
        scale = np.array([self.size if entries[e].unit == "m" else 1.0 for e in which])
        own = self._columns(joint, which) * scale
        free_names, free = self._free(group, joint)

        kept, left, factors, _ = dependent_columns(own, tolerance)
        dependent = combinations(names, kept, left, factors, scale)
        both = np.concatenate([free, own], axis=1)
        kept, left, factors, _ = dependent_columns(both, tolerance)
        left_own = [k for k in left if k >= free.shape[1]]
        factors = factors[:, [left.index(k) for k in left_own]]
        scales = np.concatenate([self._free_scale(free_names), scale])
        redundant = combinations(free_names + names, kept, left_own, factors, scales)

        basis, values, _ = np.linalg.svd(free, full_matrices=False)
        basis = basis[:, values > tolerance]
        needed = 6 - basis.shape[1]
        gains = np.zeros(6)
        values = np.linalg.svd(own - basis @ (basis.T @ own), compute_uv=False)
        gains[: len(values)] = values[:6]
        missing = int(np.sum(gains[:needed] <= tolerance))
        worst = 0.0 if needed == 0 else np.inf if missing else 1 / gains[needed - 1]
        return JointProperties(
            joint,
            type(group).__name__,
            names,
            dependent,
            redundant,
            missing,
            float(worst),
            not isinstance(group, HayatiJoints),
        )

    def _columns(self, joint: int, which: list[int]) -> np.ndarray:
        """Twists by the parameters at q = 0, at the origin of the frame behind."""
        before, after = joint, self.number + joint
        first, second = self.factors[before], self.factors[after]
        pose, slopes = first @ second, []
        for e in which:
            slope = self.slopes[before, ..., e] @ second
            slope = slope + first @ self.slopes[after, ..., e]
            turn = slope[:3, :3] @ pose[:3, :3].T
            slopes.append([*slope[:3, 3], turn[2, 1], turn[0, 2], turn[1, 0]])
        columns = np.array(slopes).T
        columns[:3] /= self.size
        return columns

    def _free(self, group, joint: int) -> tuple[tuple[str, ...], np.ndarray]:
        """Displacements that are left to others, at the origin of the frame behind."""
        pose = self.factors[joint] @ self.factors[self.number + joint]
        proximal = isinstance(group, ModifiedDHJoints | RPYJoints | FrameJoints)
        ends = (joint - 1, joint) if proximal else (joint, joint + 1)
        moves = np.eye(6)
        shifts = ("shift_x", "shift_y", "shift_z")
        if isinstance(group, ModifiedDHJoints):
            # what follows from the axis in front
            other, direction, origin = joint - 1, np.array([0.0, 0, 1]), np.zeros(3)
        elif proximal:
            other, direction = joint, self.factors[joint][:3, :3] @ self.axis[joint - 1]
            origin = pose[:3, 3]
        else:
            other, direction, origin = joint + 1, pose[:3, 2], pose[:3, 3]
        if not 1 <= other <= self.number:
            end = "tool" if other else "base"
            return tuple(f"{end}_{c}" for c in ("x", "y", "z", "rx", "ry", "rz")), moves
        lever = np.cross(direction, pose[:3, 3] - origin) / self.size
        turn = np.concatenate([lever, direction])[:, None]
        hinges = [self.lines.turns[k - 1] for k in ends if 1 <= k <= self.number]
        if not all(hinges):
            names = (f"turn_{other}", *shifts)
            return names, np.concatenate([turn, moves[:, :3]], axis=1)
        shift = np.concatenate([direction, np.zeros(3)])[:, None]
        names = (f"turn_{other}", f"shift_{other}")
        return names, np.concatenate([turn, shift], axis=1)

    def _free_scale(self, names: tuple[str, ...]) -> np.ndarray:
        turns = [name.startswith("turn") or "_r" in name for name in names]
        return np.where(turns, 1.0, self.size)
