"""Which of the eight branches a six-axis arm stands in, as its controller tells them.

Three questions have two answers each: whether the wrist is in front of axis 1 or
behind it, whether the elbow is above the line from shoulder to wrist, and to which
side axis 5 is bent. Front, up and zero are those of the maker.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import Scalar
from ._arm import Arm
from ._ik_analytic import Geometry, SphericalWrist, read_geometry
from ._safe_angles import wrapped
from ._se3 import rotation_about


class Posture(eqx.Module):
    """Branch of a six-axis arm with a spherical wrist.

    Attributes:
        behind: the wrist centre lies behind axis 1, seen in the direction that the base
            frame's x has turned into with axis 1.
        elbow_up: axis 3 lowers the forearm from the stretched arm, which leaves the
            elbow above the line from axis 2 to the wrist of an arm that reaches
            forward. True for the stretched arm.
        flipped: axis 5 raises the hand from the wrist with axes 4 and 6 aligned, axis 4
            at the maker's zero. False for the aligned wrist.
    """

    behind: Bool[Array, ""] = eqx.field(converter=jnp.asarray)
    elbow_up: Bool[Array, ""] = eqx.field(converter=jnp.asarray)
    flipped: Bool[Array, ""] = eqx.field(converter=jnp.asarray)


class _Senses(NamedTuple):
    """Signs that lead from the chain's own branches to the controller's answers."""

    front: Scalar
    lowering: Scalar
    raising: Scalar


def posture_of(arm: Arm, q: Float[Array, "6"]) -> Posture:
    """Posture of a six-axis arm at given joint angles.

    Args:
        arm: with a chain that `SphericalWrist` accepts.
        q: the chain's angles [rad], shape (6,), of any number of turns.

    Raises:
        ValueError: the wrist of `arm` is not spherical.
    """
    g = read_geometry(SphericalWrist(arm.chain).chain)
    forward, elbow, bend = _signed_branch(g, q)
    senses = _senses(arm, g)
    return Posture(
        behind=senses.front * forward < 0,
        elbow_up=senses.lowering * elbow >= 0,
        flipped=senses.raising * bend > 0,
    )


def branch_index(arm: Arm, posture: Posture) -> Int[Array, ""]:
    """Row of `inverse_kinematics` that holds the angles of a posture."""
    g = read_geometry(SphericalWrist(arm.chain).chain)
    senses = _senses(arm, g)
    shoulder = posture.behind ^ (senses.front < 0)
    elbow = posture.elbow_up ^ (senses.lowering > 0)
    wrist = posture.flipped ^ (senses.raising > 0)
    return 4 * shoulder.astype(int) + 2 * elbow.astype(int) + wrist.astype(int)


def _signed_branch(g: Geometry, q: Float[Array, "6"]):
    """Forward distance of the wrist [m], turns of axes 3 and 5 from their middle."""
    turn_2, turn_3 = g.signs[0] * q[1], g.signs[1] * q[2]
    sine, cosine = jnp.sin(turn_3), jnp.cos(turn_3)
    knee_x = g.upper[0] + cosine * g.fore[0] + sine * g.fore[1]
    knee_z = g.upper[1] + cosine * g.fore[1] - sine * g.fore[0]
    forward = g.shoulder[0] + jnp.cos(turn_2) * knee_x + jnp.sin(turn_2) * knee_z
    stretched = jnp.arctan2(
        g.upper[0] * g.fore[1] - g.upper[1] * g.fore[0], g.upper @ g.fore
    )
    elbow = wrapped(q[2] - g.signs[1] * stretched)
    return forward, elbow, wrapped(q[4] + g.wrist_zero)


def _senses(arm: Arm, g: Geometry) -> _Senses:
    # the base frame's x and z, carried along by axis 1 from its zero to q = 0
    x, up = arm.chain.base[:3, 0], arm.chain.base[:3, 2]
    front = rotation_about(g.axes[0], -arm.zeros[0]) @ x
    # what turns about +lowering takes the front down
    lowering = jnp.cross(up, front)
    # axis 5 with axis 4 at the maker's zero
    axis_5 = rotation_about(g.wrist[2], arm.zeros[3]) @ g.wrist[1]
    sign = lambda value: jnp.where(value < 0, -1.0, 1.0)
    return _Senses(
        front=sign(front @ g.arm[0]),
        lowering=sign(lowering @ g.axes[2]),
        raising=sign(-(lowering @ axis_5)),
    )
