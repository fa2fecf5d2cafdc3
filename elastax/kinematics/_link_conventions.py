"""Joint conventions besides Denavit and Hartenberg's, and chains that mix them."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields
from .._custom_types import as_real
from ._joints import AbstractJoints, JointFrames
from ._se3 import rotation_x, rotation_y, rotation_z, transform


class ModifiedDHJoints(AbstractJoints):
    r"""Modified (proximal) Denavit-Hartenberg joints, after Craig.

    $A_i = R_x(\alpha_i)\,T_x(a_i)\,R_z(\theta_i)\,T_z(d_i)$; the joint variable adds to
    $\theta_i$ (revolute) or $d_i$ (prismatic). The first row places axis 1 in the
    chain's first frame: Craig's $a_{i-1}, \alpha_{i-1}$ are the entries i here.

    Attributes:
        alpha: shape (joints,), twists about x in front of each axis [rad].
        a: shape (joints,), lengths along x in front of each axis [m].
        theta: shape (joints,), offset angles about z [rad].
        d: shape (joints,), offsets along z [m].
    """

    alpha: Float[Array, " joints"] = eqx.field(converter=as_real)
    a: Float[Array, " joints"] = eqx.field(converter=as_real)
    theta: Float[Array, " joints"] = eqx.field(converter=as_real)
    d: Float[Array, " joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)

    def frames(self) -> JointFrames:
        zero = jnp.zeros_like(self.d)
        before = transform(
            jax.vmap(rotation_x)(self.alpha) @ jax.vmap(rotation_z)(self.theta),
            jnp.stack([self.a, zero, zero], axis=-1),
        )
        identity = jnp.broadcast_to(jnp.eye(3, dtype=zero.dtype), (*zero.shape, 3, 3))
        after = transform(identity, jnp.stack([zero, zero, self.d], axis=-1))
        return JointFrames(before, _along_z(zero), after)

    def number(self) -> int:
        return self.d.shape[0]


class HayatiJoints(AbstractJoints):
    r"""Hayati-Mirmirani joints, for axes that are parallel or nearly so.

    $T_i = R_z(\theta_i)\,T_x(a_i)\,R_x(\alpha_i)\,R_y(\beta_i)$: the next axis pierces
    the x-y plane of the frame. The joint variable adds to $\theta_i$ (revolute). The
    text leaves the prismatic form to the reader; here the frame slides along z in front
    of $T_x(a_i)$ by the joint variable, with the same four parameters.

    Attributes:
        theta: shape (joints,), offset angles about z [rad].
        a: shape (joints,), lengths along the turned x [m].
        alpha: shape (joints,), twists about x' [rad].
        beta: shape (joints,), tilts about y'' [rad].

    References:
        [KinModell] table 3-3.
    """

    theta: Float[Array, " joints"] = eqx.field(converter=as_real)
    a: Float[Array, " joints"] = eqx.field(converter=as_real)
    alpha: Float[Array, " joints"] = eqx.field(converter=as_real)
    beta: Float[Array, " joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)

    def frames(self) -> JointFrames:
        zero = jnp.zeros_like(self.a)
        return _tilted(self.theta, zero, self.a, self.alpha, self.beta)

    def number(self) -> int:
        return self.a.shape[0]


class VeitscheggerWuJoints(AbstractJoints):
    r"""Veitschegger-Wu joints: Denavit and Hartenberg's with a tilt about y.

    $T_i = R_z(\theta_i)\,T_z(d_i)\,T_x(a_i)\,R_x(\alpha_i)\,R_y(\beta_i)$; the joint
    variable adds to $\theta_i$ (revolute) or $d_i$ (prismatic).

    Attributes:
        theta: shape (joints,), offset angles about z [rad].
        d: shape (joints,), offsets along z [m].
        a: shape (joints,), lengths along x' [m].
        alpha: shape (joints,), twists about x' [rad].
        beta: shape (joints,), tilts about y'' [rad].

    References:
        [KinModell] table 3-4.
    """

    theta: Float[Array, " joints"] = eqx.field(converter=as_real)
    d: Float[Array, " joints"] = eqx.field(converter=as_real)
    a: Float[Array, " joints"] = eqx.field(converter=as_real)
    alpha: Float[Array, " joints"] = eqx.field(converter=as_real)
    beta: Float[Array, " joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)

    def frames(self) -> JointFrames:
        return _tilted(self.theta, self.d, self.a, self.alpha, self.beta)

    def number(self) -> int:
        return self.d.shape[0]


class MixedJoints(AbstractJoints):
    """Joints of several conventions, one group behind the other.

    Attributes:
        groups: consecutive joints; each group keeps its own parameters.
    """

    groups: tuple[AbstractJoints, ...]

    def __check_init__(self):
        if not self.groups:
            raise ValueError("`groups` must hold at least one group of joints")

    def frames(self) -> JointFrames:
        return jax.tree.map(
            lambda *parts: jnp.concatenate(parts), *(g.frames() for g in self.groups)
        )

    def number(self) -> int:
        return sum(group.number() for group in self.groups)


def _along_z(zero: Float[Array, " joints"]) -> Float[Array, "joints 3"]:
    return jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0], zero.dtype), (*zero.shape, 3))


def _tilted(theta, d, a, alpha, beta) -> JointFrames:
    """Turn about z, then displacement and the tilts about x and y."""
    zero = jnp.zeros_like(a)
    before = transform(
        jax.vmap(rotation_z)(theta), jnp.zeros((*zero.shape, 3), zero.dtype)
    )
    after = transform(
        jax.vmap(rotation_x)(alpha) @ jax.vmap(rotation_y)(beta),
        jnp.stack([a, zero, d], axis=-1),
    )
    return JointFrames(before, _along_z(zero), after)
