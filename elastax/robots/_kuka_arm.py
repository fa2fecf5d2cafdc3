"""Elastic joints of a KUKA arm: tilts, link arm and forearm."""

import dataclasses

import numpy as np

from ..dynamics import (
    Body,
    ElasticJoint,
    EndSlope,
    Offset,
    Part,
    WristCentre,
    dh_link,
)
from ..structure import BeamSection, Material, UniformBeam
from ._arm_structure import AbstractArmStructure, HingedArm, Member


def arm_parts(
    table: np.ndarray,
    bodies: list[Body],
    *,
    bearing_stiffness: tuple[float, float],
    link_arm: BeamSection,
    forearm: BeamSection,
    material: Material,
    damping_time: float,
    structure: AbstractArmStructure = HingedArm(),
) -> list[Part]:
    """Six axes with the elastic coordinates of a structural detail.

    Carousel tilt about x and y and tilt about x and y at axis 3 at every detail. With
    `HingedArm` link-arm torsion and lateral hinge with end slope, and two bending
    hinges of the forearm at axis 4 with end slopes: bending of the link arm in its
    plane and torsion of the forearm lie in line with the axes 2 and 4 and belong to
    their gears. Members with mass of their own have these as well; the forearm's tube
    then stands between the axes 3 and 4, in whose direction it runs.

    Args:
        table: rows theta, d, a, alpha of the Denavit-Hartenberg table, shape (6, 4).
        bodies: one per link, in the distal frames.
        bearing_stiffness: tilt stiffness of the axes 1 and 3 [N m/rad].
        link_arm, forearm: cross sections; lengths are those of the table.
        material: of both beams.
        damping_time: damper over spring of all elastic coordinates [s].
        structure: detail of both members.

    References:
        [Reiner2010] sections 2.4.1 to 2.4.3.
    """
    arm = UniformBeam(material, link_arm, abs(float(table[1, 2])))
    tube = UniformBeam(material, forearm, abs(float(table[3, 1])))

    def hinge(name, axis, stiffness):
        return ElasticJoint(name, axis, stiffness, damping_time * stiffness)

    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    hinges = {
        0: (
            hinge("tilt 1 x", x, bearing_stiffness[0]),
            hinge("tilt 1 y", y, bearing_stiffness[0]),
        ),
        2: (
            hinge("tilt 3 x", x, bearing_stiffness[1]),
            hinge("tilt 3 y", y, bearing_stiffness[1]),
        ),
    }
    slopes = {}
    if structure.has_hinges:
        clamp = np.asarray(arm.clamp_stiffness()).tolist()
        # the forearm runs along z of its frame: rotate the beam's x, y, z to z, x, y
        bending = np.asarray(tube.clamp_stiffness()).tolist()
        hinges[1] = (
            hinge("link arm torsion", x, clamp[0]),
            hinge("link arm lateral", y, clamp[1]),
        )
        hinges[3] = (
            hinge("forearm x", x, bending[1]),
            hinge("forearm y", y, bending[2]),
        )
        slopes = {
            1: (EndSlope("link arm lateral", 0.5),),
            3: (EndSlope("forearm x", 0.5), EndSlope("forearm y", 0.5)),
        }
    members: dict[int, Member] = {}
    if not structure.has_hinges:
        members = {
            1: structure.member("link arm", arm, damping_time),
            2: structure.member("arm", tube, damping_time),
        }
    parts: list[Part] = []
    for k, (theta, d, a, alpha) in enumerate(table):
        if k == 4:
            parts.append(WristCentre())
        if k == 1 and 1 in members:
            parts += _link_arm((theta, d, a, alpha), bodies[1], members[1])
            continue
        link = dh_link(
            f"A{k + 1}",
            theta,
            0.0 if k == 3 and 2 in members else d,
            a,
            alpha,
            bodies[k],
            hinges=hinges.get(k, ()),
            slopes=slopes.get(k, ()),
        )
        if k == 2 and 2 in members:
            link = _with_forearm(link, float(table[3, 1]), members[2])
        parts += link
    return parts


def _link_arm(row, body: Body, member: Member) -> list[Part]:
    """Axis 2 with a member along x, the way of its row behind it."""
    theta, d, a, alpha = (float(x) for x in row)
    if a < 0:
        raise ValueError("the link arm must run along x of its frame")
    axis = dh_link("A2", theta, 0.0, 0.0, 0.0, body)
    shape = dh_link("A2", 0.0, d, a, alpha, body)[2]
    assert isinstance(shape, Offset)
    distal = np.asarray(shape.rotation)
    com = np.array([a, 0.0, d]) + distal @ np.asarray(body.com, float)
    inertia = distal @ np.asarray(body.inertia, float) @ distal.T
    clamped = dataclasses.replace(body, com=tuple(com), inertia=inertia)
    rest = Offset((0.0, 0.0, d), distal)
    return [*axis[:2], *_clamped(member, clamped), rest]


def _with_forearm(link: list[Part], d: float, member: Member) -> list[Part]:
    """Link 3 with a member along z, up to the wrist, behind it."""
    sign = 1.0 if d > 0 else -1.0
    # x, y, z of the member are sign z, x, sign y of the frame
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, sign], [sign, 0.0, 0.0]])
    body = link[-1]
    assert isinstance(body, Body)
    com = turn.T @ np.asarray(body.com, float)
    inertia = turn.T @ np.asarray(body.inertia, float) @ turn
    clamped = dataclasses.replace(body, com=tuple(com), inertia=inertia)
    return [
        *link[:-1],
        Offset(rotation=turn),
        *_clamped(member, clamped),
        Offset(rotation=turn.T),
    ]


def _clamped(member: Member, body: Body) -> list[Part]:
    """A member beside the axis of its link, and what the link has besides it."""
    if member.mass == 0:
        return [body, *member.parts]
    aside = np.asarray(body.com, float) * [0.0, 1.0, 1.0]
    moved = member._replace(com=member.com + aside)
    return [moved.taken_off(body), Offset(aside), *member.parts, Offset(-aside)]
