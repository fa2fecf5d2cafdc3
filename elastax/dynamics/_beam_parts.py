"""Hinged beams as parts of a robot."""

import numpy as np

from ..structure import BeamSegments, ClampHinges, GaussHinges
from ._parts import Body, ElasticJoint, EndSlope, Offset, Part


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def segmented_beam_parts(
    name: str, segments: BeamSegments, hinges: GaussHinges, damping
) -> list[Part]:
    """Four rigid segments along x with five hinges, up to the tip of the beam.

    Coordinates `name y 1`, `name z 1`, `name x`, `name y 2`, `name z 2`.

    Args:
        name: of the beam.
        segments: masses, lengths and inertias.
        hinges: springs.
        damping: dampers of the hinges about x, y, z, shape (3,) [N m s/rad].

    References:
        [Reiner2010] section 2.4.3, figure 2.10.
    """
    lengths = np.asarray(segments.lengths)
    masses, inertias = np.asarray(segments.masses), np.asarray(segments.inertias)
    stiffness = np.asarray(hinges.stiffness)
    damping = np.broadcast_to(np.asarray(damping, float), (3,))

    def hinge(label, axis, k):
        return ElasticJoint(f"{name} {label}", axis, stiffness[k], damping[k])

    def segment(k):
        half = (0.5 * lengths[k], 0.0, 0.0)
        body = Body(f"{name} {k + 1}", masses[k], half, np.diag(inertias[k]))
        return [body, Offset((lengths[k], 0.0, 0.0))]

    return [
        *segment(0),
        hinge("y 1", Y, 1),
        hinge("z 1", Z, 2),
        *segment(1),
        hinge("x", X, 0),
        *segment(2),
        hinge("y 2", Y, 1),
        hinge("z 2", Z, 2),
        *segment(3),
    ]


def clamped_beam_parts(
    name: str, body: Body, hinges: ClampHinges, damping
) -> list[Part]:
    """A rigid beam on three hinges, with dependent ones at its tip.

    Coordinates `name x`, `name y`, `name z`.

    Args:
        name: of the beam.
        body: its mass, in the frame of the clamp.
        hinges: springs.
        damping: dampers about x, y, z, shape (3,) [N m s/rad].

    References:
        [Reiner2010] section 2.4.3, figure 2.11.
    """
    stiffness = np.asarray(hinges.stiffness)
    damping = np.broadcast_to(np.asarray(damping, float), (3,))
    joints = [
        ElasticJoint(f"{name} {label}", axis, stiffness[k], damping[k])
        for k, (label, axis) in enumerate((("x", X), ("y", Y), ("z", Z)))
    ]
    factor = hinges.load.slope_factor
    return [
        *joints,
        body,
        Offset((float(hinges.length), 0.0, 0.0)),
        EndSlope(f"{name} y", factor),
        EndSlope(f"{name} z", factor),
    ]
