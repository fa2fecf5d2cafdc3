r"""Modal bodies from points of mass: the integrals of (3.72) as sums.

Points may be lumped masses, nodes of a finite-element model or the abscissas of a
quadrature along a beam. Discs of rotary inertia turn with their point.
"""

import jax.numpy as jnp
import numpy as np

from .._custom_types import as_real
from ._body_nodes import BodyNodes
from ._modal_body import ModalBody, across, pair


def point_mass_body(
    masses,
    positions,
    shapes,
    stiffness,
    *,
    damping=None,
    curvatures=None,
    discs=None,
    rotations=None,
    nodes: BodyNodes,
    mode_names: tuple[str, ...],
    name: str = "body",
) -> ModalBody:
    r"""Body of points that move by $r = c + \Phi\eta + \tfrac12\eta^T\Phi_1\eta$.

    $C_{t0} = \sum m\,\phi_k$, $C_{t1} = \sum m\,\Phi_{1,kl}$,
    $C_{r0} = \sum m\,c \times \phi_k$,
    $C_{r1} = \sum m\,(\phi_l \times \phi_k + c \times \Phi_{1,kl})$, and the inertia
    $\sum m\,(r^2 1 - r r^T)$ up to the second order. The modal mass is that of the
    first-order displacement. Discs add $\Theta$ to $J_0$, $\Psi^T\Theta$ to $C_{r0}$,
    $\Psi^T\Theta\Psi$ to $M_e$ and to $J_1$ what turning them changes.

    Args:
        masses: $m$, shape (points,) [kg].
        positions: $c$ in the reference frame, shape (points, 3) [m].
        shapes: $\Phi$ at the points, shape (points, 3, modes).
        stiffness: $K_e$, shape (modes, modes).
        damping: $D_e$, shape (modes, modes); zero unless given.
        curvatures: $\Phi_1$ at the points, symmetric in the modes, shape
            (points, 3, modes, modes); none unless given.
        discs: inertia tensors $\Theta$ of the points about themselves, shape
            (points, 3, 3) [kg m^2].
        rotations: $\Psi$ at the points, shape (points, 3, modes); needed with discs.
        nodes: where other parts are attached.
        mode_names: one per mode.
        name: of the body.

    Raises:
        ValueError: discs without rotations, or what `ModalBody` refuses.

    References:
        [Reiner2010] (2.20), (2.21), (3.72) with the errata.
    """
    m, c, phi = as_real(masses), as_real(positions), as_real(shapes)
    if discs is not None and rotations is None:
        raise ValueError("`discs` turn with their points: give `rotations` as well")
    modes = phi.shape[-1]
    shape = jnp.swapaxes(phi, 1, 2)  # (points, modes, 3)
    C_t0 = jnp.einsum("p,pka->ka", m, shape)
    C_r0 = jnp.einsum("p,pka->ka", m, across(c[:, None], shape))
    C_r1 = jnp.einsum(
        "p,pkla->kla", m, across(shape[:, None, :, :], shape[:, :, None, :])
    )
    C_t1 = jnp.zeros((modes, modes, 3))
    M_e = jnp.einsum("p,pka,pla->kl", m, shape, shape)
    J_0 = jnp.einsum("p,pab->ab", m, pair(c, c)) * 0.5
    J_1 = jnp.einsum("p,pkab->kab", m, pair(c[:, None], shape))
    J_2 = jnp.einsum("p,pklab->klab", m, pair(shape[:, :, None], shape[:, None, :]))
    if curvatures is not None:
        curved = jnp.moveaxis(as_real(curvatures), 1, -1)  # (points, modes, modes, 3)
        C_t1 = jnp.einsum("p,pkla->kla", m, curved)
        lever = across(c[:, None, None], curved)
        C_r1 = C_r1 + jnp.einsum("p,pkla->kla", m, lever)
        bent = pair(c[:, None, None], curved)
        J_2 = J_2 + jnp.einsum("p,pklab->klab", m, bent)
    if discs is not None and rotations is not None:
        disc, turn = as_real(discs), jnp.swapaxes(as_real(rotations), 1, 2)
        J_0 = J_0 + jnp.sum(disc, axis=0)
        spin = jnp.einsum("pab,pkb->pka", disc, turn)
        C_r0 = C_r0 + jnp.sum(spin, axis=0)
        M_e = M_e + jnp.einsum("pka,pla->kl", turn, spin)
        tilted = across(turn[:, :, None], jnp.swapaxes(disc, 1, 2)[:, None])
        tilted = jnp.sum(jnp.swapaxes(tilted, 2, 3), axis=0)  # skew(psi_k) Theta
        J_1 = J_1 + tilted + jnp.swapaxes(tilted, 1, 2)
    return ModalBody(
        mass=jnp.sum(m),
        first_moment=jnp.einsum("p,pa->a", m, c),
        J_0=J_0,
        J_1=J_1,
        J_2=J_2,
        C_t0=C_t0,
        C_t1=0.5 * (C_t1 + jnp.swapaxes(C_t1, 0, 1)),
        C_r0=C_r0,
        C_r1=C_r1,
        M_e=0.5 * (M_e + M_e.T),
        K_e=stiffness,
        D_e=np.zeros((modes, modes)) if damping is None else damping,
        nodes=nodes,
        mode_names=mode_names,
        name=name,
    )
