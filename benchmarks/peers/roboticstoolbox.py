"""Chains of elastax as transforms of the Robotics Toolbox, and its searches."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
import roboticstoolbox as rtb
from elastax.kinematics import Arm, JointKind
from roboticstoolbox import ET, ETS


class Searched(NamedTuple):
    """What the searches of many targets found.

    Attributes:
        q: solutions, one per row.
        reached: whether the toolbox calls the target reached.
        iterations: of all searches of a target.
        searches: number of starts.
    """

    q: np.ndarray
    reached: np.ndarray
    iterations: np.ndarray
    searches: np.ndarray


def sequence(arm: Arm) -> ETS:
    """The elementary transforms of a chain of revolute joints, with its limits.

    Raises:
        ValueError: a joint slides.
    """
    if any(kind is not JointKind.REVOLUTE for kind in arm.chain.kinds):
        raise ValueError("the chain must have revolute joints only, but has others")
    frames, base, tool = jax.device_get(
        (arm.chain.joints.frames(), arm.chain.base, arm.chain.tool)
    )
    lower, upper = np.asarray(arm.lower), np.asarray(arm.upper)
    pending, parts = np.asarray(base), []
    for k in range(arm.chain.number):
        turn = _turn_to(np.asarray(frames.axis[k]))
        parts.append(ET.SE3(pending @ frames.before[k] @ turn))
        parts.append(ET.Rz(qlim=np.array([lower[k], upper[k]])))
        pending = turn.T @ frames.after[k]
    parts.append(ET.SE3(pending @ tool))
    return ETS(parts)


def _turn_to(axis: np.ndarray) -> np.ndarray:
    """Rotation that maps z onto an axis, (4, 4)."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(axis, x), axis], axis=1)
    return pose


def searches(
    ets: ETS, targets: np.ndarray, starts: int, tolerance: float, **options
) -> Callable[[], Searched]:
    """Levenberg-Marquardt in C++ for one target after another, called from Python.

    Args:
        ets: the arm.
        targets: poses, shape (targets, 4, 4).
        starts: largest number of random starts.
        tolerance: largest length of the error [m] and [rad].
        options: `k`, `method` and others of `ETS.ik_LM`.
    """
    # the toolbox compares half the squared error
    options = {"ilimit": 30, "slimit": starts, "tol": 0.5 * tolerance**2} | options

    def run():
        found = [ets.ik_LM(target, joint_limits=True, **options) for target in targets]
        return Searched(
            np.array([s.q for s in found]),
            np.array([s.success for s in found], bool),
            np.array([s.iterations for s in found]),
            np.array([s.searches for s in found]),
        )

    return run


def poses(ets: ETS, q: np.ndarray) -> np.ndarray:
    """Poses of the tool, (samples, 4, 4)."""
    return np.stack([ets.fkine(row).A for row in q])


def version() -> str:
    """Of the toolbox."""
    return rtb.__version__
