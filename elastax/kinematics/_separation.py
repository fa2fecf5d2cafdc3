r"""Stepwise separation: closed forms by inverting single transforms, one after another.

The chain $T = A_1 A_2 \cdots A_n$ is multiplied by inverses from the left and from the
right. Every product is a matrix equation whose two sides hold different joint angles;
the art is to find an element that holds one unknown only:

1. invert the first transform and multiply both sides by it,
2. look for an equation with one unknown, and solve it,
3. look for one that the angles found so far reduce to one unknown,
4. if there is none, invert the next transform,
5. repeat until all angles are known.

`contained_unknowns` tells which angles an element holds; `inverse_by_separation` is the
solution that the search finds for the arm of [KinModell] table 3-5.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._checks import is_concrete
from .._custom_types import PerJoint, Transform
from ._chain import SerialChain
from ._joints import DHJoints, JointKind
from ._safe_angles import angle, root, wrapped
from ._se3 import inverse_transform, rotation_about, transform


Transforms = Float[Array, "joints 4 4"]

# (shoulder, root of (3-73), wrist), the rows of `inverse_kinematics`
_SIGNS = np.array([(b, e, w) for b in (1, -1) for e in (1, -1) for w in (1, -1)]).T
_TWISTS = np.array([1, 0, 1, -1, 1, 0]) * np.pi / 2  # [KinModell] table 3-5


class MatrixEquation(NamedTuple):
    r"""Both sides of $A_k^{-1}\cdots A_1^{-1}\,T\,A_n^{-1}\cdots = A_{k+1}\cdots$.

    Attributes:
        given: the side with the pose of the tool, shape (4, 4).
        chain: the side with the transforms that are left, shape (4, 4).
    """

    given: Transform
    chain: Transform


def link_transforms(chain: SerialChain, q: PerJoint) -> Transforms:
    """Single transforms $A_1 ... A_n$, base in the first and tool in the last.

    Args:
        chain: the chain.
        q: joint coordinates [rad] or [m], shape (joints,).

    Returns:
        Shape (joints, 4, 4), lengths in [m]; their product is the pose of the tool.

    References:
        [Berns], (1); [KinModell] (3-45).
    """
    frames = chain.joints.frames()
    zero, identity = jnp.zeros((3,), q.dtype), jnp.eye(3, dtype=q.dtype)
    motions = [
        transform(rotation_about(frames.axis[k], q[k]), zero)
        if kind is JointKind.REVOLUTE
        else transform(identity, q[k] * frames.axis[k])
        for k, kind in enumerate(chain.kinds)
    ]
    single = frames.before @ jnp.stack(motions) @ frames.after
    single = single.at[0].set(chain.base @ single[0])
    return single.at[-1].set(single[-1] @ chain.tool)


def separated_equation(
    transforms: Transforms, pose: Transform, *, left: int = 0, right: int = 0
) -> MatrixEquation:
    """Equation after inverting some transforms at both ends of the chain.

    Args:
        transforms: single transforms of the chain, shape (joints, 4, 4).
        pose: pose of the tool, shape (4, 4) [m].
        left: how many are inverted and multiplied from the left.
        right: how many are inverted and multiplied from the right.

    Raises:
        ValueError: fewer than one transform would be left.

    References:
        [Berns], closed solutions.
    """
    number = transforms.shape[0]
    if left < 0 or right < 0 or left + right >= number:
        raise ValueError(
            f"`left` and `right` must leave one of {number} transforms, but are {left} "
            f"and {right}"
        )
    given = pose
    for k in range(left):
        given = inverse_transform(transforms[k]) @ given
    for k in range(right):
        given = given @ inverse_transform(transforms[number - 1 - k])
    chain = jnp.eye(4, dtype=pose.dtype)
    for k in range(left, number - right):
        chain = chain @ transforms[k]
    return MatrixEquation(given, chain)


def separated_equations(
    transforms: Transforms, pose: Transform
) -> tuple[MatrixEquation, ...]:
    """The equations of the text's list: all left multiplications, then all right ones.

    2 (n - 1) of them; ten for six joints.

    Args:
        transforms: single transforms of the chain, shape (joints, 4, 4).
        pose: pose of the tool, shape (4, 4) [m].

    References:
        [Berns], closed solutions.
    """
    counts = range(1, transforms.shape[0])
    left = [separated_equation(transforms, pose, left=k) for k in counts]
    right = [separated_equation(transforms, pose, right=k) for k in counts]
    return (*left, *right)


def contained_unknowns(
    chain: SerialChain, *, left: int = 0, right: int = 0
) -> Bool[Array, "3 4 joints"]:
    """Which joint coordinates the element equations of a separation hold.

    The derivatives of both sides are looked at in three poses without structure, so
    that an accidental zero is as good as excluded.

    Args:
        chain: the chain.
        left, right: as for `separated_equation`.

    Returns:
        For each of the twelve elements and each joint, shape (3, 4, joints).
    """

    def derivative(q, pose):
        def sides(x):
            equation = separated_equation(
                link_transforms(chain, x), pose, left=left, right=right
            )
            return jnp.stack([equation.given[:3], equation.chain[:3]])

        return jnp.abs(jax.jacfwd(sides)(q))

    dtype = chain.base.dtype
    rng = np.random.default_rng(0)
    q = jnp.asarray(rng.uniform(-2, 2, (3, chain.number)), dtype)
    pose = jnp.asarray(rng.uniform(-2, 2, (3, 4, 4)), dtype)
    largest = jnp.max(jax.vmap(derivative)(q, pose), axis=(0, 1))
    return largest > 1e3 * float(jnp.finfo(dtype).eps) * jnp.max(largest)


def inverse_by_separation(
    chain: SerialChain, pose: Transform
) -> tuple[Float[Array, "8 6"], Bool[Array, "8"]]:
    r"""All joint angles of the Fanuc arm, equation by equation of the text.

    The readable reference for `inverse_kinematics`, whose rows it shares. The equations
    that the print gets wrong are marked.

    Args:
        chain: six axes with the twists of [KinModell] table 3-5 and its zeros: the
            lengths $a_1, a_2, a_3, d_4, d_6$ are free.
        pose: of the tool in the base frame, shape (4, 4) [m].

    Returns:
        Angles in (-pi, pi] [rad], shape (8, 6), and which rows reach the pose, shape
        (8,). With the axes 4 and 6 aligned axis 4 is zero.

    Raises:
        ValueError: `chain` is no such arm.

    References:
        [KinModell] (3-46) to (3-97).
    """
    a1, a2, a3, d4, d6 = _lengths(chain)
    b, e, w = jnp.asarray(_SIGNS, pose.dtype)
    rounding = 1e5 * float(jnp.finfo(pose.dtype).eps)
    scale = (a2 + jnp.sqrt(a3**2 + d4**2)) ** 2

    # (3-46), (3-52) to (3-54): wrist centre q_0 = T_0^6 q_6
    pose = inverse_transform(chain.base) @ pose @ inverse_transform(chain.tool)
    p, direction = pose[:3, 3], pose[:3, 2]
    q_x, q_y, q_z = p - d6 * direction

    # Left multiplication by the inverse of T_0^1, (3-57). Its third row, (3-60):
    # q_x S1 - q_y C1 = 0 holds theta_1 alone. Printed atan2(q_y, q_y); the second
    # solution is the arm that reaches over its back.
    theta_1 = angle(b * q_y, b * q_x, jnp.zeros_like(b), rounding**2 * scale)  # (3-61)
    c1, s1 = jnp.cos(theta_1), jnp.sin(theta_1)

    # The squares of its first two rows, (3-58) and (3-59), hold theta_3 alone, (3-65).
    kappa_1, kappa_2 = 2 * a2 * d4, 2 * a2 * a3  # (3-66), (3-67)
    kappa_3 = (q_x**2 + q_y**2 + q_z**2 - 2 * a1 * q_x * c1 - 2 * a1 * q_y * s1) - (
        d4**2 + a3**2 + a2**2 - a1**2
    )  # (3-68)
    # (3-69): kappa_1 S3 + kappa_2 C3 = kappa_3. The roots (3-73) with the sign of
    # kappa_3^2 corrected, written without the pole of tan(theta_3 / 2) at half a turn.
    radicand = kappa_1**2 + kappa_2**2 - kappa_3**2
    theta_3 = jnp.arctan2(kappa_1, kappa_2) + e * jnp.arctan2(
        root(radicand, (rounding * scale) ** 2), kappa_3
    )
    c3, s3 = jnp.cos(theta_3), jnp.sin(theta_3)

    # Both rows again, now linear in C2 and S2, (3-79), (3-80).
    mu_1, mu_2 = a2 + a3 * c3 + d4 * s3, a3 * s3 - d4 * c3  # (3-75), (3-76)
    nu_1, nu_2 = d4 * c3 - a3 * s3, a2 + a3 * c3 + d4 * s3  # (3-77) corrected, (3-78)
    gamma_1, gamma_2 = q_x * c1 + q_y * s1 - a1, q_z  # not given in print
    # Cramer's rule (3-81), (3-82); the common denominator mu_1 nu_2 - mu_2 nu_1 is
    # positive and drops out of (3-83)
    theta_2 = angle(
        mu_1 * gamma_2 - mu_2 * gamma_1,
        nu_2 * gamma_1 - nu_1 * gamma_2,
        jnp.zeros_like(b),
        (rounding * scale) ** 2,
    )

    # Left multiplication by the inverse of T_0^3, (3-84): the rotation R_3^6 (3-89).
    c23, s23 = jnp.cos(theta_2 + theta_3), jnp.sin(theta_2 + theta_3)
    zero = jnp.zeros_like(b)
    transposed = jnp.stack(
        [
            jnp.stack([c1 * c23, s1 * c23, s23], axis=1),
            jnp.stack([s1, -c1, zero], axis=1),
            jnp.stack([c1 * s23, s1 * s23, -c23], axis=1),
        ],
        axis=1,
    )  # (3-88)
    r = transposed @ pose[:3, :3]  # (3-90), (3-91)

    # Element 33 holds theta_5 alone, (3-92), (3-93), here with the sine from 13 and 23:
    # the arc cosine loses half the digits near zero.
    sine = w * root(r[:, 0, 2] ** 2 + r[:, 1, 2] ** 2, rounding**2)
    theta_5 = jnp.arctan2(sine, r[:, 2, 2])
    # (3-94) to (3-97); only the sign of S5 matters to atan2
    aligned = sine == 0
    theta_4 = jnp.where(
        aligned, 0.0, angle(w * r[:, 1, 2], w * r[:, 0, 2], zero, rounding**2)
    )
    theta_6 = angle(w * r[:, 2, 1], -w * r[:, 2, 0], zero, rounding**2)
    # S5 = 0: theta_4 + theta_6, or minus their difference, is atan2(r_21, +-r_11)
    sense = jnp.where(r[:, 2, 2] < 0, -1.0, 1.0)
    alone = sense * jnp.arctan2(r[:, 1, 0] * sense, r[:, 0, 0] * sense)
    theta_6 = jnp.where(aligned, alone, theta_6)

    angles = jnp.stack([theta_1, theta_2, theta_3, theta_4, theta_5, theta_6], axis=1)
    return wrapped(angles), radicand >= -rounding * scale**2


def _lengths(chain: SerialChain):
    """Lengths $a_1, a_2, a_3, d_4, d_6$ of a chain with the form of table 3-5."""
    joints = chain.joints
    if not isinstance(joints, DHJoints) or chain.number != 6:
        raise ValueError(
            "`chain` must have six Denavit-Hartenberg joints, but has "
            f"{chain.number} {type(joints).__name__}"
        )
    if JointKind.PRISMATIC in chain.kinds:
        raise ValueError("`chain` must have revolute joints, but one is prismatic")
    if is_concrete(joints.a, joints.d, joints.alpha, joints.theta):
        zeros = np.concatenate(
            [
                np.asarray(joints.alpha) - _TWISTS,
                np.asarray(joints.theta),
                np.asarray(joints.a)[3:],
                np.asarray(joints.d)[[0, 1, 2, 4]],
            ]
        )
        if not np.all(np.abs(zeros) < 1e-12):
            raise ValueError(
                "`chain` must have the twists and zeros of table 3-5, but deviates by "
                f"{np.max(np.abs(zeros)):.3g}"
            )
    a1, a2, a3 = joints.a[:3]
    return a1, a2, a3, joints.d[3], joints.d[5]
