r"""Closed-form inverse kinematics of six-axis arms with a spherical wrist.

The axes and points of the arm are read at q = 0, so that signs, zero offsets and joint
conventions do not matter. All eight branches are computed at once, as arrays of shape
(8,) over shoulder, elbow and wrist.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._checks import is_concrete
from .._custom_types import Matrix3, Scalar, Transform, Vector3
from .._kernel import kernel
from .._taylor import leading
from ._chain import SerialChain, moving_frames
from ._joints import JointKind
from ._safe_angles import angle, length, root, wrapped
from ._se3 import rotation_about
from ._wrist_weights import WristWeights


# (shoulder, elbow, wrist), the first index slowest, "+" in front of "-"
_SHOULDER, _ELBOW, _WRIST = np.array(
    [(b, e, w) for b in (1.0, -1.0) for e in (1.0, -1.0) for w in (1.0, -1.0)]
).T


class SphericalWrist(eqx.Module):
    """Six-axis arm whose inverse kinematics has a closed form.

    Axis 1 is perpendicular to axis 2, axis 2 parallel to axis 3, and axes 4, 5, 6 meet
    in one point, each perpendicular to the next. Offsets between the axes 1 and 2, of
    the wrist, and sideways are free; so are base and tool.

    Attributes:
        chain: the arm; its parameters are the only ones.

    Raises:
        ValueError: the geometry of `chain` does not qualify; the message names what
            does not hold. Not checked where the parameters are traced.

    References:
        [Reiner2010] 3.6, [KinModell] 3.3.
    """

    chain: SerialChain

    def __check_init__(self):
        if self.chain.number != 6 or JointKind.PRISMATIC in self.chain.kinds:
            raise ValueError(
                "`chain` must have six revolute joints, but is "
                f"{[kind.value for kind in self.chain.kinds]}"
            )
        if is_concrete(*jax.tree.leaves(self.chain)):
            with jax.ensure_compile_time_eval():
                _check_geometry(self.chain)

    @staticmethod
    def from_chain(chain: SerialChain) -> "SphericalWrist":
        """The arm `chain`, in whatever convention it was given."""
        return SphericalWrist(chain)


class Geometry(NamedTuple):
    """The arm at q = 0, in coordinates (x forward, y along +-axis 2, z along axis 1).

    `signs` are the senses of axes 2 and 3 about y; `shoulder`, `upper` and `fore` are
    (x, z) pairs; `lateral` is the distance of the wrist from the x-z plane.
    """

    origin: Vector3
    axes: Float[Array, "3 3"]
    arm: Matrix3
    signs: Float[Array, "2"]
    shoulder: Float[Array, "2"]
    upper: Float[Array, "2"]
    fore: Float[Array, "2"]
    lateral: Scalar
    wrist: Matrix3
    wrist_zero: Scalar
    tool_to_wrist: Matrix3
    tool_offset: Vector3


# of the fields of `Geometry`, of a pose, of joint angles
_SHAPES = (
    *((3,), (3, 3), (3, 3), (2,), (2,), (2,), (2,), (), (3, 3), (), (3, 3), (3,)),
    *((4, 4), (6,)),
)


def inverse_kinematics(
    arm: SphericalWrist,
    pose: Transform,
    previous: Float[Array, "6"] | None = None,
    *,
    wrist_weights: WristWeights | None = None,
) -> tuple[Float[Array, "8 6"], Bool[Array, "8"]]:
    r"""All joint angles at which the tool has the given pose, joint limits aside.

    Row 4b + 2e + w holds the branch with shoulder b, elbow e and wrist w, where 0 means
    "+" and 1 means "-". Shoulder +: the arm reaches to the side on which it reaches at
    q = 0. Elbow +: axis 3 is turned in its positive sense from the stretched arm.
    Wrist +: axis 5 likewise from the pose that aligns axes 4 and 6.

    [Reiner2010] (3.53) is extended by the offsets between the axes and by the branch
    b = -1, and reads atan2 with two arguments where the text prints one. [KinModell]
    (3-96), (3-97) divide by the sine of axis 5; here they hold for a zero sine as well.

    Args:
        arm: the arm.
        pose: pose of the tool in the base frame, shape (4, 4) [m].
        previous: angles [rad] that are kept where they are not determined: axis 1 with
            the wrist centre on it, axis 4 with the axes 4 and 6 aligned (the branches
            "-" keep them half a turn away), axis 2 with the wrist centre on it. Zero
            unless given.
        wrist_weights: how the axes 4 and 6 share their turn where they are aligned;
            axis 4 rests and axis 6 takes it all unless given.

    Returns:
        Angles in (-pi, pi] [rad], shape (8, 6), and which rows reach the pose, shape
        (8,). Rows out of reach are finite: the arm stretched or folded towards it.

    References:
        [Reiner2010] (3.52), (3.53); [KinModell] (3-84) to (3-97); [Berns], singular
        configuration, for the weights.
    """
    if previous is None:
        previous = jnp.zeros((6,), pose.dtype)
    return _solve(read_geometry(arm.chain), pose, previous, wrist_weights)


def select_branch(
    solutions: Float[Array, "branches joints"],
    valid: Bool[Array, " branches"],
    previous: Float[Array, " joints"],
) -> Float[Array, " joints"]:
    """The valid solution nearest to the previous angles, without a jump by a turn.

    Args:
        solutions: angles [rad], shape (branches, joints).
        valid: which of them reach the pose; if none does, the nearest row is returned.
        previous: angles to stay close to [rad], of any number of turns.

    Returns:
        Angles within half a turn of `previous` [rad], shape (joints,).
    """
    turns = jnp.round((previous[None] - solutions) / (2 * np.pi))
    unwrapped = solutions + 2 * np.pi * turns
    distance = jnp.sum((unwrapped - previous[None]) ** 2, axis=-1)
    # any valid row is nearer than any other one: each angle is at most pi away
    penalty = 2 * np.pi**2 * solutions.shape[1]
    return unwrapped[jnp.argmin(distance + jnp.where(valid, 0.0, penalty))]


def inverse_kinematics_path(
    arm: SphericalWrist,
    poses: Float[Array, "times 4 4"],
    start: Float[Array, "6"],
    *,
    wrist_weights: WristWeights | None = None,
) -> tuple[Float[Array, "times 6"], Bool[Array, " times"]]:
    """Joint angles along a path of the tool, each nearest to the last reached ones.

    A path that leaves the workspace returns with the same elbow. Where a sample
    stretches the arm exactly, the two elbows meet and either may follow. Where a sample
    aligns the axes 4 and 6, only their sum or difference is determined: the weights
    share the step between them. A path that leaves the aligned wrist sideways asks for
    a finite turn of axis 4 at once, whatever they are.

    Args:
        arm: the arm.
        poses: poses of the tool in the base frame, shape (times, 4, 4) [m].
        start: angles near those of the first pose [rad], shape (6,).
        wrist_weights: as for `inverse_kinematics`.

    Returns:
        Angles without jumps by a turn [rad], shape (times, 6), and which samples are
        reached, shape (times,).
    """
    geometry = read_geometry(arm.chain)

    def step(previous, pose):
        solutions, valid = _solve(geometry, pose, previous, wrist_weights)
        q, reached = select_branch(solutions, valid, previous), jnp.any(valid)
        # out of reach both elbows coincide: only reached angles tell them apart
        return jnp.where(reached, q, previous), (q, reached)

    return jax.lax.scan(step, start, poses)[1]


def read_geometry(chain: SerialChain) -> Geometry:
    """Lengths, senses and zeros of an arm with a spherical wrist, read at q = 0."""
    frames = moving_frames(chain, jnp.zeros((6,), chain.base.dtype))
    a, p = leading(frames.axis), leading(frames.position)
    centre = p[3] + a[3] * (a[3] @ (p[4] - p[3]))
    outward = jnp.cross(a[1], a[0])

    # forward is where the wrist is at q = 0, or else where axis 2 is
    reach, offset = outward @ (centre - p[0]), outward @ (p[1] - p[0])
    small = 1e-6 * length(centre - p[1])
    side = jnp.where(jnp.abs(reach) > small, reach, offset)
    side = jnp.where(jnp.abs(side) > small, side, 1.0)
    sign = jnp.where(side < 0, -1.0, 1.0)
    arm = jnp.stack([sign * outward, sign * a[1], a[0]])
    shoulder, elbow, wrist = (arm @ (point - p[0]) for point in (p[1], p[2], centre))

    wrist_axes = jnp.stack([jnp.cross(a[4], a[3]), a[4], a[3]])
    zero = jnp.arctan2(wrist_axes[0] @ a[5], wrist_axes[2] @ a[5])
    rotation = leading(frames.tool_rotation).T
    return Geometry(
        origin=p[0],
        axes=a[:3],
        arm=arm,
        signs=sign * jnp.stack([jnp.ones_like(sign), jnp.sign(a[1] @ a[2])]),
        shoulder=shoulder[::2],
        upper=(elbow - shoulder)[::2],
        fore=(wrist - elbow)[::2],
        lateral=wrist[1],
        wrist=wrist_axes,
        wrist_zero=zero,
        tool_to_wrist=rotation @ rotation_about(a[4], zero) @ wrist_axes.T,
        tool_offset=rotation @ (leading(frames.tool_position) - centre),
    )


def _solve(
    g: Geometry,
    pose: Transform,
    previous: Float[Array, "6"],
    weights: WristWeights | None,
):
    """Branches of `inverse_kinematics`, and which reach the pose."""
    parts = (*g, pose, previous)
    shares = () if weights is None else (weights.shares(jnp.ones((), pose.dtype))[0],)
    # one operand: its tangent is never a constant, which XLA can fail to hand over
    vector = jnp.concatenate([jnp.ravel(part) for part in (*parts, *shares)])
    solutions, margins = _branches(vector)
    return solutions, jnp.all(margins >= 0, axis=1)


def _unpacked(vector):
    """Geometry, pose, previous angles and, if there is one, the share of axis 4."""
    ends = np.cumsum([math.prod(shape) for shape in _SHAPES]).tolist()
    parts = [
        jnp.reshape(vector[end - math.prod(shape) : end], shape)
        for end, shape in zip(ends, _SHAPES)
    ]
    share = vector[ends[-1]] if vector.shape[0] > ends[-1] else None
    return Geometry(*parts[:-2]), *parts[-2:], share


@kernel
def _branches(vector):
    """Angles and margins of reach; b, e, w are the signs of [KinModell] 3.3."""
    g, pose, previous, share = _unpacked(vector)
    b, e, w = (jnp.asarray(s, pose.dtype) for s in (_SHOULDER, _ELBOW, _WRIST))
    upper, fore = length(g.upper), length(g.fore)
    # lengths are distinguished from zero down to rounding
    rounding = 1e5 * float(jnp.finfo(pose.dtype).eps)
    scale = (upper + fore) ** 2

    # wrist centre, [Reiner2010] (3.52a)
    target = pose[:3, :3]
    x, y, z = g.arm @ (pose[:3, 3] - target @ g.tool_offset - g.origin)

    # axis 1, [Reiner2010] (3.53b, d)
    radial = x**2 + y**2 - g.lateral**2
    u = root(radial, rounding**2 * scale)
    tilt = angle(g.lateral, u, jnp.zeros_like(u), rounding**2 * scale)
    azimuth = angle(y, x, previous[0], rounding**2 * scale)
    q1 = azimuth - jnp.where(b > 0, tilt, np.pi - tilt)

    # axis 3, [Reiner2010] (3.53c, f), with products instead of 1 - D^2
    reach_x, reach_z = b * u - g.shoulder[0], z - g.shoulder[1]
    square = reach_x**2 + reach_z**2
    outer, inner = (upper + fore) ** 2 - square, square - (upper - fore) ** 2
    fold = jnp.arctan2(
        root(outer * inner, (rounding * scale) ** 2), square - upper**2 - fore**2
    )
    stretched = jnp.arctan2(
        g.upper[0] * g.fore[1] - g.upper[1] * g.fore[0], g.upper @ g.fore
    )
    q3 = g.signs[1] * stretched + e * fold

    # axis 2, [Reiner2010] (3.53e)
    sine, cosine = jnp.sin(g.signs[1] * q3), jnp.cos(g.signs[1] * q3)
    knee_x = g.upper[0] + cosine * g.fore[0] + sine * g.fore[1]
    knee_z = g.upper[1] + cosine * g.fore[1] - sine * g.fore[0]
    q2 = g.signs[0] * angle(
        reach_x * knee_z - reach_z * knee_x,
        reach_x * knee_x + reach_z * knee_z,
        g.signs[0] * previous[1],
        (rounding * scale) ** 2,
    )

    # hand axes: Rz(q4) Ry(q5 + zero) Rz(q6), [KinModell] (3-84) to (3-97)
    about = jax.vmap(rotation_about, (None, 0))
    turned = about(g.axes[0], q1) @ about(g.axes[1], q2 + g.signs[0] * g.signs[1] * q3)
    r = jnp.einsum(
        "ij,njk,kl->nil", g.wrist, jnp.swapaxes(turned, 1, 2), target @ g.tool_to_wrist
    )
    half = jnp.where(w > 0, 0.0, np.pi)
    sine, cosine = w * r[:, 1, 2], w * r[:, 0, 2]
    q4 = angle(sine, cosine, previous[3] + half, rounding**2)
    if share is not None:
        # [Berns], singular configuration: what axis 6 would turn alone is shared
        change = share * wrapped(_roll(r, q4) - previous[5] - half)
        aligned = sine**2 + cosine**2 <= rounding**2
        # theta_4 + theta_6 is fixed, or the difference with axis 5 half a turn away
        change = jnp.where(r[:, 2, 2] < 0, -change, change)
        q4 = q4 + jnp.where(aligned, change, 0.0)
    sine, cosine = jnp.sin(q4), jnp.cos(q4)
    bend = jnp.arctan2(cosine * r[:, 0, 2] + sine * r[:, 1, 2], r[:, 2, 2])
    q6 = _roll(r, q4)

    solutions = jnp.stack([q1, q2, q3, q4, bend - g.wrist_zero, q6], axis=1)
    margins = jnp.stack([jnp.broadcast_to(radial, b.shape), outer, inner], axis=1)
    return wrapped(solutions), margins + rounding * scale


def _roll(r: Float[Array, "8 3 3"], q4: Float[Array, "8"]) -> Float[Array, "8"]:
    """Angle of axis 6 that goes with the one of axis 4, from R = Rz(4) Ry(5) Rz(6)."""
    sine, cosine = jnp.sin(q4), jnp.cos(q4)
    return jnp.arctan2(
        cosine * r[:, 1, 0] - sine * r[:, 0, 0], cosine * r[:, 1, 1] - sine * r[:, 0, 1]
    )


def _check_geometry(chain: SerialChain, tolerance: float = 1e-6) -> None:
    """Raise `ValueError` where the axes at q = 0 are not those of `SphericalWrist`."""
    frames = moving_frames(chain, jnp.zeros((6,), chain.base.dtype))
    a, p = np.asarray(frames.axis), np.asarray(frames.position)
    if not np.all(np.isfinite([a, p])):
        raise ValueError("the geometry of `chain` must be finite, but is not")
    centre = p[3] + a[3] * (a[3] @ (p[4] - p[3]))
    scale = max(np.linalg.norm(p[2] - p[1]), np.linalg.norm(centre - p[2]))

    def across(axis, vector):
        return float(np.linalg.norm(np.cross(axis, vector)))

    def require(what: str, deviation: float) -> None:
        if not deviation <= tolerance:
            raise ValueError(
                f"{what}, but deviates by {deviation:.3g} at q = 0: idealise the "
                "geometry or solve iteratively with `solve_damped`"
            )

    require("axis 1 of `chain` must be perpendicular to axis 2", abs(a[0] @ a[1]))
    require("axis 2 of `chain` must be parallel to axis 3", across(a[1], a[2]))
    require("axis 4 of `chain` must be perpendicular to axis 5", abs(a[3] @ a[4]))
    require("axis 5 of `chain` must be perpendicular to axis 6", abs(a[4] @ a[5]))
    lengths = across(a[1], p[2] - p[1]), across(a[1], centre - p[2])
    if not min(lengths) > tolerance * scale:
        raise ValueError(
            "axes 2 and 3, and axis 3 and the wrist centre of `chain` must lie apart, "
            f"but the distances are {lengths[0]:.3g} and {lengths[1]:.3g}"
        )
    for k in (4, 5):
        require(
            "axes 4, 5 and 6 of `chain` must meet in one point (relative to the arm)",
            float(across(a[k], centre - p[k]) / scale),
        )
