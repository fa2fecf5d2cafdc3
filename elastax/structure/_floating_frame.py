r"""Motion of a flexible body in its floating frame and the forces that it needs."""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import Vector3
from .._taylor import cross, product
from ._modal_body import ModalBody


def element_motion(
    v_R: Vector3,
    a_R: Vector3,
    omega: Vector3,
    domega: Vector3,
    c: Vector3,
    u: Vector3,
    ud: Vector3,
    udd: Vector3,
) -> tuple[Vector3, Vector3]:
    r"""Velocity and acceleration of a mass element, resolved in the frame R.

    $v = v_R + \tilde\omega (c + u) + \dot u$,
    $a = a_R + (\dot{\tilde\omega} + \tilde\omega\tilde\omega)(c + u) +
    2\tilde\omega\dot u + \ddot u$.

    Args:
        v_R, a_R: absolute velocity and acceleration of the origin of R [m/s], [m/s^2].
        omega, domega: angular velocity of R and its rate [rad/s], [rad/s^2].
        c: place of the element in the undeformed body [m].
        u, ud, udd: its displacement and the rates of its components.

    References:
        [Reiner2010] (2.20).
    """
    r = c + u
    velocity = v_R + cross(omega, r) + ud
    turning = cross(domega, r) + cross(omega, cross(omega, r))
    return velocity, a_R + turning + 2.0 * cross(omega, ud) + udd


class BodyForces(NamedTuple):
    """What moves a flexible body, resolved in its reference frame.

    Attributes:
        force: [N], shape (3,).
        moment: about the origin of R [N m], shape (3,).
        modal: forces of the modal coordinates, shape (modes,).
    """

    force: Any
    moment: Any
    modal: Any


def inertial_forces(
    body: ModalBody,
    a: Any,
    omega: Any,
    domega: Any,
    eta: Any,
    etad: Any,
    etadd: Any,
    gravity: Any = None,
) -> BodyForces:
    r"""The left-hand side of (3.72) without stiffness and damping.

    $m a + \dot{\tilde\omega}\,m d + \tilde\omega\tilde\omega\,m d + C_t^T\ddot\eta +
    2\tilde\omega C_t^T\dot\eta + \underline{\dot C_t^T\dot\eta}$,

    $m\tilde d a + J\dot\omega + \tilde\omega J\omega + C_r^T\ddot\eta +
    G_r\dot\eta\,\omega + \underline{\dot C_r^T\dot\eta}$,

    $C_t a + C_r\dot\omega + M_e\ddot\eta + G_e\dot\eta\,\omega + O_e\Omega$.

    $G_r$ and $O_e$ are taken at the deformed body. The underlined terms are not in the
    text: without them the equations are not those of the kinetic energy once $C_t$ or
    the symmetric part of $C_r$ depend on the deformation (geometric stiffening).

    Args:
        body: the body; its `detail` says what is left out.
        a: acceleration of the origin of R minus gravity, resolved in R [m/s^2].
        omega, domega: angular velocity of R and its rate, resolved in R.
        eta, etad, etadd: modal coordinates and their rates. All may be `Series`.
        gravity: gravity vector in R, only where `detail.separates_gravity`.

    References:
        [Reiner2010] (3.72) with the errata.
    """
    detail = body.detail
    first = body.first_moment_at(eta)
    spin = product("ab,b->a", body.inertia_at(eta), omega)
    whirl = cross(omega, first)
    force = product(",a->a", body.mass, a)
    force = force + cross(domega, first) + cross(omega, whirl)
    moment = cross(first, a) + cross(omega, spin)
    moment = moment + product("ab,b->a", body.inertia_at(eta), domega)
    modal = product("kl,l->k", body.M_e, etadd)
    slope = body.inertia_slope_at(eta)
    if detail.coupling is not None:
        C_t, C_r = body.coupling_at(eta, detail.coupling)
        flow = product("ka,k->a", C_t, etad)
        force = force + product("ka,k->a", C_t, etadd) + 2.0 * cross(omega, flow)
        moment = moment + product("ka,k->a", C_r, etadd)
        modal = modal + product("ka,a->k", C_r, domega)
        if detail.coupling == 1:
            C_td = product("kla,l->ka", body.C_t1, etad)
            C_rd = product("kla,l->ka", body.C_r1, etad)
            force = force + product("ka,k->a", C_td, etad)
            moment = moment + product("ka,k->a", C_rd, etad)
        if not detail.separates_gravity:
            modal = modal + product("ka,a->k", C_t, a)
        else:
            modal = modal + product("ka,a->k", C_t, a + gravity)
    if detail.separates_gravity and detail.modal_gravity is not None:
        C_t, _ = body.coupling_at(eta, detail.modal_gravity)
        modal = modal - product("ka,a->k", C_t, gravity)
    if detail.gyroscopic:
        _, C_r = body.coupling_at(eta, 1)
        growth = product("kab,k->ab", slope, etad)
        moment = moment + product("ab,b->a", growth, omega)
        moment = moment + cross(omega, product("ka,k->a", C_r, etad))
        across = product("kla,l->ka", body.G_e, etad)
        modal = modal + product("ka,a->k", across, omega)
    if detail.centrifugal == 0:
        slope = body.J_1
    pull = product("kab,b->ka", slope, omega)
    return BodyForces(force, moment, modal - 0.5 * product("ka,a->k", pull, omega))


def free_body(
    body: ModalBody,
    omega: Vector3,
    eta: Float[Array, " modes"],
    etad: Float[Array, " modes"],
) -> tuple[Float[Array, "all all"], Float[Array, " all"]]:
    r"""Mass matrix and bias of one body alone, for $(a_R, \dot\omega_R, \ddot\eta)$.

    Without gravity; stiffness and damping are part of the bias.

    References:
        [Reiner2010] (2.22), (3.72).
    """
    still, rest = 0.0 * omega, 0.0 * eta
    forces = inertial_forces(body, still, omega, still, eta, etad, rest, gravity=still)
    elastic = body.K_e @ eta + body.D_e @ etad
    bias = jnp.concatenate([forces.force, forces.moment, forces.modal + elastic])
    return body.mass_matrix(eta), bias
