"""Geometries of common arm types, beside those of `arms`. Dimensions in metres."""

import jax
import jax.numpy as jnp
import numpy as np
from elastax.kinematics import (
    FrameJoints,
    JointKind,
    SerialChain,
    rotation_from_vector,
    transform,
)
from elastax.robots import kr210 as kr210_robot

from tests.kinematics.arms import QUARTER


TURN, SLIDE = JointKind.REVOLUTE, JointKind.PRISMATIC


def kr210() -> SerialChain:
    """Rigid chain of the record, whose right angles are structure."""
    return kr210_robot().rigid().chain


def ur() -> SerialChain:
    """Three parallel axes and an offset wrist, of the size of a UR10."""
    offsets = np.array([0.1807, 0, 0, 0.17415, 0.11985, 0.11655])
    lengths = np.array([0, -0.6127, -0.57155, 0, 0, 0])
    twists = np.array([1, 0, 0, 1, -1, 0]) * QUARTER
    return SerialChain.from_dh(np.zeros(6), offsets, lengths, twists)


def scara() -> SerialChain:
    """Two hinges, a slide and a hinge, all parallel."""
    return SerialChain.from_dh(
        np.zeros(4),
        np.array([0.4, 0.05, 0.1, 0.03]),
        np.array([0.325, 0.225, 0, 0]),
        np.array([0, np.pi, 0, 0]),
        kinds=(TURN, TURN, SLIDE, TURN),
    )


def stanford() -> SerialChain:
    """Shoulder of two hinges, a slide and a spherical wrist."""
    return SerialChain.from_dh(
        np.array([0, 0, -QUARTER, 0, 0, 0]),
        np.array([0.412, 0.154, 0.3, 0, 0, 0.263]),
        np.zeros(6),
        np.array([-1, 1, 0, -1, 1, 0]) * QUARTER,
        kinds=(TURN, TURN, SLIDE, TURN, TURN, TURN),
    )


def seven_axes() -> SerialChain:
    """Shoulder, elbow and wrist of an arm with seven hinges."""
    offsets = np.array([0.36, 0, 0.42, 0, 0.4, 0, 0.126])
    twists = np.array([-1, 1, 1, -1, -1, 1, 0]) * QUARTER
    return SerialChain.from_dh(np.zeros(7), offsets, np.zeros(7), twists)


def gantry() -> SerialChain:
    """Slides along x, y and z that carry a wrist of three hinges."""
    identities = np.tile(np.eye(3), (6, 1, 1))
    position = [
        [0, 0, 2],
        [0.1, 0, 0],
        [0, 0.2, 0],
        [0, 0, -0.5],
        [0, 0, -0.1],
        [0] * 3,
    ]
    axis = [[1, 0, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 1, 0], [0, 0, 1]]
    tool = transform(jnp.eye(3), jnp.array([0.05, 0.0, -0.2]))
    return SerialChain.from_frames(
        identities, position, axis, kinds=(SLIDE,) * 3 + (TURN,) * 3, tool=tool
    )


def disturbed(chain: SerialChain, size: float, seed: int = 0) -> SerialChain:
    """The chain with every joint, base and tool moved by about `size` [rad], [m]."""
    frames = chain.joints.frames()
    n, rng = chain.number, np.random.default_rng(seed)
    moves = jnp.asarray(rng.uniform(-size, size, (n + 2, 6)))
    turned = jax.vmap(rotation_from_vector)(moves[:, 3:])
    errors = transform(turned, moves[:, :3])
    before = frames.before @ errors[:n]
    links = jnp.concatenate([before[:1], frames.after[:-1] @ before[1:]])
    joints = FrameJoints(links[:, :3, :3], links[:, :3, 3], frames.axis)
    tool = frames.after[-1] @ chain.tool @ errors[n + 1]
    return SerialChain(joints, chain.base @ errors[n], tool, chain.kinds)
