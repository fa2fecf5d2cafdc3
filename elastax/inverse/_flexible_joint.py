"""Flexible-joint inverse: the gears give way, the structure does not (RLFJ)."""

import equinox as eqx
import jax
import jax.numpy as jnp

from .._custom_types import Scalar
from .._taylor import Series, from_derivatives
from ..dynamics import ElasticRobot, MotorCommand, MotorSample, inverse_dynamics
from ..signals import Reference
from ._base import AbstractInverse, Derivatives, check_reference, samples_of
from ._drive import (
    DriveState,
    advance_gear,
    gear_spring,
    gears_along,
    motor_motion,
    resting_gear,
)


class _State(eqx.Module):
    drive: DriveState
    dt: Scalar
    elapsed: Scalar  # time since the last sample: zero before the first


class FlexibleJointInverse(AbstractInverse):
    """Exact inverse of the rigid links behind elastic gears.

    References:
        [Reiner2010] section 6.2 (RLFJ), (3.92) to (3.94).
    """

    def order(self, model: ElasticRobot) -> int:
        return 3 + model.drives.extra_order

    def init(
        self, model: ElasticRobot, sample: Derivatives, dt: Scalar | float
    ) -> _State:
        load = _load(model.flexible_joint(), sample)
        gear = resting_gear(model.drives, load)
        dt = jnp.asarray(dt, sample.dtype)
        return _State(DriveState(gear, load.coefficients), dt, jnp.zeros_like(dt))

    def step(
        self, model: ElasticRobot, state: _State, sample: Derivatives
    ) -> tuple[MotorSample, _State]:
        load = _load(model.flexible_joint(), sample)
        before = Series(state.drive.load)
        gear = advance_gear(model.drives, state.drive.gear, before, load, state.elapsed)
        output = _output(model, sample, load, gear)
        drive = DriveState(gear, load.coefficients)
        return output, _State(drive, state.dt, state.dt)

    def feedforward(self, model: ElasticRobot, reference: Reference) -> MotorCommand:
        check_reference(self, model, reference)
        gear_spring(model.drives)
        samples = samples_of(self, model, reference)
        rigid_links = model.flexible_joint()
        loads = jax.vmap(lambda s: _load(rigid_links, s).coefficients)(samples)
        gears = gears_along(model.drives, loads, reference.dt)
        outputs = jax.vmap(lambda s, f, g: _output(model, s, Series(f), g))(
            samples, loads, gears
        )
        return MotorCommand.from_samples(reference.times, outputs)


def _load(model: ElasticRobot, sample: Derivatives) -> Series:
    """Torque behind the gears with its rate, [Reiner2010] (3.91)."""
    order = 1 + model.drives.extra_order
    q = from_derivatives(sample[: order + 3])
    qd, qdd = q.rate(), q.rate().rate()
    tau_a, _ = inverse_dynamics(model, q.truncated(order), qd.truncated(order), qdd)
    return tau_a


def _output(model, sample, load, gear) -> MotorSample:
    empty = jnp.zeros((0,), sample.dtype)
    return motor_motion(model.drives, from_derivatives(sample), load, gear, empty)
