"""How flexible bodies are attached to joints, and other parts to their nodes."""

import dataclasses

import numpy as np

from ..kinematics import JointKind, Placement
from ..structure import ModalBody


# of mode shapes and matrices: what is left of zeros after files and eigensolvers
_ZERO = 1e-9


def mounted_body(part, place: Placement) -> ModalBody:
    """The body of a `FlexibleLink` in the frame behind the joint that carries it.

    Args:
        part: the flexible link.
        place: of the point of attachment in the frame behind the joint in front.

    Raises:
        ValueError: the modes move the point of attachment, or stiffness or damping are
            not diagonal.
    """
    body = dataclasses.replace(part.body, name=part.name)
    if part.base is not None:
        shift = -np.asarray(body.nodes.position)[body.nodes.index(part.base)]
        if shift.any():
            body = body.moved(np.eye(3), shift)
    _check_diagonal(body)
    at = np.zeros(3) if place.position is None else np.asarray(place.position)
    if part.floating:
        if part.base is None:
            raise ValueError(f"`{part.name}` floats: name its `base` node")
        at = np.zeros(3)
    else:
        _check_clamped(body)
    if not at.any() and np.array_equal(place.rotation, np.eye(3)):
        return body
    return body.moved(place.rotation, at)


def base_motion(body: ModalBody, base: str | None):
    """Joints that lead from a node of attachment to the frame of its body.

    What `node_motion` does, undone: the rotations back, then the displacements.
    """
    assert base is not None
    _, steps = node_motion(body, base)
    return [(axis, kind, -factors) for axis, kind, factors in reversed(steps)]


def _check_clamped(body: ModalBody) -> None:
    position = np.asarray(body.nodes.position)
    size = np.abs(position).max(initial=0.0)
    for name, values in (("phi", body.nodes.phi), ("psi", body.nodes.psi)):
        shapes = np.asarray(values)
        largest = np.abs(shapes).max(initial=0.0)
        for k, node in enumerate(body.nodes.names):
            if np.linalg.norm(position[k]) > _ZERO * size:
                continue
            moving = np.abs(shapes[k]).max(axis=0)
            if not np.all(moving <= 1e-6 * largest):
                modes = [body.mode_names[m] for m in np.flatnonzero(moving > 0)]
                raise ValueError(
                    f"the modes {', '.join(modes)} of `{body.name}` move the node "
                    f"`{node}` at which it is attached ({name} is not zero there): "
                    "take modes that are clamped where the body is attached, attach it "
                    "by a `base` node at which they are, or let it float"
                )


def _check_diagonal(body: ModalBody) -> None:
    for name in ("K_e", "D_e"):
        matrix = np.asarray(getattr(body, name))
        beside = np.abs(matrix - np.diag(np.diag(matrix))).max(initial=0.0)
        if beside > _ZERO * np.abs(matrix).max(initial=0.0):
            raise ValueError(
                f"`{name}` of `{body.name}` must be diagonal in a robot: take "
                "`body.in_eigenmodes()`, with `with_damping_ratio` if the damping is "
                "not diagonal there"
            )
    if not np.all(np.diag(np.asarray(body.K_e)) > 0):
        raise ValueError(
            f"every mode of `{body.name}` must have a positive stiffness: leave "
            "rigid-body modes out with `body.selected`"
        )


def node_motion(body: ModalBody, node: str):
    """Joints that move what is attached to a node.

    Three displacements, then three rotations about x, y and z one after the other,
    which is the node's small rotation to first order. Those that no mode moves are left
    out, and so is the second-order displacement.

    Returns:
        Position of the node [m], and for every joint its axis, its kind and how much
        each mode moves it, shape (modes,).
    """
    index = body.nodes.index(node)
    steps = []
    for kind, values in (
        (JointKind.PRISMATIC, body.nodes.phi),
        (JointKind.REVOLUTE, body.nodes.psi),
    ):
        shapes = np.asarray(values)[index]
        smallest = 1e-12 * np.abs(shapes).max(initial=0.0)
        for axis, factors in zip(np.eye(3), shapes):
            factors = np.where(np.abs(factors) > smallest, factors, 0.0)
            if factors.any():
                steps.append((axis, kind, factors))
    return np.asarray(body.nodes.position)[index], steps
