"""Time skew between the encoders of the motor and of the link."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class EncoderSkew(eqx.Module):
    """Delay between two encoders of an axis.

    Attributes:
        delay: by which the link-side encoder lags behind the motor's [s].
        constant: constant difference, motor minus link [rad].
        residual: what is left of motor minus link, in the shape of the angles [rad].
    """

    delay: Float[Array, " *axes"]
    constant: Float[Array, " *axes"]
    residual: Float[Array, " times *axes"]


def estimate_skew(
    motor_angle: Float[Array, " times *axes"],
    link_angle: Float[Array, " times *axes"],
    motor_velocity: Float[Array, " times *axes"],
) -> EncoderSkew:
    r"""Skew of the encoders by least squares.

    $\varphi_{motor} - \varphi_{link} = \Delta t\,\dot\varphi_{motor} + c + r$.

    Elastic wind-up follows the torque, hence mostly the angle and the acceleration,
    neither of which correlates with the speed over a whole motion; friction behind the
    spring would, and would be read as a delay. An axis at rest has no delay: it is
    zero there.

    Args:
        motor_angle: on the output side [rad].
        link_angle: of the link-side encoder [rad].
        motor_velocity: on the output side [rad/s].
    """
    difference = motor_angle - link_angle
    constant = jnp.mean(difference, axis=0)
    mean = jnp.mean(motor_velocity, axis=0)
    speed = motor_velocity - mean[None]
    # scaled by the peak, so that no square underflows; the delay does not depend on it,
    # and an axis at rest gets a safe operand
    peak = jax.lax.stop_gradient(jnp.max(jnp.abs(speed), axis=0))
    moving = peak > 0
    peak = jnp.where(moving, peak, 1.0)
    speed = speed / peak[None]
    power = jnp.where(moving, jnp.sum(speed**2, axis=0), 1.0)
    product = jnp.sum(speed * (difference - constant[None]), axis=0)
    delay = jnp.where(moving, product / power / peak, 0.0)
    offset = constant - delay * mean
    residual = difference - delay[None] * motor_velocity - offset[None]
    return EncoderSkew(delay, offset, residual)
