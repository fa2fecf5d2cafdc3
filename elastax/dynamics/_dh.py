"""Parts of an elastic link that is given by a Denavit-Hartenberg row."""

import numpy as np

from ._parts import Axis, Body, ElasticJoint, EndSlope, FlexibleLink, Offset, Part


def dh_link(
    name: str,
    theta: float,
    d: float,
    a: float,
    alpha: float,
    body: Body | None,
    *,
    member: FlexibleLink | None = None,
    hinges: tuple[ElasticJoint, ...] = (),
    slopes: tuple[EndSlope, ...] = (),
) -> list[Part]:
    """Axis and elastic link of one row of a Denavit-Hartenberg table.

    The hinges sit at the axis, behind the drive; the body hangs on them and is given in
    the distal frame of the row; the end slopes sit in the origin of that frame, about
    the axes of the hinges.

    Args:
        name: of the axis.
        theta: joint offset [rad].
        d: offset along z [m].
        a: length along x [m].
        alpha: twist about x [rad].
        body: in the distal frame; a link with a flexible member may have none.
        member: flexible part of the link, in the frame of the axis: from `base` to
            `node` it must reach by a along x and by d along z.
        hinges: tilt joints or beam hinges, in the frame of the axis.
        slopes: end-slope joints.
    """
    twist = np.array(
        [
            [1.0, 0.0, 0.0],
            [0.0, _clean(np.cos(alpha)), -_clean(np.sin(alpha))],
            [0.0, _clean(np.sin(alpha)), _clean(np.cos(alpha))],
        ]
    )
    turn = np.array(
        [
            [_clean(np.cos(theta)), -_clean(np.sin(theta)), 0.0],
            [_clean(np.sin(theta)), _clean(np.cos(theta)), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    parts: list[Part] = [Offset(rotation=turn), Axis(name), *hinges]
    if member is None:
        parts.append(Offset((a, 0.0, d), twist))
    else:
        parts += [member, Offset(rotation=twist)]
    if body is not None:
        parts.append(body)
    if slopes:
        parts += [Offset(rotation=twist.T), *slopes, Offset(rotation=twist)]
    return parts


def _clean(x: float) -> float:
    """Cosines of right angles as exact zeros."""
    return 0.0 if abs(x) < 1e-15 else float(x)
