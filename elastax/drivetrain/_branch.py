r"""Elements with memory that stand parallel to the spring and the damper of a gear.

A branch adds a torque $b(x, z)$ to that of the gear's spring. It depends on the torsion
$x = q - \theta$ and on internal states $z$ of its own, but not on the rate of the
torsion: with the linear damper $d > 0$ of the gear the torque
$\tau = k(x) + d\,\dot x + b(x, z)$ is solved for $\dot x$, and $\dot z$ follows.
So a gear with branches has an exact inverse, the states of which are $x$ and $z$.
"""

import abc
import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, as_real
from ..structure import AbstractStiffness


_NEWTON_STEPS = 8


class AbstractGearBranch(eqx.Module):
    """Smooth element with memory, parallel to the spring of every axis's gear."""

    @property
    @abc.abstractmethod
    def states(self) -> int:
        """Number of internal states per axis."""

    @abc.abstractmethod
    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        """Memory of a gear that has come to rest at `torsion` [rad]."""

    @abc.abstractmethod
    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        """Torque [N m] beyond that of the `spring` of the gear.

        Args:
            spring: of the gear; laws that modulate its stiffness need it.
            torsion: output minus motor, on the output side [rad].
            memory: internal states.
        """

    @abc.abstractmethod
    def rates(
        self, torsion: PerJoint, rate: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        """Time derivative of `memory` at `torsion` [rad] and its `rate` [rad/s]."""

    @abc.abstractmethod
    def scaled(self, factor: Float[Array, "..."] | float) -> "AbstractGearBranch":
        """The branch beside a spring `scaled` alike: its torque times `factor`."""


class AbstractSwitchingBranch(eqx.Module):
    """Exact, switching element with memory, parallel to the spring of a gear.

    The memory holds its values during a step, within which the torsion is monotone, and
    is renewed at the end of it. Torques inside the step follow the law exactly.
    """

    @property
    @abc.abstractmethod
    def states(self) -> int:
        """Number of internal states per axis."""

    @abc.abstractmethod
    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        """Memory of a gear that has come to rest at `torsion` [rad]."""

    @abc.abstractmethod
    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        """Torque [N m] beyond that of the `spring`, with the `memory` of the last step.

        Args:
            spring: of the gear; laws that modulate its stiffness need it.
            torsion: at this instant, output minus motor [rad].
            memory: internal states at the begin of the step.
        """

    @abc.abstractmethod
    def memory_after(
        self, torsion: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        """Memory when the torsion has moved monotonously to `torsion` [rad]."""

    @abc.abstractmethod
    def scaled(self, factor: Float[Array, "..."] | float) -> "AbstractSwitchingBranch":
        """The branch beside a spring `scaled` alike: its torque times `factor`."""


class RelaxationBranch(AbstractGearBranch):
    r"""Viscoelastic gear of three springs and a damper.

    $$b = c_2\,(x - z),\qquad c_2\,(x - z) = c_3(z) + d_z\,\dot z$$

    Parallel to the spring $c_1$ of the gear stands the soft spring $c_2$, in series
    with the parallel pair of the spring $c_3$ and a damper. Slow motion meets $c_1$ and
    the series of $c_2$ and $c_3$, fast motion $c_1 + c_2$; in between energy is lost.
    The stored energy is that of $c_2$ and $c_3$, the loss $d_z \dot z^2 \ge 0$.

    The text describes the elements of its figure 2.5b, but not how they are connected;
    this arrangement is the one that its words suggest, without proof. The damper of the
    drive train itself, which the inverse needs, stands in parallel to all of it; the
    figure may not have it.

    Attributes:
        coupling: $c_2 > 0$ [N m/rad].
        relaxed: law of $c_3$, odd and increasing [N m].
        viscosity: $d_z > 0$ [N m s/rad]; the damper $d$ of the figure.

    Raises:
        ValueError: a parameter is outside its range, or their shapes differ.

    References:
        [Reiner2010] figure 2.5b and the text to it; no equation is given there.
    """

    coupling: Float[Array, " *joints"] = eqx.field(converter=as_real)
    relaxed: AbstractStiffness
    viscosity: Float[Array, " *joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`coupling` must be positive", self.coupling, self.coupling > 0)
        check_values("`viscosity` must be positive", self.viscosity, self.viscosity > 0)

    @property
    def states(self) -> int:
        return 1

    def rest(self, torsion: PerJoint) -> Float[Array, "1 joints"]:
        return _rest(self, torsion)[None]

    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "1 joints"],
    ) -> PerJoint:
        return self.coupling * (torsion - memory[0])

    def rates(
        self, torsion: PerJoint, rate: PerJoint, memory: Float[Array, "1 joints"]
    ) -> Float[Array, "1 joints"]:
        (inner,) = memory
        load = self.coupling * (torsion - inner) - self.relaxed.torque(inner)
        return (load / self.viscosity)[None]

    def scaled(self, factor: Float[Array, "..."] | float) -> "RelaxationBranch":
        return dataclasses.replace(
            self,
            coupling=factor * self.coupling,
            relaxed=self.relaxed.scaled(factor),
            viscosity=factor * self.viscosity,
        )


@jax.custom_jvp
def _rest(branch, torsion):
    """Inner torsion at which `branch` rests, differentiated implicitly."""
    size = jnp.abs(torsion)
    load = branch.coupling * size
    # Either spring alone would yield further; the nearer bound is less than twice the
    # solution of a linear law, and Newton's steps decrease on a hardening one.
    soft = load / (branch.coupling + branch.relaxed.secant(jnp.zeros_like(size)))
    upper = jnp.minimum(size, branch.relaxed.torsion(load))
    inner = jnp.minimum(soft, upper)
    for _ in range(_NEWTON_STEPS):
        excess = branch.coupling * inner + branch.relaxed.torque(inner) - load
        slope = branch.coupling + branch.relaxed.stiffness(inner)
        inner = jnp.clip(inner - excess / slope, 0.0, upper)
    return jnp.sign(torsion) * inner


@_rest.defjvp
def _rest_jvp(primals, tangents):
    branch, torsion = primals
    branch_change, torsion_change = tangents
    inner = _rest(branch, torsion)

    def load(branch, torsion):
        return branch.coupling * (torsion - inner) - branch.relaxed.torque(inner)

    _, change = jax.jvp(load, (branch, torsion), (branch_change, torsion_change))
    return inner, change / (branch.coupling + branch.relaxed.stiffness(inner))
