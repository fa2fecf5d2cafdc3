"""Flexible links of a robot file: SID data at an axis."""

import pathlib

import numpy as np

from ..dynamics import FlexibleLink
from ..structure import ModalBody
from ._sid_dialect import FEMBEAM, FEMBS, MATMOREMBS, PY_SID
from ._sid_read import load_sid


DIALECTS = {
    "FEMBS": FEMBS,
    "PY_SID": PY_SID,
    "MatMorembs": MATMOREMBS,
    "FEMBeam": FEMBEAM,
}


def member_of(axis, where: str, folder: pathlib.Path) -> FlexibleLink | None:
    """The flexible part of a link, in the frame of its axis; `None` without one.

    Args:
        axis: checked table of the axis.
        where: its place in the file.
        folder: from which the name of the SID file counts.

    Raises:
        ValueError: the SID file is refused, a node is unknown, or the nodes do not lie
            as far from each other as the row of the axis says.
    """
    data = axis["flexible"]
    if data is None:
        return None
    path = folder / data["file"]
    try:
        body = load_sid(path, dialect=DIALECTS.get(data["dialect"])).modal_body()
    except OSError as error:
        reason = error.strerror or "unreadable"
        raise ValueError(f"`{where}.file`: {path} cannot be read: {reason}") from None
    body = _in_modes(body, data, where)
    for key in ("base", "tip"):
        if data[key] not in body.nodes.names:
            raise ValueError(
                f"`{where}.{key}` must name a node of {path.name} "
                f"({', '.join(body.nodes.names[:8])}), but is `{data[key]}`"
            )
    place = np.asarray(body.nodes.position)
    nodes = body.nodes
    reach = place[nodes.index(data["tip"])] - place[nodes.index(data["base"])]
    expected = np.array([axis["a"], 0.0, axis["d"]])
    if np.linalg.norm(reach - expected) > 1e-6 * max(np.linalg.norm(expected), 1e-3):
        raise ValueError(
            f"`{where}`: from `base` to `tip` the body must reach by a along x and by "
            f"d along z, {_point(expected)} m, but does by {_point(reach)}: check the "
            "nodes, the frame and the unit of length of the SID file"
        )
    return FlexibleLink(axis["name"] + " link", body, data["tip"], data["base"])


def _in_modes(body: ModalBody, data, where: str) -> ModalBody:
    stiffness = np.asarray(body.K_e)
    if np.abs(stiffness - np.diag(np.diag(stiffness))).max() > 0:
        body = body.in_eigenmodes()
    if data["modes"] is not None:
        if not 1 <= data["modes"] <= body.modes:
            raise ValueError(
                f"`{where}.modes` must be 1 to {body.modes}, but is {data['modes']}"
            )
        body = body.selected(range(data["modes"]))
    if data["damping_ratio"] is not None:
        body = body.with_damping_ratio(data["damping_ratio"])
    return body


def _point(x: np.ndarray) -> str:
    return f"({x[0]:.6g}, {x[1]:.6g}, {x[2]:.6g})"
