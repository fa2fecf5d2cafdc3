"""Configuration flags of controllers: KUKA's Status and Turn, Fanuc's N U T.

Together with the pose of the tool they name one vector of joint angles.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import PerJoint, Transform
from ._arm import Arm
from ._ik_analytic import SphericalWrist, inverse_kinematics
from ._posture import Posture, branch_index, posture_of
from ._safe_angles import wrapped
from ._wrist_weights import WristWeights


_AT_ZERO = 1e-6  # rad: an angle this close to zero satisfies either sign
_TURN_AXES = np.array([0, 3, 5])  # axes whose turns Fanuc counts


class KukaConfiguration(eqx.Module):
    """Status and Turn of a KUKA arm.

    Bit 0 of Status: the wrist centre has a negative x in the frame that turns with
    axis 1. Bit 1: axis 3 has passed the angle at which the wrist lies on the line
    through the axes 2 and 3, in its positive sense. Bit 2: axis 5 is negative. Bit k of
    Turn: axis k + 1 is negative.

    What is ambiguous: an axis at exactly zero counts as positive here, while a
    controller reads the sign of its encoder's rounding; users report that KUKA's own
    manuals describe bit 2 unclearly; bits 3 and 4 of newer controllers are left at
    zero; and Turn tells apart one turn to each side only, not the turns of an endless
    axis.

    Attributes:
        status: 0 to 7.
        turn: 0 to 63.

    References:
        The manuals of two controllers that take KUKA's flags over: [Siemens2019],
        p. 710, address STAT; [BeckhoffTF5200], "Status & Turn (IS, IT)".
    """

    status: Int[Array, ""] = eqx.field(converter=jnp.asarray)
    turn: Int[Array, ""] = eqx.field(converter=jnp.asarray)


class FanucConfiguration(eqx.Module):
    """Wrist, elbow, front and turns of a Fanuc arm, such as `N U T, 0, 0, 0`.

    No document of the maker was at hand, the letters follow what users publish of it:
    F or N for the wrist flipped or not, U or D for the elbow up or down, T or B for the
    wrist in front of axis 1 or behind it; then whole turns of the axes 1, 4 and 6,
    counted from -180 degrees on. What is ambiguous: N is read here as the hand bent
    down with axis 4 at zero, since arms in their usual pose with the tool down show N;
    some robots count the turns of other axes; the elbow of an arm that reaches behind
    itself is judged by the angle of axis 3, as KUKA does; the letter L or R that some
    arms have in addition is left out.

    Attributes:
        flip: F instead of N.
        up: U instead of D.
        front: T instead of B.
        turns: of the axes 1, 4 and 6, shape (3,).
    """

    flip: Bool[Array, ""] = eqx.field(converter=jnp.asarray)
    up: Bool[Array, ""] = eqx.field(converter=jnp.asarray)
    front: Bool[Array, ""] = eqx.field(converter=jnp.asarray)
    turns: Int[Array, "3"] = eqx.field(converter=jnp.asarray)

    def text(self) -> str:
        """The flags as the teach pendant shows them; not for traced values."""
        letters = (
            "F" if self.flip else "N",
            "U" if self.up else "D",
            "T" if self.front else "B",
        )
        turns = ", ".join(str(int(turn)) for turn in self.turns)
        return f"{' '.join(letters)}, {turns}"


def kuka_configuration(arm: Arm, q: Float[Array, "6"]) -> KukaConfiguration:
    """Status and Turn at given joint angles.

    Args:
        arm: a KUKA arm with a spherical wrist.
        q: the chain's angles [rad], shape (6,).

    Raises:
        ValueError: the wrist of `arm` is not spherical.
    """
    posture = posture_of(arm, q)
    bits = jnp.stack([posture.behind, posture.elbow_up, posture.flipped])
    return KukaConfiguration(_number(bits), _number(arm.to_maker(q) < -_AT_ZERO))


def kuka_joint_angles(
    arm: Arm,
    pose: Transform,
    configuration: KukaConfiguration,
    previous: Float[Array, "6"] | None = None,
    *,
    wrist_weights: WristWeights | None = None,
) -> tuple[Float[Array, "6"], Bool[Array, ""]]:
    """Joint angles that Status and Turn select among those that reach a pose.

    Args:
        arm: a KUKA arm with a spherical wrist.
        pose: of the tool in the base frame, shape (4, 4) [m].
        configuration: the flags.
        previous, wrist_weights: as for `inverse_kinematics`.

    Returns:
        The chain's angles [rad], shape (6,), and whether they reach the pose within the
        limits of `arm`.

    Raises:
        ValueError: the wrist of `arm` is not spherical.
    """
    behind, up, flipped = _bits(configuration.status, 3)
    posture = Posture(behind, up, flipped)
    q, valid = _branch(arm, pose, posture, previous, wrist_weights)
    angles, negative = wrapped(arm.to_maker(q)), _bits(configuration.turn, 6)
    # each bit allows one turn; rounding must not carry an axis at zero once around
    angles = jnp.where(negative & (angles > _AT_ZERO), angles - 2 * np.pi, angles)
    angles = jnp.where(~negative & (angles < -_AT_ZERO), angles + 2 * np.pi, angles)
    return _within(arm, angles, valid)


def fanuc_configuration(arm: Arm, q: Float[Array, "6"]) -> FanucConfiguration:
    """Letters and turns at given joint angles.

    Args:
        arm: a Fanuc arm with a spherical wrist.
        q: the chain's angles [rad], shape (6,).

    Raises:
        ValueError: the wrist of `arm` is not spherical.
    """
    posture = posture_of(arm, q)
    turns = _turns(arm.to_maker(q))[_TURN_AXES].astype(int)
    return FanucConfiguration(posture.flipped, posture.elbow_up, ~posture.behind, turns)


def fanuc_joint_angles(
    arm: Arm,
    pose: Transform,
    configuration: FanucConfiguration,
    previous: Float[Array, "6"] | None = None,
    *,
    wrist_weights: WristWeights | None = None,
) -> tuple[Float[Array, "6"], Bool[Array, ""]]:
    """Joint angles that the letters and turns select among those that reach a pose.

    The axes whose turns are not counted take the angle in [-180, 180) degrees, or the
    one a turn away where only that one keeps the limits.

    Args:
        arm: a Fanuc arm with a spherical wrist.
        pose: of the tool in the base frame, shape (4, 4) [m].
        configuration: the flags.
        previous, wrist_weights: as for `inverse_kinematics`.

    Returns:
        The chain's angles [rad], shape (6,), and whether they reach the pose within the
        limits of `arm`.

    Raises:
        ValueError: the wrist of `arm` is not spherical.
    """
    posture = Posture(~configuration.front, configuration.up, configuration.flip)
    q, valid = _branch(arm, pose, posture, previous, wrist_weights)
    angles = arm.to_maker(q)
    angles = angles - 2 * np.pi * _turns(angles)
    q = arm.from_maker(angles)
    for turn in (2 * np.pi, -2 * np.pi):
        inside = (q + turn >= arm.lower) & (q + turn <= arm.upper)
        outside = (q < arm.lower) | (q > arm.upper)
        q = jnp.where(inside & outside, q + turn, q)
    turns = configuration.turns.astype(angles.dtype)
    counted = angles[_TURN_AXES] + 2 * np.pi * turns
    return _within(arm, arm.to_maker(q).at[_TURN_AXES].set(counted), valid)


def _branch(arm, pose, posture, previous, weights):
    solutions, valid = inverse_kinematics(
        SphericalWrist(arm.chain), pose, previous, wrist_weights=weights
    )
    row = branch_index(arm, posture)
    return solutions[row], valid[row]


def _within(arm: Arm, angles: PerJoint, valid: Bool[Array, ""]):
    """The chain's angles of the maker's, valid where they keep the limits."""
    q = arm.from_maker(angles)
    return q, valid & jnp.all((q >= arm.lower) & (q <= arm.upper))


def _turns(angles: PerJoint) -> PerJoint:
    """Whole turns, 0 for angles in [-pi, pi)."""
    return jnp.floor((angles + np.pi) / (2 * np.pi))


def _number(bits: Bool[Array, " bits"]) -> Int[Array, ""]:
    return jnp.sum(bits.astype(int) * np.array([2**k for k in range(bits.shape[0])]))


def _bits(number: Int[Array, ""], count: int) -> Bool[Array, " bits"]:
    return (number >> np.arange(count)) % 2 == 1
