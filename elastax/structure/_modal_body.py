r"""Flexible bodies as Taylor series in modal coordinates, in a floating frame.

Every quantity of the body is resolved in its reference frame R and expanded in the
modal coordinates $\eta$ of the body, the text's $\mathbf q$.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import Matrix3, Scalar, Vector3, as_real
from .._taylor import product
from ._body_detail import NOMINAL, BodyDetail
from ._body_nodes import BodyNodes


class ModalBody(eqx.Module):
    r"""Mass, stiffness and coupling of a flexible body.

    $m\,d_{CM} = c_0 + C_{t0}^T\eta + \tfrac12\eta^T C_{t1}\eta$,
    $J = J_0 + J_1\eta + \tfrac12\eta^T J_2\eta$,
    $C_t = C_{t0} + C_{t1}\eta$, $C_r = C_{r0} + C_{r1}\eta$, all moments about the
    origin of R. These and $M_e$ make up the kinetic energy

    $$T = \tfrac12 (v, \omega, \dot\eta)^T \begin{pmatrix} m & & sym. \\
      m\tilde d_{CM} & J & \\ C_t & C_r & M_e \end{pmatrix} (v, \omega, \dot\eta)$$

    from which the equations of motion follow without further data: $G_r$, $G_e$ and
    $O_e$ of (3.72) are derivatives of it. The terms that a second-order displacement
    (2.21) adds, geometric stiffening among them, are in $C_{t1}$, $C_{r1}$ and $J_2$.

    Attributes:
        mass: $m$ [kg].
        first_moment: $c_0 = m\,d_{CM,0}$, shape (3,) [kg m].
        J_0: inertia about the origin of R, shape (3, 3) [kg m^2].
        J_1: its first derivatives, shape (modes, 3, 3).
        J_2: its second derivatives, shape (modes, modes, 3, 3).
        C_t0: $\int \phi_k\,dm$, shape (modes, 3).
        C_t1: derivative by the second index, symmetric, shape (modes, modes, 3).
        C_r0: $\int r \times \phi_k\,dm$, shape (modes, 3).
        C_r1: derivative by the second index, shape (modes, modes, 3).
        M_e, K_e, D_e: modal mass, stiffness and damping, shape (modes, modes).
        nodes: places where other parts are attached or forces act.
        mode_names: one per mode, for tables.
        name: for messages.
        detail: which terms the equations of motion keep.

    Raises:
        ValueError: shapes differ, the mass is not positive, or one of the matrices is
            not symmetric or not positive (semi-)definite.

    References:
        [Reiner2010] (2.22), (3.72), both corrected; [Wallrapp1994] for the series.
    """

    mass: Scalar = eqx.field(converter=as_real)
    first_moment: Vector3 = eqx.field(converter=as_real)
    J_0: Matrix3 = eqx.field(converter=as_real)
    J_1: Float[Array, "modes 3 3"] = eqx.field(converter=as_real)
    J_2: Float[Array, "modes modes 3 3"] = eqx.field(converter=as_real)
    C_t0: Float[Array, "modes 3"] = eqx.field(converter=as_real)
    C_t1: Float[Array, "modes modes 3"] = eqx.field(converter=as_real)
    C_r0: Float[Array, "modes 3"] = eqx.field(converter=as_real)
    C_r1: Float[Array, "modes modes 3"] = eqx.field(converter=as_real)
    M_e: Float[Array, "modes modes"] = eqx.field(converter=as_real)
    K_e: Float[Array, "modes modes"] = eqx.field(converter=as_real)
    D_e: Float[Array, "modes modes"] = eqx.field(converter=as_real)
    nodes: BodyNodes
    mode_names: tuple[str, ...] = eqx.field(static=True)
    name: str = eqx.field(static=True, default="body")
    detail: BodyDetail = eqx.field(static=True, default=NOMINAL)

    def __check_init__(self):
        check_fields(self)
        if len(self.mode_names) != self.modes:
            raise ValueError(
                f"`mode_names` of `{self.name}` must name its {self.modes} modes, but "
                f"holds {len(self.mode_names)}"
            )
        if self.nodes.modes != self.modes:
            raise ValueError(
                f"`nodes` of `{self.name}` must move by its {self.modes} modes, but do "
                f"by {self.nodes.modes}"
            )
        check_values("`mass` must be positive [kg]", self.mass, self.mass > 0)
        if is_concrete(self.M_e, self.K_e, self.D_e, self.C_t1):
            _check_matrices(self)

    @property
    def modes(self) -> int:
        """Number of modal coordinates."""
        return self.C_t0.shape[0]

    # the series, of arrays or `Series`

    def first_moment_at(self, eta: Any) -> Any:
        """$m\\,d_{CM}$ [kg m], shape (3,)."""
        if self.detail.inertia == 0:
            return self.first_moment
        curved = product("kla,l->ka", self.C_t1, eta) * 0.5 + self.C_t0
        return product("ka,k->a", curved, eta) + self.first_moment

    def inertia_at(self, eta: Any) -> Any:
        """Inertia about the origin of R [kg m^2], shape (3, 3)."""
        if self.detail.inertia == 0:
            return self.J_0
        curved = product("klab,l->kab", self.J_2, eta) * 0.5 + self.J_1
        return product("kab,k->ab", curved, eta) + self.J_0

    def inertia_slope_at(self, eta: Any) -> Any:
        """Derivative of the inertia by the modal coordinates, shape (modes, 3, 3)."""
        return product("klab,l->kab", self.J_2, eta) + self.J_1

    def coupling_at(self, eta: Any, order: int | None) -> tuple[Any, Any]:
        """$C_t$ and $C_r$ up to `order`, shape (modes, 3) each; zero for `None`."""
        if order is None:
            return jnp.zeros_like(self.C_t0), jnp.zeros_like(self.C_r0)
        if order == 0:
            return self.C_t0, self.C_r0
        return (
            product("kla,l->ka", self.C_t1, eta) + self.C_t0,
            product("kla,l->ka", self.C_r1, eta) + self.C_r0,
        )

    # what the text and SID data name

    @property
    def G_r(self) -> Float[Array, "modes 3 3"]:
        r"""$G_{r,n} = J_{1,n} - \tilde C_{r0,n}$, the text's $-2\int\tilde r\,
        \tilde\phi_n\,dm$."""
        return self.J_1 - _skew(self.C_r0)

    @property
    def G_e(self) -> Float[Array, "modes modes 3"]:
        """$G_{e,kl} = C_{r1,kl} - C_{r1,lk}$, shape (row, coordinate, axis)."""
        return self.C_r1 - jnp.swapaxes(self.C_r1, 0, 1)

    @property
    def O_e0(self) -> Float[Array, "modes 6"]:
        r"""$O_e$ of the undeformed body, for the squares $\Omega$ of (3.72b)."""
        return -0.5 * _in_squares(self.J_1)

    @property
    def O_e1(self) -> Float[Array, "modes modes 6"]:
        """Derivative of $O_e$ by the second index."""
        return -0.5 * _in_squares(self.J_2)

    def mass_matrix(self, eta: Float[Array, " modes"]) -> Float[Array, "all all"]:
        """Mass matrix for (v, omega, etad) in R, shape (6 + modes, 6 + modes)."""
        translation, rotation = self.coupling_at(eta, self.detail.coupling)
        moment = _skew(self.first_moment_at(eta)[None])[0]
        return jnp.block(
            [
                [self.mass * jnp.eye(3), -moment, translation.T],
                [moment, self.inertia_at(eta), rotation.T],
                [translation, rotation, self.M_e],
            ]
        )

    def frequencies(self) -> Float[Array, " modes"]:
        """Eigenfrequencies with the reference frame held [Hz], ascending."""
        half = jnp.linalg.inv(jnp.linalg.cholesky(self.M_e))
        squares = jnp.linalg.eigvalsh(half @ self.K_e @ half.T)
        return jnp.sqrt(jnp.maximum(squares, 0.0)) / (2.0 * jnp.pi)

    # other bodies from this one

    def with_detail(self, detail: BodyDetail) -> "ModalBody":
        """The same body with other terms in its equations of motion."""
        return dataclasses.replace(self, detail=detail)

    def with_damping_ratio(self, ratio) -> "ModalBody":
        r"""The body with $D_e = 2\zeta\sqrt{K_{kk} M_{kk}}$ on the diagonal.

        Args:
            ratio: $\zeta \ge 0$, one or one per mode; for a body in its eigenmodes.
        """
        ratio = as_real(ratio)
        check_values("`ratio` must not be negative", ratio, ratio >= 0)
        size = jnp.sqrt(jnp.diag(self.K_e) * jnp.diag(self.M_e))
        return dataclasses.replace(self, D_e=jnp.diag(2.0 * ratio * size))

    def transformed(self, matrix, names: tuple[str, ...]) -> "ModalBody":
        r"""The body in other coordinates, $\eta = T\,\eta_{new}$.

        Args:
            matrix: $T$, shape (modes, new modes); fewer columns leave modes out.
            names: of the new modes.
        """
        t = as_real(matrix)
        one = lambda x: jnp.einsum("kn,k...->n...", t, x)
        two = lambda x: jnp.einsum("kn,lm,kl...->nm...", t, t, x)
        return dataclasses.replace(
            self,
            J_1=one(self.J_1),
            J_2=two(self.J_2),
            C_t0=one(self.C_t0),
            C_t1=two(self.C_t1),
            C_r0=one(self.C_r0),
            C_r1=two(self.C_r1),
            M_e=two(self.M_e),
            K_e=two(self.K_e),
            D_e=two(self.D_e),
            nodes=self.nodes.transformed(t),
            mode_names=tuple(names),
        )

    def moved(self, rotation, position) -> "ModalBody":
        """The body in another reference frame that is fixed in the present one.

        Args:
            rotation: of the present frame in the new one, shape (3, 3).
            position: of its origin in the new one, shape (3,) [m].
        """
        R, p = as_real(rotation), as_real(position)
        turn = lambda x: jnp.einsum("ab,...b->...a", R, x)
        turn2 = lambda x: jnp.einsum("ab,...bc,dc->...ad", R, x, R)
        first = turn(self.first_moment)
        C_t0, C_t1 = turn(self.C_t0), turn(self.C_t1)
        return dataclasses.replace(
            self,
            first_moment=first + self.mass * p,
            J_0=turn2(self.J_0) + pair(p, first) + 0.5 * self.mass * pair(p, p),
            J_1=turn2(self.J_1) + pair(p, C_t0),
            J_2=turn2(self.J_2) + pair(p, C_t1),
            C_t0=C_t0,
            C_t1=C_t1,
            C_r0=turn(self.C_r0) + across(p, C_t0),
            C_r1=turn(self.C_r1) + across(p, C_t1),
            nodes=self.nodes.moved(R, p),
        )

    def selected(self, modes) -> "ModalBody":
        """The body with only the modes of these indices, in this order."""
        modes = list(modes)
        matrix = np.eye(self.modes)[:, modes]
        return self.transformed(matrix, tuple(self.mode_names[k] for k in modes))

    def in_eigenmodes(self) -> "ModalBody":
        """The body in eigenmodes of unit modal mass, by ascending frequency.

        Modes of a body that already is stay as they are.
        """
        half = np.linalg.inv(np.linalg.cholesky(np.asarray(self.M_e)))
        squares, vectors = np.linalg.eigh(half @ np.asarray(self.K_e) @ half.T)
        matrix = half.T @ vectors
        # of either sign take the one whose largest element is positive
        largest = np.argmax(np.abs(matrix), axis=0)
        matrix = matrix * np.sign(matrix[largest, np.arange(self.modes)])
        hertz = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
        names = tuple(f"mode {k + 1}, {f:.4g} Hz" for k, f in enumerate(hertz))
        return self.transformed(matrix, names)


# O_e counts the products of the speeds in this order, (3.72b)
SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


def across(a, b):
    """Cross products along the last axis."""
    a, b = jnp.broadcast_arrays(jnp.expand_dims(a, range(b.ndim - a.ndim)), b)
    return jnp.cross(a, b)


def pair(a, b):
    """Tensor $2\\,a \\cdot b\\,1 - a b^T - b a^T$, shape (..., 3, 3)."""
    a, b = jnp.broadcast_arrays(jnp.expand_dims(a, range(b.ndim - a.ndim)), b)
    dot = jnp.einsum("...,ab->...ab", jnp.sum(a * b, axis=-1), jnp.eye(3))
    outer = a[..., :, None] * b[..., None, :]
    return 2.0 * dot - outer - jnp.swapaxes(outer, -1, -2)


def _in_squares(tensor):
    r"""Coefficients of $\omega^T A\,\omega$ for the six products of (3.72b)."""
    rows, columns = np.array(SQUARES).T
    return jnp.concatenate(
        [tensor[..., rows[:3], columns[:3]], 2.0 * tensor[..., rows[3:], columns[3:]]],
        axis=-1,
    )


def _skew(vectors):
    """Matrices of the cross products, shape (..., 3, 3)."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    zero = jnp.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def _check_matrices(body: ModalBody) -> None:
    for name, definite in (("M_e", True), ("K_e", False), ("D_e", False)):
        matrix = np.asarray(getattr(body, name))
        if not matrix.size:
            continue
        size = np.abs(matrix).max()
        if np.abs(matrix - matrix.T).max() > 1e-9 * size:
            raise ValueError(f"`{name}` of `{body.name}` must be symmetric")
        smallest = np.linalg.eigvalsh(matrix)[0]
        if definite and not smallest > 0:
            raise ValueError(
                f"`{name}` of `{body.name}` must be positive definite, but has the "
                f"eigenvalue {smallest:.3g}"
            )
        if smallest < -1e-9 * size:
            raise ValueError(
                f"`{name}` of `{body.name}` must not have negative eigenvalues, but "
                f"has {smallest:.3g}"
            )
    curved = np.asarray(body.C_t1)
    if np.abs(curved - np.swapaxes(curved, 0, 1)).max(initial=0.0) > 1e-9 * np.abs(
        curved
    ).max(initial=0.0):
        raise ValueError(
            f"`C_t1` of `{body.name}` must be symmetric in its modes: it is the second "
            "derivative of the first moment"
        )
