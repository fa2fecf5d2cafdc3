"""Places on a flexible body where parts are attached or forces act."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import Matrix3, Vector3, as_real


class BodyNodes(eqx.Module):
    r"""Positions of nodes and how they move with the modal coordinates.

    $u = \Phi\eta + \tfrac12\eta^T\Phi_1\eta$ with symmetric $\Phi_1$, and small
    rotations $\vartheta = \Psi\eta$.

    Attributes:
        position: in the undeformed body, shape (nodes, 3) [m].
        phi: $\Phi$, shape (nodes, 3, modes).
        psi: $\Psi$, shape (nodes, 3, modes).
        phi_1: $\Phi_1$, shape (nodes, 3, modes, modes); the text's $\Phi_x$, $\Phi_y$,
            $\Phi_z$.
        names: one per node.

    Raises:
        ValueError: shapes differ, or a name is there twice.

    References:
        [Reiner2010] (2.21).
    """

    position: Float[Array, "nodes 3"] = eqx.field(converter=as_real)
    phi: Float[Array, "nodes 3 modes"] = eqx.field(converter=as_real)
    psi: Float[Array, "nodes 3 modes"] = eqx.field(converter=as_real)
    phi_1: Float[Array, "nodes 3 modes modes"] = eqx.field(converter=as_real)
    names: tuple[str, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        if len(self.names) != self.number:
            raise ValueError(
                f"`names` must name the {self.number} nodes, but holds "
                f"{len(self.names)}"
            )
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"every node needs a name of its own, not {self.names}")

    @property
    def number(self) -> int:
        """Number of nodes."""
        return self.position.shape[0]

    @property
    def modes(self) -> int:
        """Number of modal coordinates."""
        return self.phi.shape[-1]

    def index(self, name: str) -> int:
        """Index of the node of this name.

        Raises:
            ValueError: there is none.
        """
        if name not in self.names:
            raise ValueError(
                f"there is no node `{name}`: take one of {', '.join(self.names)}"
            )
        return self.names.index(name)

    def displacement(self, index, eta: Float[Array, " modes"]) -> Vector3:
        """Displacement of a node [m].

        References:
            [Reiner2010] (2.21).
        """
        curved = self.phi[index] + 0.5 * self.phi_1[index] @ eta
        return curved @ eta

    def rotation(self, index, eta: Float[Array, " modes"]) -> Matrix3:
        r"""Small rotation of a node, $1 + \tilde\vartheta$."""
        x, y, z = self.psi[index] @ eta
        one = jnp.ones_like(x)
        return jnp.stack(
            [
                jnp.stack([one, -z, y]),
                jnp.stack([z, one, -x]),
                jnp.stack([-y, x, one]),
            ]
        )

    def generalised_force(
        self,
        index: int,
        eta: Float[Array, " modes"],
        force: Vector3,
        moment: Vector3,
    ) -> Float[Array, " modes"]:
        r"""Modal forces of a force [N] and a moment [N m] at a node, resolved in R.

        $h_e = (\Phi + \Phi_1\eta)^T F + \Psi^T T$, by virtual work.
        """
        slope = self.phi[index] + self.phi_1[index] @ eta
        return slope.T @ force + self.psi[index].T @ moment

    def moved(self, rotation: Matrix3, position: Vector3) -> "BodyNodes":
        """The nodes in another reference frame.

        Args:
            rotation, position: of the present frame in the new one.
        """
        turn = lambda x: jnp.einsum("ab,nb...->na...", rotation, x)
        return BodyNodes(
            turn(self.position) + position[None],
            turn(self.phi),
            turn(self.psi),
            turn(self.phi_1),
            self.names,
        )

    def transformed(self, matrix: Float[Array, "modes new"]) -> "BodyNodes":
        """The nodes in other modal coordinates."""
        return BodyNodes(
            self.position,
            self.phi @ matrix,
            self.psi @ matrix,
            jnp.einsum("naij,ik,jl->nakl", self.phi_1, matrix, matrix),
            self.names,
        )


def no_nodes(modes: int) -> BodyNodes:
    """No node at all."""
    zero = np.zeros
    return BodyNodes(
        zero((0, 3)),
        zero((0, 3, modes)),
        zero((0, 3, modes)),
        zero((0, 3, modes, modes)),
        (),
    )
