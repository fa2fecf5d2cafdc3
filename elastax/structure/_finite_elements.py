r"""Finite-element models as modal bodies.

A model is node positions with a mass and a stiffness matrix, six freedoms per node
(three displacements, three rotations) or three. Its modes are given as columns over all
freedoms; what a body needs of order zero comes from the full matrices and the
rigid-body motions of the nodes, what is of higher order from nodal masses.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse

from ._body_nodes import BodyNodes
from ._modal_body import ModalBody


# of rigid-body motions: what 64 bits leave of cancelling stiffnesses
_RIGID = 1e-6
_DENSE = 1500  # freedoms up to which dense eigensolvers are faster


@dataclasses.dataclass(frozen=True)
class FiniteElementModel:
    """Nodes with mass and stiffness matrix.

    Attributes:
        positions: of the nodes, shape (nodes, 3) [m].
        mass, stiffness: matrices of all freedoms, dense or sparse, node by node.
        labels: of the nodes; their numbers unless given.
        geometric: stiffness matrix that static loads on all freedoms, shape
            (freedoms,), give to the model by their axial forces when the node `held`
            is clamped: a function (load, held), or `None` where it is not known.

    Raises:
        ValueError: shapes do not fit, a matrix is not symmetric, masses differ between
            the axes or are not positive, or rigid motions of the nodes take force.
    """

    positions: np.ndarray
    mass: Any
    stiffness: Any
    labels: tuple[str, ...] = ()
    geometric: Callable[[np.ndarray, int], Any] | None = None

    def __post_init__(self):
        positions = np.asarray(self.positions, float)
        object.__setattr__(self, "positions", positions)
        count = len(positions)
        if positions.shape != (count, 3):
            raise ValueError(f"`positions` must be (nodes, 3), not {positions.shape}")
        for name in ("mass", "stiffness"):
            matrix = scipy.sparse.csc_matrix(getattr(self, name))
            object.__setattr__(self, name, matrix)
            if matrix.shape not in ((3 * count,) * 2, (6 * count,) * 2):
                raise ValueError(
                    f"`{name}` must have 3 or 6 freedoms for each of {count} nodes, "
                    f"but is {matrix.shape}"
                )
            off = abs(matrix - matrix.T).max()
            if off > 1e-9 * abs(matrix).max():
                raise ValueError(f"`{name}` must be symmetric, but is off by {off:.3g}")
        labels = self.labels or tuple(str(k + 1) for k in range(count))
        object.__setattr__(self, "labels", tuple(labels))
        self._check_rigid()

    @property
    def freedoms(self) -> int:
        """Freedoms of a node, 3 or 6."""
        return self.mass.shape[0] // len(self.positions)

    def index(self, label: str) -> int:
        """Index of a node.

        Raises:
            ValueError: there is no such node.
        """
        if label not in self.labels:
            raise ValueError(
                f"there is no node `{label}`; the first are {self.labels[:8]}"
            )
        return self.labels.index(label)

    def of_node(self, k: int) -> np.ndarray:
        """Indices of the freedoms of a node."""
        return self.freedoms * k + np.arange(self.freedoms)

    def rigid_motions(self, origin=(0.0, 0.0, 0.0)) -> np.ndarray:
        """Unit displacements along, and rotations about, x, y, z through a point.

        Returns:
            Shape (freedoms of all nodes, 6).
        """
        lever = self.positions - np.asarray(origin, float)
        motions = np.zeros((len(lever), self.freedoms, 6))
        motions[:, :3, :3] = np.eye(3)
        for a, axis in enumerate(np.eye(3)):
            motions[:, :3, 3 + a] = np.cross(axis, lever)
        if self.freedoms == 6:
            motions[:, 3:, 3:] = np.eye(3)
        return motions.reshape(-1, 6)

    def _check_rigid(self) -> None:
        motions = self.rigid_motions(self.positions.mean(axis=0))
        masses = np.diag(motions.T @ (self.mass @ motions))
        if not np.all(masses[:3] > 0):
            raise ValueError(f"the mass must be positive, but is {masses[:3]} [kg]")
        if np.ptp(masses[:3]) > 1e-6 * masses[0]:
            raise ValueError(
                f"the mass must be the same along x, y and z, but is {masses[:3]} kg"
            )
        size = abs(self.stiffness).max() * np.abs(motions).max(axis=0)
        force = np.abs(self.stiffness @ motions).max(axis=0) / size
        if force.max() > _RIGID:
            kind = "displacement" if force[:3].max() > _RIGID else "rotation"
            raise ValueError(
                f"a rigid {kind} of all nodes takes force ({force.max():.1e} of the "
                "largest stiffness): the nodes may be in another unit of length than "
                "the matrices (mm against m), in another order, or the model is "
                "supported"
            )


def eigenmodes(
    model: FiniteElementModel, number: int, held: Sequence[str] = ()
) -> np.ndarray:
    """Eigenmodes with some nodes clamped, or of the free model without rigid motions.

    Args:
        model: the model.
        number: of modes.
        held: nodes that are clamped.

    Returns:
        Modes of unit modal mass by ascending frequency, (freedoms, modes).
    """
    fixed = [model.of_node(model.index(label)) for label in held]
    free = np.setdiff1d(np.arange(model.mass.shape[0]), np.concatenate([[], *fixed]))
    free = free.astype(int)
    skip = 0 if held else 6
    vectors = _lowest(model, free, number + skip)[:, skip:]
    modes = np.zeros((model.mass.shape[0], vectors.shape[1]))
    modes[free] = vectors
    return modes


def _lowest(model: FiniteElementModel, free: np.ndarray, number: int) -> np.ndarray:
    mass = model.mass[free][:, free]
    stiffness = model.stiffness[free][:, free]
    if number > len(free):
        raise ValueError(
            f"{number} modes are asked for, but only {len(free)} freedoms are free"
        )
    if len(free) <= _DENSE:
        _, vectors = scipy.linalg.eigh(
            stiffness.toarray(), mass.toarray(), subset_by_index=(0, number - 1)
        )
        return vectors
    from scipy.sparse.linalg import eigsh

    shift = -1e-3 * abs(stiffness).max() / abs(mass).max()
    _, vectors = eigsh(stiffness, number, mass, sigma=shift)
    return vectors


def craig_bampton(
    model: FiniteElementModel, held: str, boundary: Sequence[str], number: int
) -> np.ndarray:
    r"""Modes of a model that is clamped at one node and attached at others.

    Constraint modes, the static shapes under unit motions of the boundary nodes, and
    the eigenmodes with these nodes clamped as well: whatever is attached there is met
    exactly by statics.

    Args:
        model: the model.
        held: node at which the body is clamped.
        boundary: nodes at which other parts are attached.
        number: of modes with the boundary clamped.

    Returns:
        Modes, shape (freedoms, 6 boundary + number), not yet orthogonal:
        `modal_body` takes them to eigenmodes.

    References:
        [CraigBampton1968].
    """
    clamp = model.of_node(model.index(held))
    edges = np.concatenate([model.of_node(model.index(label)) for label in boundary])
    total = model.mass.shape[0]
    inner = np.setdiff1d(np.arange(total), np.concatenate([clamp, edges]))
    K = model.stiffness
    solve = scipy.sparse.linalg.splu(K[inner][:, inner].tocsc())
    static = np.zeros((total, len(edges)))
    static[edges] = np.eye(len(edges))
    static[inner] = -solve.solve(K[inner][:, edges].toarray())
    fixed = np.zeros((total, number))
    if number:
        fixed[inner] = _lowest(model, inner, number)
    return np.concatenate([static, fixed], axis=1)


def modal_body(
    model: FiniteElementModel,
    modes: np.ndarray,
    reference: str,
    *,
    nodes: Sequence[str] = (),
    damping_ratio: float = 0.0,
    name: str = "body",
) -> ModalBody:
    r"""Modal body of a finite-element model, in eigenmodes of unit modal mass.

    $C_t = \Phi^T M R_t$, $C_r = \Phi^T M R_r$, $J = R_r^T M R_r$ with the rigid motions
    R about the reference node; $J_1$, $J_2$ and $C_{r1}$ from nodal masses, the row
    sums of the mass matrix, with an error of second order in the size of the elements.
    With a geometric stiffness $K_g$ the stiffening by acceleration, angular
    acceleration and speed, $\Phi^T K_g \Phi$ under the unit loads of each.

    Args:
        model: the model.
        modes: columns over all freedoms; taken to eigenmodes here.
        reference: node in the origin of the reference frame.
        nodes: further nodes to keep.
        damping_ratio: of all modes.
        name: of the body.

    Raises:
        ValueError: an unknown node, or modes that are linearly dependent.

    References:
        [Reiner2010] (3.72); [Wallrapp1994].
    """
    modes = np.asarray(modes, float)
    origin = model.positions[model.index(reference)]
    rigid = model.rigid_motions(origin)
    kept = [reference, *(label for label in nodes if label != reference)]
    places = [model.index(label) for label in kept]
    lever = model.positions - origin
    per_node = modes.reshape(len(lever), model.freedoms, -1)
    rotations = np.zeros_like(per_node[:, :3])
    if model.freedoms == 6:
        rotations = per_node[:, 3:]
    masses = _nodal_masses(model)
    whole = rigid.T @ (model.mass @ rigid)
    coupling = modes.T @ (model.mass @ rigid)
    shape = np.swapaxes(per_node[:, :3], 1, 2)
    J_1 = np.einsum("p,pkab->kab", masses, _pair(lever[:, None], shape))
    J_2 = np.einsum(
        "p,pklab->klab", masses, _pair(shape[:, :, None], shape[:, None, :])
    )
    C_r1 = np.einsum(
        "p,pkla->kla", masses, np.cross(shape[:, None, :, :], shape[:, :, None, :])
    )
    C_t1 = np.zeros((modes.shape[1], modes.shape[1], 3))
    geometric, held = model.geometric, model.index(reference)
    if geometric is not None:
        stiffened = lambda load: modes.T @ (geometric(load, held) @ modes)
        for a in range(3):
            C_t1[:, :, a] = stiffened(-(model.mass @ rigid[:, a]))
            C_r1[:, :, a] += stiffened(-(model.mass @ rigid[:, 3 + a]))
        for a in range(3):
            for b in range(a, 3):
                change = -2.0 * stiffened(_centrifugal(model, lever, a, b))
                J_2[:, :, a, b] += change
                if a != b:
                    J_2[:, :, b, a] += change
    M_e = modes.T @ (model.mass @ modes)
    K_e = modes.T @ (model.stiffness @ modes)
    body = ModalBody(
        mass=whole[0, 0],
        first_moment=np.array([whole[1, 5], whole[2, 3], whole[0, 4]]),
        J_0=0.5 * (whole[3:, 3:] + whole[3:, 3:].T),
        J_1=J_1,
        J_2=J_2,
        C_t0=coupling[:, :3],
        C_t1=0.5 * (C_t1 + np.swapaxes(C_t1, 0, 1)),
        C_r0=coupling[:, 3:],
        C_r1=C_r1,
        M_e=0.5 * (M_e + M_e.T),
        K_e=0.5 * (K_e + K_e.T),
        D_e=np.zeros_like(M_e),
        nodes=BodyNodes(
            lever[places],
            per_node[places, :3],
            rotations[places],
            np.zeros((len(places), 3, modes.shape[1], modes.shape[1])),
            tuple(kept),
        ),
        mode_names=tuple(f"shape {k + 1}" for k in range(modes.shape[1])),
        name=name,
    )
    body = body.in_eigenmodes()
    return body.with_damping_ratio(damping_ratio) if damping_ratio else body


def _nodal_masses(model: FiniteElementModel) -> np.ndarray:
    """Mass of every node, by the rows of the mass matrix, mean of the three axes."""
    motions = model.rigid_motions()[:, :3]
    rows = (model.mass @ motions).reshape(len(model.positions), model.freedoms, 3)
    return np.einsum("paa->p", rows[:, :3]) / 3.0


def _centrifugal(model: FiniteElementModel, lever, a: int, b: int) -> np.ndarray:
    """Load of the product of two speeds: M times (w^2 c - w (w c)), halved by pairs."""
    field = np.zeros((len(lever), model.freedoms))
    e = np.eye(3)
    field[:, :3] = (a == b) * lever
    field[:, :3] -= 0.5 * (np.outer(lever[:, b], e[a]) + np.outer(lever[:, a], e[b]))
    return model.mass @ field.ravel()


def _pair(a, b):
    """Tensors $2\\,a \\cdot b\\,1 - a b^T - b a^T$."""
    a, b = np.broadcast_arrays(a, b)
    outer = a[..., :, None] * b[..., None, :]
    dot = np.sum(a * b, axis=-1)[..., None, None] * np.eye(3)
    return 2.0 * dot - outer - np.swapaxes(outer, -1, -2)
