"""Roll, pitch and yaw in NumPy: reading a file compiles nothing."""

import numpy as np


def rotation_of(rpy) -> np.ndarray:
    r"""Rotation $R_z(\Theta_z) R_y(\Theta_y) R_x(\Theta_x)$ of angles [rad].

    References:
        [KinModell] (3-11).
    """
    # sines and cosines of right angles as exact zeros
    (cr, cp, cy), (sr, sp, sy) = (
        np.where(np.abs(x) < 1e-15, 0.0, x) for x in (np.cos(rpy), np.sin(rpy))
    )
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(rotation: np.ndarray) -> np.ndarray:
    """Angles about x, y, z [rad] of a rotation, exact to rounding at any pitch.

    Yaw comes first, and the other two from the rotation turned back by it: at a pitch
    of 90 degrees, where yaw is not determined, they still complete it.
    """
    r = np.asarray(rotation, float)
    yaw = np.arctan2(r[1, 0], r[0, 0])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-r[2, 0], cosine * r[0, 0] + sine * r[1, 0])
    roll = np.arctan2(
        sine * r[0, 2] - cosine * r[1, 2], cosine * r[1, 1] - sine * r[0, 1]
    )
    return np.array([roll, pitch, yaw]) + 0.0  # no negative zeros


def pose_of(position, rotation) -> np.ndarray:
    """Homogeneous matrix of a position [m] and a rotation."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose
