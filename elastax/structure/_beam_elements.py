r"""Frames of straight beam elements: mass, stiffness, geometric stiffness.

Euler-Bernoulli elements of two nodes with six freedoms each, cubic in bending, linear
in extension and torsion, with consistent masses.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from ._beam import BeamSection, Material, UniformBeam
from ._finite_elements import FiniteElementModel


def beam_frame(
    positions,
    elements: Sequence[tuple[int, int]],
    section: BeamSection,
    material: Material,
    *,
    upright=(0.0, 0.0, 1.0),
    rotary_inertia: bool = True,
    lumped: Sequence[tuple[int, float, np.ndarray]] = (),
    labels: Sequence[str] = (),
) -> FiniteElementModel:
    """Frame of beams of one section.

    Args:
        positions: of the nodes, shape (nodes, 3) [m].
        elements: pairs of node indices.
        section, material: of all elements.
        upright: direction of the section's z axis, as far as it is across an element.
        rotary_inertia: of the cross sections in bending.
        lumped: rigid masses at nodes: index, mass [kg], inertia (3, 3) [kg m^2].
        labels: of the nodes.

    Raises:
        ValueError: an element of no length or along `upright`, an unknown node, or a
            negative mass.
    """
    positions = np.asarray(positions, float)
    size = 6 * len(positions)
    mass = scipy.sparse.lil_matrix((size, size))
    stiffness = scipy.sparse.lil_matrix((size, size))
    frames = []
    for i, j in elements:
        if not (0 <= i < len(positions) and 0 <= j < len(positions)):
            raise ValueError(f"the element ({i}, {j}) has no such nodes")
        way = positions[j] - positions[i]
        length = float(np.linalg.norm(way))
        if length == 0:
            raise ValueError(f"the element ({i}, {j}) has no length")
        x = way / length
        y = np.cross(np.asarray(upright, float), x)
        if np.linalg.norm(y) < 1e-6:
            raise ValueError(
                f"the element ({i}, {j}) runs along `upright`: give another direction"
            )
        y = y / np.linalg.norm(y)
        turn = np.kron(np.eye(4), np.stack([x, y, np.cross(x, y)]))
        place = np.concatenate([6 * i + np.arange(6), 6 * j + np.arange(6)])
        here = (place[:, None], place[None])
        mass[here] += turn.T @ _mass(section, material, length, rotary_inertia) @ turn
        stiffness[here] += turn.T @ _stiffness(section, material, length) @ turn
        frames.append((place, turn, length))
    for node, weight, inertia in lumped:
        if not weight >= 0:
            raise ValueError(f"the mass at node {node} must not be negative")
        at = 6 * node + np.arange(6)
        mass[at[:3, None], at[None, :3]] += weight * np.eye(3)
        mass[at[3:, None], at[None, 3:]] += np.asarray(inertia, float)
    stiffness = stiffness.tocsc()
    axial = float(material.young * section.area)

    def geometric(load: np.ndarray, held: int):
        free = np.setdiff1d(np.arange(size), 6 * held + np.arange(6))
        moved = np.zeros(size)
        solve = scipy.sparse.linalg.splu(stiffness[free][:, free])
        moved[free] = solve.solve(np.asarray(load)[free])
        total = scipy.sparse.lil_matrix((size, size))
        for place, turn, length in frames:
            local = turn @ moved[place]
            force = axial * (local[6] - local[0]) / length
            total[place[:, None], place[None]] += force * (
                turn.T @ _geometry(length) @ turn
            )
        return total.tocsc()

    return FiniteElementModel(
        positions, mass.tocsc(), stiffness, tuple(labels), geometric
    )


def beam_line(
    beam: UniformBeam, elements: int, *, rotary_inertia: bool = True
) -> FiniteElementModel:
    """A uniform beam along x of equal elements; nodes `base`, 2, 3, ..., `tip`."""
    places = np.linspace(0.0, float(beam.length), elements + 1)
    positions = places[:, None] * np.array([1.0, 0.0, 0.0])
    labels = ["base", *(str(k + 1) for k in range(1, elements)), "tip"]
    return beam_frame(
        positions,
        [(k, k + 1) for k in range(elements)],
        beam.section,
        beam.material,
        rotary_inertia=rotary_inertia,
        labels=labels,
    )


# freedoms of bending in the x-y plane (v, rotation z) and in the x-z plane (w, -rot. y)
_XY, _XZ = np.array([1, 5, 7, 11]), np.array([2, 4, 8, 10])
_SIGN = np.array([1.0, -1.0, 1.0, -1.0])


def _bent(matrix: np.ndarray, pairs) -> np.ndarray:
    """Bending matrices of both planes in place, each times its factor."""
    total = np.zeros((12, 12))
    first, second = pairs
    total[_XY[:, None], _XY[None]] = first * matrix
    total[_XZ[:, None], _XZ[None]] = second * matrix * np.outer(_SIGN, _SIGN)
    return total


def _pull(indices, factor: float, matrix) -> np.ndarray:
    total = np.zeros((12, 12))
    total[np.ix_(indices, indices)] = factor * np.array(matrix)
    return total


def _stiffness(section: BeamSection, material: Material, h: float) -> np.ndarray:
    E, G = float(material.young), float(material.shear)
    bend = np.array(
        [
            [12.0, 6 * h, -12.0, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12.0, -6 * h, 12.0, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    I_y, I_z = float(section.second_moment_y), float(section.second_moment_z)
    spring = [[1.0, -1.0], [-1.0, 1.0]]
    return (
        _bent(bend / h**3, (E * I_z, E * I_y))
        + _pull([0, 6], E * float(section.area) / h, spring)
        + _pull([3, 9], G * float(section.torsion_constant) / h, spring)
    )


def _mass(section, material, h: float, rotary_inertia: bool) -> np.ndarray:
    density, area = float(material.density), float(section.area)
    I_y, I_z = float(section.second_moment_y), float(section.second_moment_z)
    move = np.array(
        [
            [156.0, 22 * h, 54.0, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54.0, 13 * h, 156.0, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    total = _bent(move * h / 420.0, (density * area,) * 2)
    total = total + _pull([0, 6], density * area * h, line)
    total = total + _pull([3, 9], density * (I_y + I_z) * h, line)
    if rotary_inertia:
        total = total + density * _bent(_slopes(h), (I_z, I_y))
    return total


def _slopes(h: float) -> np.ndarray:
    """Integrals of products of slopes of the cubic shapes."""
    return np.array(
        [
            [36.0, 3 * h, -36.0, 3 * h],
            [3 * h, 4 * h**2, -3 * h, -(h**2)],
            [-36.0, -3 * h, 36.0, -3 * h],
            [3 * h, -(h**2), -3 * h, 4 * h**2],
        ]
    ) / (30.0 * h)


def _geometry(h: float) -> np.ndarray:
    """Geometric stiffness under a unit tension."""
    return _bent(_slopes(h), (1.0, 1.0))
