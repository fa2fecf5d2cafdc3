"""The elastic robot under a motor controller, with motors that stick and slide."""

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._custom_types import PerJoint, Scalar
from .._kernel import kernel
from ..drivetrain import AbstractSwitchingBranch
from ._closed_loop import (
    AbstractMotorController,
    State,
    driven,
    loop_rates,
    state_parts,
)
from ._command import MotorSetpoint
from ._robot import ElasticRobot
from ._switching import AbstractSwitchingSystem


# speed [rad/s] by which a motor must have turned back before it counts: far below what
# the solver resolves, far above rounding
_TURNED = 1e-12


class SwitchingLoop(AbstractSwitchingSystem):
    """Robot and loop whose motors have modes: -1, 1 for their direction, 0 at rest.

    Attributes:
        robot: the plant.
        controller: closes the loop at the motors.
        setpoint: what the feed-forward asks for, over time.
    """

    robot: ElasticRobot
    controller: AbstractMotorController
    setpoint: Callable[[Scalar], MotorSetpoint]

    def rates(self, t: Scalar, x: State, mode: PerJoint) -> State:
        setpoint = self.setpoint(t)
        return loop_rates(self.robot, self.controller, setpoint, x, self._given(mode))

    def _given(self, mode: PerJoint) -> PerJoint | None:
        return mode if self.robot.drives.sticks else None

    def guards(self, t: Scalar, x: State, mode: PerJoint) -> Float[Array, " guards"]:
        if not self.robot.drives.sticks:
            return jnp.ones((2 * self.robot.axes,), x.dtype)
        return _guards(self.robot, self.controller, self.setpoint(t), x, mode)

    def switched(
        self, t: Scalar, x: State, mode: PerJoint, hit: Bool[Array, " guards"]
    ) -> tuple[State, PerJoint]:
        n = self.robot.axes
        starts, stops = hit.reshape(2, n) & (mode == 0)[None], hit[:n] & (mode != 0)
        state = state_parts(self.robot, self.controller, x)
        # a motor that stops holds as long as it can: its guards at rest decide next
        thetad = jnp.where(stops, 0.0, state.thetad)
        x = state._replace(thetad=thetad).vector()
        started = jnp.where(starts[0], 1.0, jnp.where(starts[1], -1.0, mode))
        return x, jnp.where(stops, 0.0, started)

    def accepted(self, t: Scalar, x: State, mode: PerJoint) -> State:
        branch = self.robot.drives.branch
        if not isinstance(branch, AbstractSwitchingBranch):
            return x
        state = state_parts(self.robot, self.controller, x)
        torsion = state.q - self.robot.drives.behind_teeth(state.theta)
        memory = branch.memory_after(torsion, state.gear)
        return state._replace(gear=memory).vector()


@kernel
def _guards(robot: ElasticRobot, controller, setpoint: MotorSetpoint, x, mode):
    """Margins to the torque that starts a motor either way, or its speed onwards."""
    state, tau_m, gear, _ = driven(robot, controller, setpoint, x, mode)
    angle = robot.drives.behind_teeth(state.theta)
    one = jnp.ones_like(tau_m)
    forwards = robot.drives.breakaway(gear, angle, one) - tau_m
    backwards = tau_m - robot.drives.breakaway(gear, angle, -one)
    onwards = mode * state.thetad + _TURNED
    at_rest = mode == 0.0
    return jnp.concatenate(
        [jnp.where(at_rest, forwards, onwards), jnp.where(at_rest, backwards, one)]
    )
