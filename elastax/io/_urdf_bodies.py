"""Rigid bodies of a URDF's links, and what is wrong with them."""

import numpy as np

from .._rpy import rotation_of
from ..dynamics import Body
from ._urdf_chain import Moving, UrdfChain
from ._urdf_file import UrdfFile


# principal moments above the largest one times this count as not negative
_ROUNDING = 1e-9


def bodies_of(chain: UrdfChain, moving: Moving) -> list[Body]:
    """Bodies behind a joint, in its frame: the link and what is fixed to it.

    Raises:
        ValueError: an inertia with a negative principal moment.
    """
    bodies = []
    for link, pose in moving.links:
        if link.inertial is None or link.inertial.mass == 0:
            continue
        com, tensor = _body(chain.file, link)
        moments = np.linalg.eigvalsh(tensor)
        if moments[0] < -_ROUNDING * abs(moments[-1]):
            raise chain.file.refuse(
                "link",
                link.name,
                "must not have negative principal moments of inertia, but has "
                f"{_listed(moments)} kg m^2",
            )
        rotation = pose[:3, :3]
        bodies.append(
            Body(
                link.name,
                link.inertial.mass,
                tuple(rotation @ com + pose[:3, 3]),
                rotation @ tensor @ rotation.T,
            )
        )
    return bodies


def inertia_doubts(chain: UrdfChain) -> list[str]:
    """Links without mass, and inertias that no body can have.

    A file without any inertia describes kinematics only, and leaves no doubt.
    """
    notes = []
    if all(link.inertial is None for link in chain.file.robot.links):
        return notes
    for moving in chain.moving:
        if not any(link.inertial and link.inertial.mass for link, _ in moving.links):
            where = chain.file.where("link", moving.links[0][0].name)
            notes.append(f"{where} has no mass")
        for link, _ in moving.links:
            if link.inertial is not None and link.inertial.mass:
                notes += _doubts(chain.file, link)
    return notes


def _doubts(file: UrdfFile, link) -> list[str]:
    where = file.where("link", link.name)
    moments = np.linalg.eigvalsh(_body(file, link)[1])
    if moments[0] <= _ROUNDING * abs(moments[-1]):
        return [
            f"{where}: an inertia must be positive definite, but has the principal "
            f"moments {_listed(moments)} kg m^2"
        ]
    # each moment is at most the sum of the others: they are sums of two squares
    if moments[2] > (moments[0] + moments[1]) * (1 + _ROUNDING):
        return [
            f"{where}: no body has the principal moments {_listed(moments)} kg m^2, "
            "the largest is more than the sum of the others"
        ]
    return []


def _body(file: UrdfFile, link) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass and inertia about it, in the axes of the link."""
    origin = link.inertial.origin
    com = np.zeros(3) if origin is None else origin[:3, 3]
    rotation = rotation_of(file.rpy("link", link.name))
    return com, rotation @ link.inertial.inertia @ rotation.T


def _listed(moments: np.ndarray) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)
