r"""SID data in one layout, whatever file they come from, and the identities they obey.

Indices: modes first, then axes. $J$ is the full tensor; $O_e$ counts the products of
the speeds as in (3.72b).
"""

import dataclasses

import numpy as np

from ..structure import BodyNodes, ModalBody


SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))  # of O_e, (3.72b)
TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of J


@dataclasses.dataclass(frozen=True)
class SidNode:
    """A node: place and shape functions.

    Attributes:
        label: of the file.
        position: undeformed, shape (3,).
        phi, psi: shape (3, modes).
        phi_1: derivative of phi, shape (3, modes, modes); zero without stiffening.
        origin_1: the file's derivative of the position, shape (3, modes).
        rotation_1: the file's derivative of the orientation, shape (3, modes, 3).
    """

    label: str
    position: np.ndarray
    phi: np.ndarray
    psi: np.ndarray
    phi_1: np.ndarray
    origin_1: np.ndarray
    rotation_1: np.ndarray


@dataclasses.dataclass(frozen=True)
class SidData:
    """A flexible body in the terms of the standard.

    Attributes:
        name, header: of the file.
        labels: of the modes.
        mass: of the body.
        mdCM_0, mdCM_1: first moment and derivatives, (3,) and (modes, 3).
        mdCM_2: second derivatives, (modes, modes, 3).
        J_0, J_1, J_2: inertia, (3, 3), (modes, 3, 3) and (modes, modes, 3, 3).
        Ct_0, Ct_1, Cr_0, Cr_1: couplings, (modes, 3) and (modes, modes, 3), the second
            index being the coordinate by which they are differentiated.
        Me, Ke, De: (modes, modes); ksigma: (modes,).
        Gr: (modes, 3, 3); Ge: (modes, modes, 3), the second index being the coordinate.
        Oe_0, Oe_1: (modes, 6) and (modes, modes, 6).
        nodes: in the order of the file.
    """

    name: str
    header: str
    labels: tuple[str, ...]
    mass: float
    mdCM_0: np.ndarray
    mdCM_1: np.ndarray
    mdCM_2: np.ndarray
    J_0: np.ndarray
    J_1: np.ndarray
    J_2: np.ndarray
    Ct_0: np.ndarray
    Ct_1: np.ndarray
    Cr_0: np.ndarray
    Cr_1: np.ndarray
    Me: np.ndarray
    Gr: np.ndarray
    Ge: np.ndarray
    Oe_0: np.ndarray
    Oe_1: np.ndarray
    ksigma: np.ndarray
    Ke: np.ndarray
    De: np.ndarray
    nodes: tuple[SidNode, ...]

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.labels)

    @classmethod
    def of(cls, body: ModalBody) -> "SidData":
        """Data of a modal body, with the terms of second order."""
        get = lambda name: np.asarray(getattr(body, name))
        nodes = body.nodes
        zero = np.zeros
        return cls(
            body.name,
            "",
            body.mode_names,
            float(body.mass),
            get("first_moment"),
            get("C_t0"),
            get("C_t1"),
            get("J_0"),
            get("J_1"),
            get("J_2"),
            get("C_t0"),
            get("C_t1"),
            get("C_r0"),
            get("C_r1"),
            get("M_e"),
            get("G_r"),
            get("G_e"),
            get("O_e0"),
            get("O_e1"),
            zero(body.modes),
            get("K_e"),
            get("D_e"),
            tuple(
                SidNode(
                    name,
                    np.asarray(nodes.position)[k],
                    np.asarray(nodes.phi)[k],
                    np.asarray(nodes.psi)[k],
                    np.asarray(nodes.phi_1)[k],
                    np.asarray(nodes.phi)[k],
                    np.swapaxes(skew_matrices(np.asarray(nodes.psi)[k].T), 0, 1),
                )
                for k, name in enumerate(nodes.names)
            ),
        )

    def modal_body(self, name: str | None = None) -> ModalBody:
        r"""The body whose kinetic energy has these data.

        $J_2$ comes from the second-order records of J where the file has them, else
        from $O_{e,1}$, of which it is the potential; what is not symmetric in the modes
        has none and is left out, as `identities` reports.

        Args:
            name: for messages; that of the file unless given.
        """
        J_2 = self.J_2 if self.J_2.any() else tensor_of_squares(-2.0 * self.Oe_1)
        half = lambda x: 0.5 * (x + np.swapaxes(x, 0, 1))
        stack = lambda rows, shape: np.array(rows).reshape(shape)
        n, count = self.modes, len(self.nodes)
        nodes = BodyNodes(
            stack([node.position for node in self.nodes], (count, 3)),
            stack([node.phi for node in self.nodes], (count, 3, n)),
            stack([node.psi for node in self.nodes], (count, 3, n)),
            stack(
                [half(np.moveaxis(node.phi_1, 0, 2)) for node in self.nodes],
                (count, n, n, 3),
            ).transpose(0, 3, 1, 2),
            tuple(node.label for node in self.nodes),
        )
        return ModalBody(
            mass=self.mass,
            first_moment=self.mdCM_0,
            J_0=self.J_0,
            J_1=self.J_1,
            J_2=half(J_2),
            C_t0=self.Ct_0,
            C_t1=half(self.Ct_1),
            C_r0=self.Cr_0,
            C_r1=self.Cr_1,
            M_e=0.5 * (self.Me + self.Me.T),
            K_e=0.5 * (self.Ke + self.Ke.T),
            D_e=0.5 * (self.De + self.De.T),
            nodes=nodes,
            mode_names=self.labels,
            name=self.name or "body" if name is None else name,
        )

    def scaled(self, length: float) -> "SidData":
        """The same body in another unit of length.

        Mass stays; a file in mm, t and s needs its mass changed as well.

        Args:
            length: new units per old one, 1e-3 from millimetres to metres.
        """
        one, two = length, length**2
        return dataclasses.replace(
            self,
            mdCM_0=one * self.mdCM_0,
            mdCM_1=one * self.mdCM_1,
            mdCM_2=one * self.mdCM_2,
            J_0=two * self.J_0,
            J_1=two * self.J_1,
            J_2=two * self.J_2,
            Ct_0=one * self.Ct_0,
            Ct_1=one * self.Ct_1,
            Cr_0=two * self.Cr_0,
            Cr_1=two * self.Cr_1,
            Me=two * self.Me,
            Gr=two * self.Gr,
            Ge=two * self.Ge,
            Oe_0=two * self.Oe_0,
            Oe_1=two * self.Oe_1,
            ksigma=two * self.ksigma,
            Ke=two * self.Ke,
            De=two * self.De,
            nodes=tuple(
                dataclasses.replace(
                    node,
                    position=one * node.position,
                    phi=one * node.phi,
                    phi_1=one * node.phi_1,
                    origin_1=one * node.origin_1,
                )
                for node in self.nodes
            ),
        )


def skew_matrices(vectors: np.ndarray) -> np.ndarray:
    """Matrices of the cross products with vectors, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def tensor_of_squares(coefficients: np.ndarray) -> np.ndarray:
    """Symmetric tensors of quadratic forms, from shape (..., 6) to (..., 3, 3)."""
    tensor = np.zeros((*coefficients.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(SQUARES):
        share = 1.0 if i == j else 0.5
        tensor[..., i, j] = tensor[..., j, i] = share * coefficients[..., k]
    return tensor


def squares_of_tensor(tensor: np.ndarray, order=SQUARES) -> np.ndarray:
    """Coefficients of the quadratic forms of tensors, shape (..., 6)."""
    return np.stack(
        [tensor[..., i, j] * (1.0 if i == j else 2.0) for i, j in order], axis=-1
    )
