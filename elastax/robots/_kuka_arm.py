"""Elastic joints of a KUKA arm: tilts, link arm and forearm."""

import numpy as np

from ..dynamics import Body, ElasticJoint, EndSlope, Part, WristCentre, dh_link
from ..structure import BeamSection, Material, UniformBeam


def arm_parts(
    table: np.ndarray,
    bodies: list[Body],
    *,
    bearing_stiffness: tuple[float, float],
    link_arm: BeamSection,
    forearm: BeamSection,
    material: Material,
    damping_time: float,
) -> list[Part]:
    """Six axes with eight elastic coordinates.

    Carousel tilt about x and y; link-arm torsion and lateral hinge with end slope; tilt
    about x and y at axis 3; two bending hinges of the forearm at axis 4 with end
    slopes. Bending of the link arm in its plane and torsion of the forearm lie in line
    with the axes 2 and 4 and belong to their gears.

    Args:
        table: rows theta, d, a, alpha of the Denavit-Hartenberg table, shape (6, 4).
        bodies: one per link, in the distal frames.
        bearing_stiffness: tilt stiffness of the axes 1 and 3 [N m/rad].
        link_arm, forearm: cross sections; lengths are those of the table.
        material: of both beams.
        damping_time: damper over spring of all elastic coordinates [s].

    References:
        [Reiner2010] sections 2.4.1 and 2.4.3.
    """
    clamp = lambda section, length: np.asarray(
        UniformBeam(material, section, abs(float(length))).clamp_stiffness()
    ).tolist()
    arm = clamp(link_arm, table[1, 2])
    # the forearm runs along z of its frame: rotate the beam's x, y, z to z, x, y
    tube = clamp(forearm, table[3, 1])

    def hinge(name, axis, stiffness):
        return ElasticJoint(name, axis, stiffness, damping_time * stiffness)

    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    hinges = {
        0: (
            hinge("tilt 1 x", x, bearing_stiffness[0]),
            hinge("tilt 1 y", y, bearing_stiffness[0]),
        ),
        1: (hinge("link arm torsion", x, arm[0]), hinge("link arm lateral", y, arm[1])),
        2: (
            hinge("tilt 3 x", x, bearing_stiffness[1]),
            hinge("tilt 3 y", y, bearing_stiffness[1]),
        ),
        3: (hinge("forearm x", x, tube[1]), hinge("forearm y", y, tube[2])),
    }
    slopes = {
        1: (EndSlope("link arm lateral", 0.5),),
        3: (EndSlope("forearm x", 0.5), EndSlope("forearm y", 0.5)),
    }
    parts: list[Part] = []
    for k, (theta, d, a, alpha) in enumerate(table):
        if k == 4:
            parts.append(WristCentre())
        parts += dh_link(
            f"A{k + 1}",
            theta,
            d,
            a,
            alpha,
            bodies[k],
            hinges=hinges.get(k, ()),
            slopes=slopes.get(k, ()),
        )
    return parts
