"""Conversion of chains from one joint convention into another.

The axes are read as lines at q = 0 (`axis_lines`), and frames of the wanted convention
are put on them; base and tool take up what is left. Offsets absorb the zeros, so that
the joint coordinates stay the same and the tool's pose too, for every q.
"""

import numpy as np

from ._axis_frames import Row, Walk, denavit_row, hayati_row, tool_row
from ._axis_lines import AxisLines, axis_lines
from ._chain import SerialChain
from ._joints import AbstractJoints, DHJoints, RPYJoints
from ._link_conventions import (
    HayatiJoints,
    MixedJoints,
    ModifiedDHJoints,
    VeitscheggerWuJoints,
)


PARALLEL = np.deg2rad(10.0)


def to_dh(chain: SerialChain) -> SerialChain:
    """The same chain with standard Denavit-Hartenberg joints.

    The common normals of parallel axes stand where the frame in front is (d = 0). The
    last row leads to the tool's z axis, or is zero where that is nearly parallel to
    the last axis.

    Args:
        chain: in any convention; its numbers must not be traced.

    Raises:
        ValueError: two axes are so nearly parallel, without being so, that their common
            normal lies too far off for double precision; the joint is named.

    References:
        [KinModell] table 3-2.
    """
    walk = _dh_walk(chain)
    names = ("theta", "d", "a", "alpha")
    return _chain(chain, DHJoints(*map(walk.column, names)), walk.first, walk.rest())


def to_modified_dh(chain: SerialChain) -> SerialChain:
    """The same chain with modified Denavit-Hartenberg joints, as `to_dh`.

    The first frame stands on axis 1: the first twist and length are zero.

    Raises:
        ValueError: as for `to_dh`.
    """
    walk = _dh_walk(chain)
    last = walk.rows[-1]
    shift = lambda name: np.concatenate([[0.0], walk.column(name)[:-1]])
    joints = ModifiedDHJoints(
        shift("alpha"), shift("a"), walk.column("theta"), walk.column("d")
    )
    tool = Row(a=last.a, alpha=last.alpha).matrix() @ walk.rest()
    return _chain(chain, joints, walk.first, tool)


def to_hayati(chain: SerialChain) -> SerialChain:
    """The same chain with Hayati-Mirmirani joints.

    Raises:
        ValueError: the next axis of a revolute joint does not pierce the x-y plane of
            the frame in front in one point (perpendicular axes), or is the same line,
            so that $\\theta$ is undetermined; the joint is named.

    References:
        [KinModell] table 3-3.
    """
    walk = Walk(chain)
    for k in range(chain.number - 1):
        walk.step(hayati_row(walk, k))
    walk.step(Row())  # the tool's pose says the rest
    names = ("theta", "a", "alpha", "beta")
    joints = HayatiJoints(*map(walk.column, names))
    return _chain(chain, joints, walk.first, walk.rest())


def to_veitschegger_wu(
    chain: SerialChain, *, parallel: float = PARALLEL
) -> SerialChain:
    """The same chain with Veitschegger-Wu joints.

    Five parameters say four things; here $\\beta$ is zero where axes are not nearly
    parallel (the rows of Denavit and Hartenberg), and d where they are.

    Args:
        chain: in any convention; its numbers must not be traced.
        parallel: angle below which axes are nearly parallel [rad].

    References:
        [KinModell] table 3-4.
    """
    walk = Walk(chain)
    for k in range(chain.number - 1):
        line = walk.next_line(k)
        if line.sine >= np.sin(parallel):
            walk.step(denavit_row(walk, line, k))
        else:
            walk.step(hayati_row(walk, k, determined=False))
    walk.step(tool_row(walk))
    names = ("theta", "d", "a", "alpha", "beta")
    joints = VeitscheggerWuJoints(*map(walk.column, names))
    return _chain(chain, joints, walk.first, walk.rest())


def to_rpy(chain: SerialChain) -> SerialChain:
    """The same chain with joints given by position and roll-pitch-yaw angles.

    The frames of the joints stand at the joints' own origins and are parallel to the
    base frame at q = 0, so that all angles are zero and far from their singularity.

    References:
        [KinModell] (3-11), table 3-1.
    """
    lines = axis_lines(chain)
    joints, tool = _rpy(lines, 0, lines.base)
    return _chain(chain, joints, lines.base, tool)


def to_mixed(
    chain: SerialChain, *, parallel: float = PARALLEL, identical: float = 1e-3
) -> SerialChain:
    """The same chain in the convention that suits each pair of neighbouring axes.

    Denavit and Hartenberg's for axes that are not nearly parallel, Hayati and
    Mirmirani's for those that are, as the text recommends. Where two hinges turn about
    nearly the same line neither can move the second one sideways: from there on the
    joints have roll-pitch-yaw angles. A result of one convention is not mixed.

    Args:
        chain: in any convention; its numbers must not be traced.
        parallel: angle below which axes are nearly parallel [rad].
        identical: distance of nearly parallel axes below which they are nearly the same
            line, as a share of the arm's size.

    References:
        [KinModell] section 3.1, summary.
    """
    walk = Walk(chain)
    kinds: list[type[AbstractJoints]] = []
    tail = None
    for k in range(chain.number - 1):
        line, hinges = walk.next_line(k), all(walk.lines.turns[k : k + 2])
        if line.sine >= np.sin(parallel):
            kinds.append(DHJoints)
            walk.step(denavit_row(walk, line, k))
        elif hinges and line.off_axis < identical * walk.size:
            kinds.append(DHJoints)
            walk.step(Row())
            tail = _rpy(walk.lines, k + 1, walk.frame)
            break
        else:
            kinds.append(HayatiJoints)
            walk.step(hayati_row(walk, k, determined=False))
    if tail is None:
        kinds.append(DHJoints)
        walk.step(tool_row(walk))
    groups: list[AbstractJoints] = []
    first = 0
    for k in range(1, len(kinds) + 1):
        if k == len(kinds) or kinds[k] is not kinds[first]:
            groups.append(_group(kinds[first], walk.rows[first:k]))
            first = k
    tool = walk.rest()
    if tail is not None:
        joints, tool = tail
        groups.append(joints)
    joints = groups[0] if len(groups) == 1 else MixedJoints(tuple(groups))
    return _chain(chain, joints, walk.first, tool)


def _dh_walk(chain: SerialChain) -> Walk:
    walk = Walk(chain)
    for k in range(chain.number - 1):
        walk.step(denavit_row(walk, walk.next_line(k), k))
    walk.step(tool_row(walk))
    return walk


def _rpy(lines: AxisLines, start: int, frame: np.ndarray):
    """Joints from `start` on behind `frame`, parallel to it, and the tool."""
    rotation, origin = frame[:3, :3], frame[:3, 3]
    points = (lines.points[start:] - origin) @ rotation
    position = np.diff(points, axis=0, prepend=np.zeros((1, 3)))
    axis = lines.directions[start:] @ rotation
    last = np.eye(4)
    last[:3, :3], last[:3, 3] = rotation, lines.points[-1]
    joints = RPYJoints(position, np.zeros_like(position), axis)
    return joints, np.linalg.solve(last, lines.tool)


def _group(kind: type[AbstractJoints], rows: list[Row]) -> AbstractJoints:
    column = lambda name: np.array([getattr(row, name) for row in rows])
    if kind is HayatiJoints:
        return HayatiJoints(*map(column, ("theta", "a", "alpha", "beta")))
    return DHJoints(*map(column, ("theta", "d", "a", "alpha")))


def _chain(chain: SerialChain, joints, base, tool) -> SerialChain:
    return SerialChain(joints, base, tool, chain.kinds)
