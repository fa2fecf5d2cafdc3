"""Exact inverse of the drive trains: from joint motion and torque to the motors."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._custom_types import PerJoint, Scalar
from .._kernel import kernel
from .._taylor import Series
from ..drivetrain import AbstractStiffness, DriveTrain
from ..dynamics import MotorSample
from ._response import advance, response


class DriveState(eqx.Module):
    """Memory of the inverse drive trains between two samples.

    Attributes:
        torsion: output minus motor angle [rad], shape (axes,).
        load: torque behind the gears and its rate at the last sample, shape (2, axes).
    """

    torsion: PerJoint
    load: Float[Array, "2 axes"]


def gear_spring(drives: DriveTrain) -> AbstractStiffness:
    """The gears' spring law.

    Raises:
        ValueError: the gears are rigid.
    """
    if drives.stiffness is None:
        raise ValueError("this inverse needs a model with elastic gears")
    return drives.stiffness


def resting_torsion(drives: DriveTrain, load: Series) -> PerJoint:
    """Torsion [rad] under the constant torque `load` behind the gears."""
    return gear_spring(drives).torsion(-load.coefficients[0])


@kernel
def advance_torsion(
    drives: DriveTrain,
    torsion: PerJoint,
    before: Series,
    after: Series,
    dt: Scalar | float,
) -> PerJoint:
    """Torsion [rad] one sample later.

    References:
        [Reiner2010] (3.93a) in the relative angle.
    """
    spring = gear_spring(drives).torque
    return advance(spring, drives.damping, torsion, -before, -after, dt)


def torsions_along(
    drives: DriveTrain, loads: Float[Array, "times 2 axes"], dt: Scalar | float
) -> Float[Array, "times axes"]:
    """Torsions [rad] over a whole motion that starts at rest.

    Args:
        drives: the drive trains.
        loads: torque behind the gears and its rate [N m, N m/s], as coefficients.
        dt: time between samples [s].
    """

    def step(torsion, pair):
        before, after = Series(pair[0]), Series(pair[1])
        torsion = advance_torsion(drives, torsion, before, after, dt)
        return torsion, torsion

    start = resting_torsion(drives, Series(loads[0]))
    _, rest = jax.lax.scan(step, start, jnp.stack([loads[:-1], loads[1:]], axis=1))
    return jnp.concatenate([start[None], rest])


@kernel
def motor_motion(
    drives: DriveTrain, q: Series, load: Series, torsion: PerJoint, eta
) -> MotorSample:
    r"""Motor angles and torques from the motion and torque behind the gears.

    $\theta = q - x$, and $\tau_m = \Theta\ddot\theta + \hat\tau_a +
    \tau_r(\dot\theta)$: the gear's torque is the load's by the balance of the gear.

    Args:
        drives: the drive trains.
        q: joint angles, order 2 or more.
        load: torque behind the gears, order 1.
        torsion: x, output minus motor angle [rad].
        eta: elastic coordinates to hand on.

    References:
        [Reiner2010] (3.92) to (3.94).
    """
    spring = gear_spring(drives).torque
    x = response(spring, drives.damping, torsion, -load)
    theta, thetad, thetadd = (q - x).derivatives()[:3]
    tau_a = load.coefficients[0]
    friction = drives.motor_friction.torque(thetad)
    return MotorSample(
        theta=theta,
        thetad=thetad,
        thetadd=thetadd,
        tau_m=drives.reflected_inertia() * thetadd + tau_a + friction,
        tau_a=tau_a,
        q=q.coefficients[0],
        eta=eta,
    )
