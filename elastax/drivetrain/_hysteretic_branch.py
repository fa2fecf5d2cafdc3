r"""Hysteresis of a gear, from plays in its torsion.

Friction between teeth and their elasticity make the torque of a gear depend on where
the torsion came from. With the plays $P_i$ the torque beside the gear's spring is that
of Coulomb elements, each in series with a spring of its own: $x - P_i$ is how far the
spring i is strained before its element slips. It takes energy around a loop. The other
sign, positive weights of the plays themselves, would deliver energy.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, as_real
from ..structure import AbstractStiffness
from ._branch import AbstractGearBranch, AbstractSwitchingBranch, MemoryPath
from ._hysteresis import AbstractSmoothPlay, play


class StopBranch(AbstractGearBranch):
    r"""Springs that slip, $b = \sum_i c_i\,(x - P_i[x])$.

    Attributes:
        stiffness: $c_i \ge 0$ of the slipping springs, shape (plays, joints) [N m/rad].
        play: the smooth plays, whose thresholds are the torsions at which the springs
            slip [rad].

    Raises:
        ValueError: a stiffness is negative, or the number of plays differs.

    References:
        [Reiner2010] (2.14) with $w_i = -c_i$, the sign that takes energy.
    """

    stiffness: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    play: AbstractSmoothPlay

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`stiffness` of slipping springs must not be negative",
            self.stiffness,
            self.stiffness >= 0,
        )
        _check_number(self.stiffness, self.play.number)

    @property
    def states(self) -> int:
        return self.play.states

    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        return self.play.rest(torsion)

    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        slack = torsion[None] - self.play.outputs(torsion, memory)
        return jnp.sum(self.stiffness * slack, axis=0)

    def rates(
        self, torsion: PerJoint, rate: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        return self.play.rates(torsion, rate, memory)

    def path(self) -> MemoryPath | None:
        return self.play.path()

    def scaled(self, factor: Float[Array, "..."] | float) -> "StopBranch":
        return dataclasses.replace(self, stiffness=factor * self.stiffness)


class HysteresisBranch(AbstractGearBranch):
    r"""The gear of the text, $\tau = H(x)\,c(x) + d\,\dot x$.

    With $H = w_0 x + \sum_i w_i P_i[x]$ and the secant stiffness $c(x)$ of the gear's
    spring this is its torque $c(x)\,x$ and the branch $b = c(x)\,(H(x) - x)$. Weights
    $w_i \le 0$ take energy around a loop; the positive ones that the text suggests make
    the torque lag and deliver energy, and are refused.

    Attributes:
        input_weight: $w_0 > 0$ of the torsion itself, shape (joints,).
        weights: $w_i \le 0$ of the plays, shape (plays, joints), with $w_0 + \sum w_i >
            0$.
        play: the smooth plays; thresholds [rad].

    Raises:
        ValueError: a weight has the wrong sign, the sum of all is not positive, or the
            number of plays differs.

    References:
        [Reiner2010] (2.19), with the sign condition of a gear that loses energy.
    """

    input_weight: PerJoint = eqx.field(converter=as_real)
    weights: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    play: AbstractSmoothPlay

    def __check_init__(self):
        check_fields(self)
        _check_weights(self.input_weight, self.weights)
        _check_number(self.weights, self.play.number)

    @property
    def states(self) -> int:
        return self.play.states

    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        return self.play.rest(torsion)

    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        outputs = self.play.outputs(torsion, memory)
        change = (self.input_weight - 1.0) * torsion
        change = change + jnp.sum(self.weights * outputs, axis=0)
        return spring.secant(torsion) * change

    def rates(
        self, torsion: PerJoint, rate: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        return self.play.rates(torsion, rate, memory)

    def path(self) -> MemoryPath | None:
        return self.play.path()

    def scaled(self, factor: Float[Array, "..."] | float) -> "HysteresisBranch":
        return self  # the factor is in the spring


class ExactStopBranch(AbstractSwitchingBranch):
    r"""`StopBranch` with exact plays, for plants.

    Attributes:
        stiffness: $c_i \ge 0$, shape (plays, joints) [N m/rad].
        thresholds: torsions at which the springs slip, $r_i > 0$ [rad].

    Raises:
        ValueError: a stiffness is negative, a threshold not positive, or shapes differ.

    References:
        [Reiner2010] (2.13), (2.14).
    """

    stiffness: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    thresholds: Float[Array, "plays joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`stiffness` of slipping springs must not be negative",
            self.stiffness,
            self.stiffness >= 0,
        )
        check_values(
            "`thresholds` must be positive", self.thresholds, self.thresholds > 0
        )

    @property
    def states(self) -> int:
        return self.thresholds.shape[0]

    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        return self.memory_after(torsion, jnp.zeros_like(self.thresholds))

    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        slack = torsion[None] - self.memory_after(torsion, memory)
        return jnp.sum(self.stiffness * slack, axis=0)

    def memory_after(
        self, torsion: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        return play(torsion[None], memory, self.thresholds)

    def scaled(self, factor: Float[Array, "..."] | float) -> "ExactStopBranch":
        return dataclasses.replace(self, stiffness=factor * self.stiffness)


class ExactHysteresisBranch(AbstractSwitchingBranch):
    r"""`HysteresisBranch` with exact plays, for plants.

    Attributes:
        input_weight: $w_0 > 0$ of the torsion itself, shape (joints,).
        weights: $w_i \le 0$ of the plays, shape (plays, joints), with $w_0 + \sum w_i >
            0$.
        thresholds: $r_i > 0$ [rad].

    Raises:
        ValueError: a weight has the wrong sign, the sum of all or a threshold is not
            positive, or shapes differ.

    References:
        [Reiner2010] (2.13), (2.14), (2.19), with the sign condition of a gear that
        loses energy.
    """

    input_weight: PerJoint = eqx.field(converter=as_real)
    weights: Float[Array, "plays joints"] = eqx.field(converter=as_real)
    thresholds: Float[Array, "plays joints"] = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        _check_weights(self.input_weight, self.weights)
        check_values(
            "`thresholds` must be positive", self.thresholds, self.thresholds > 0
        )

    @property
    def states(self) -> int:
        return self.thresholds.shape[0]

    def rest(self, torsion: PerJoint) -> Float[Array, "states joints"]:
        return self.memory_after(torsion, jnp.zeros_like(self.thresholds))

    def torque(
        self,
        spring: AbstractStiffness,
        torsion: PerJoint,
        memory: Float[Array, "states joints"],
    ) -> PerJoint:
        outputs = self.memory_after(torsion, memory)
        change = (self.input_weight - 1.0) * torsion
        change = change + jnp.sum(self.weights * outputs, axis=0)
        return spring.secant(torsion) * change

    def memory_after(
        self, torsion: PerJoint, memory: Float[Array, "states joints"]
    ) -> Float[Array, "states joints"]:
        return play(torsion[None], memory, self.thresholds)

    def scaled(self, factor: Float[Array, "..."] | float) -> "ExactHysteresisBranch":
        return self  # the factor is in the spring


def _check_number(values, number: int) -> None:
    if values.shape[0] != number:
        raise ValueError(
            f"there must be one row per play: the plays are {number}, but the rows "
            f"{values.shape[0]}"
        )


def _check_weights(input_weight, weights) -> None:
    check_values("`input_weight` must be positive", input_weight, input_weight > 0)
    check_values(
        "`weights` of the plays must not be positive: the gear would deliver energy "
        "around every loop",
        weights,
        weights <= 0,
    )
    if is_concrete(input_weight, weights):
        total = np.asarray(input_weight) + np.sum(np.asarray(weights), axis=0)
        check_values(
            "`input_weight` and all `weights` must have a positive sum, or the torque "
            "would fall with the torsion",
            total,
            total > 0,
        )
