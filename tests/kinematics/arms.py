"""Arms of the tests. Dimensions of the KUKA-like and PUMA-like arm are illustrative."""

import jax.numpy as jnp
import numpy as np
from elastax.kinematics import JointKind, SerialChain, rotation_y, transform


QUARTER = np.pi / 2


def fanuc(scale: float = 1.0) -> SerialChain:
    """Fanuc arm of [KinModell] table 3-5 [mm], without the machine's zero offsets."""
    lengths = np.array([312.0, 1075, 225, 0, 0, 0]) * scale
    offsets = np.array([0.0, 0, 0, 1280, 0, 215]) * scale
    twists = np.array([1, 0, 1, -1, 1, 0]) * QUARTER
    return SerialChain.from_dh(np.zeros(6), offsets, lengths, twists)


def kuka(signs=(1.0,) * 6, axes=None, wrist_height=-0.035, **options) -> SerialChain:
    """Arm with the axis directions of [Reiner2010] A.6: stretched along x at zero."""
    positions = [
        [0, 0, 0],
        [0.26, 0, 0.675],
        [0.68, 0, 0],
        [0.67, 0, wrist_height],
        [0, 0, 0],
        [0, 0, 0],
    ]
    if axes is None:
        axes = [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    axes = np.array(axes, float) * np.array(signs)[:, None]
    identities = np.tile(np.eye(3), (6, 1, 1))
    tool = transform(rotation_y(jnp.array(QUARTER)), jnp.array([0.115, 0, 0]))
    options = {"tool": tool} | options
    return SerialChain.from_frames(identities, positions, axes, **options)


def puma(base=None) -> SerialChain:
    """Arm with a sideways offset between shoulder and wrist [m]."""
    return SerialChain.from_dh(
        np.array([0.3, -0.2, 0.1, 0.5, -0.4, 1.0]),
        np.array([0.67, 0.24, -0.09, 0.43, 0, 0.06]),
        np.array([0.0, 0.43, 0.02, 0, 0, 0]),
        np.array([1, 0, -1, 1, -1, 0]) * QUARTER,
        base=base,
    )


def planar(*lengths: float) -> SerialChain:
    """Revolute joints about z, links along x [m]."""
    zero = np.zeros(len(lengths))
    return SerialChain.from_dh(zero, zero, np.array(lengths), zero)


def mixed() -> SerialChain:
    """Revolute and prismatic joints with skew axes, base and tool."""
    rng = np.random.default_rng(3)
    axis = rng.standard_normal((5, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    slides, turns = JointKind.PRISMATIC, JointKind.REVOLUTE
    return SerialChain.from_rpy(
        rng.uniform(-1, 1, (5, 3)),
        rng.uniform(-3, 3, (5, 3)),
        axis,
        kinds=(turns, slides, turns, slides, turns),
        base=transform(rotation_y(jnp.array(0.4)), jnp.array([0.1, -0.2, 0.3])),
        tool=transform(rotation_y(jnp.array(-1.1)), jnp.array([0.0, 0.3, 0.2])),
    )


def turned(angles, reference):
    """`angles` shifted by whole turns next to `reference`."""
    return angles + 2 * np.pi * jnp.round((reference - angles) / (2 * np.pi))
