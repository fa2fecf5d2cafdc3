"""Exact inverse of the drive trains: from joint motion and torque to the motors."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar
from .._kernel import kernel
from .._taylor import Series
from ..drivetrain import (
    AbstractGearBranch,
    AbstractStiffness,
    AbstractSwitchingBranch,
    DriveTrain,
    GearMemory,
)
from ..dynamics import MotorSample
from ._memory_response import advance_memory, gear_field, memory_response
from ._response import advance, response


_BRACKETS = 60  # halvings; of the torsion at rest of a gear with a memory


class GearState(eqx.Module):
    """Torsion and memory of the gears.

    Attributes:
        torsion: output angle minus the angle behind the teeth [rad], shape (axes,).
        memory: of the gears' branch, (states, axes); empty without one.
    """

    torsion: PerJoint
    memory: GearMemory

    def augmented(self) -> Float[Array, "unknowns axes"]:
        """The torsion above the memory."""
        return jnp.concatenate([self.torsion[None], self.memory])


class DriveState(eqx.Module):
    """Memory of the inverse drive trains between two samples.

    Attributes:
        gear: of the gears.
        load: torque behind the gears and its rates at the last sample, (terms, axes).
    """

    gear: GearState
    load: Float[Array, "terms axes"]


def gear_spring(drives: DriveTrain) -> AbstractStiffness:
    """The gears' spring law.

    Raises:
        ValueError: the gears are rigid.
    """
    if not isinstance(drives.stiffness, AbstractStiffness):
        raise ValueError("this inverse needs a model with elastic gears")
    return drives.stiffness


def smooth_branch(drives: DriveTrain) -> AbstractGearBranch | None:
    """The gears' branch.

    Raises:
        ValueError: it is an exact one, which has no inverse.
    """
    if isinstance(drives.branch, AbstractSwitchingBranch):
        raise ValueError("exact hysteresis has no inverse: give the model a smooth one")
    return drives.branch


def resting_gear(drives: DriveTrain, load: Series) -> GearState:
    """Gears at rest under the constant torque `load` behind them, loaded once."""
    torque = -load.coefficients[0]
    spring = gear_spring(drives)
    torsion = spring.torsion(torque)
    if drives.branch is not None:
        torsion = _resting_torsion(drives, torque, torsion)
    return GearState(torsion, drives.resting_memory(torsion))


def _resting_torsion(drives: DriveTrain, torque, alone):
    """Torsion at which spring and branch transmit `torque`, by halving intervals.

    Found once, at the start of a motion; differentiated by one step of Newton.
    """
    law = drives.resting_torque
    fixed = jax.lax.stop_gradient
    held = jax.tree.map(fixed, drives)

    def wide(k, ends):  # a branch may be softer or stiffer than nothing
        low, high = ends
        value = held.resting_torque
        low = jnp.where(value(low) > fixed(torque), low - (high - low), low)
        high = jnp.where(value(high) < fixed(torque), high + (high - low), high)
        return low, high

    def halve(k, ends):
        low, high = ends
        middle = 0.5 * (low + high)
        below = held.resting_torque(middle) < fixed(torque)
        return jnp.where(below, middle, low), jnp.where(below, high, middle)

    size = fixed(jnp.abs(alone)) + 1e-9
    ends = jax.lax.fori_loop(0, 30, wide, (-size, size))
    low, high = jax.lax.fori_loop(0, _BRACKETS, halve, ends)
    x = 0.5 * (low + high)
    value, slope = jax.jvp(law, (x,), (jnp.ones_like(x),))
    return x - (value - torque) / fixed(slope)


def advance_gear(
    drives: DriveTrain,
    gear: GearState,
    before: Series,
    after: Series,
    dt: Scalar | float,
) -> GearState:
    """Gears one sample later.

    Args:
        drives: the drive trains.
        gear: at the start of the sample.
        before, after: torque behind the gears at its ends, order 1 or more.
        dt: length of the sample [s].

    References:
        [Reiner2010] (3.93a) in the relative angle.
    """
    branch = smooth_branch(drives)
    if branch is None or branch.path() is not None:
        return _advance_on_path(drives, gear, before, after, dt)
    field = gear_field(drives, branch)
    now = advance_memory(field, gear.augmented(), -before, -after, dt)
    return GearState(now[0], now[1:])


@kernel
def _advance_on_path(drives: DriveTrain, gear: GearState, before, after, dt):
    """The torsion alone is integrated: the memory, if any, follows it."""
    branch = smooth_branch(drives)
    path = None if branch is None else branch.path()

    def memory(torsion):
        if path is None:
            return gear.memory
        return path(gear.torsion, gear.memory, torsion)

    def spring(torsion):
        return drives.gear_torque(torsion, 0.0 * torsion, memory(torsion))

    if branch is None:
        spring = gear_spring(drives).torque
    else:  # plays turn within a sample: a higher order would see their corners
        before, after = before.truncated(1), after.truncated(1)
    torsion = advance(spring, drives.damping, gear.torsion, -before, -after, dt)
    return GearState(torsion, memory(torsion))


def gears_along(
    drives: DriveTrain, loads: Float[Array, "times terms axes"], dt: Scalar | float
) -> GearState:
    """Gears over a whole motion that starts at rest, time along the leading axis.

    Args:
        drives: the drive trains.
        loads: torque behind the gears and its rates [N m, N m/s], as coefficients.
        dt: time between samples [s].
    """

    def step(gear, pair):
        gear = advance_gear(drives, gear, Series(pair[0]), Series(pair[1]), dt)
        return gear, gear

    start = resting_gear(drives, Series(loads[0]))
    _, rest = jax.lax.scan(step, start, jnp.stack([loads[:-1], loads[1:]], axis=1))
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, rest)


@kernel
def motor_motion(
    drives: DriveTrain, q: Series, load: Series, gear: GearState, eta
) -> MotorSample:
    r"""Motor angles and torques from the motion and torque behind the gears.

    $\varphi_B = q - x$ stands behind the teeth and gives $\theta$, and
    $\tau_m = \Theta\ddot\theta + \tau_A + \tau_r(\dot\theta)$: the gear's torque is the
    load's by the balance of the gear, and $\tau_A$ what the teeth take for it. With a
    lag of the motor the command is $\tau_m + T_m\dot\tau_m$.

    Args:
        drives: the drive trains.
        q: joint angles, order 2 or more, 3 with a lag.
        load: torque behind the gears, order 1, 2 with a lag.
        gear: torsion and memory of the gears.
        eta: elastic coordinates to hand on.

    References:
        [Reiner2010] (3.92) to (3.94); (2.2), (2.6), (2.11) for lag, ratio, efficiency.
    """
    return motors_behind(drives, q, q - _torsion_series(drives, gear, load), load, eta)


def motors_behind(
    drives: DriveTrain, q: Series, angle: Series, load: Series, eta
) -> MotorSample:
    """Motor angles and torques from the motion and the torque behind the teeth.

    Args:
        drives, q, load, eta: as for `motor_motion`; without a lag the load may be of
            order 0.
        angle: behind the teeth, order 2 or more, 3 with a lag.
    """
    motion, behind = drives.before_teeth(angle).derivatives(), angle.derivatives()
    tau_a, inertia = load.derivatives(), drives.reflected_inertia()

    def torque(thetadd, tau_a, angle, thetad):
        return inertia * thetadd + drives.motor_load(-tau_a, angle, thetad)

    now = (motion[2], tau_a[0], behind[0], motion[1])
    if drives.motor.lag is None:
        tau_m = torque(*now)
    else:
        change = (motion[3], tau_a[1], behind[1], motion[2])
        tau_m = drives.motor.command(*jax.jvp(torque, now, change))
    return MotorSample(
        theta=motion[0],
        thetad=motion[1],
        thetadd=motion[2],
        tau_m=tau_m,
        tau_a=tau_a[0],
        q=q.coefficients[0],
        eta=eta,
    )


def _torsion_series(drives: DriveTrain, gear: GearState, load: Series) -> Series:
    """The torsion with its derivatives, one order more than the load."""
    branch = smooth_branch(drives)
    if branch is None:
        spring = gear_spring(drives).torque
        return response(spring, drives.damping, gear.torsion, -load)
    field = gear_field(drives, branch)
    return memory_response(field, gear.augmented(), -load)[0]
