"""Transmission error of a gear: a ratio that varies around the turn."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, as_real


_NEWTON_STEPS = 6
_LARGEST = 0.5  # share of the ratio that may vary, so that six steps reach rounding


class TransmissionError(eqx.Module):
    r"""Angle error of the teeth as a Fourier series of the output angle.

    $$\theta = \varphi_B + \sum_j e_j \sin(n_j \varphi_B + \beta_j) + \varphi_0,\qquad
      \frac{i}{i_0} = 1 + \sum_j n_j e_j \cos(n_j \varphi_B + \beta_j)$$

    This is (2.6b) over the ratio $i_0$: with the text's amplitudes $e_j = \hat\imath_j/
    (i_0 n_j)$ and $\varphi_0 = \varphi_{i0}/i_0$. The start angle is not the motor
    angle at $\varphi_B = 0$ unless all $\beta_j$ vanish. The phases are those of the
    teeth: after a new reference run of the robot they have to be found anew.

    Attributes:
        amplitudes: $e_j$ on the output side [rad], shape (terms, joints).
        orders: $n_j$, periods per turn of the output, whole and positive [-].
        phases: $\beta_j$ [rad].
        start: $\varphi_0$ on the output side [rad], shape (joints,).

    Raises:
        ValueError: an order is not a whole positive number, the ratio would vary by
            more than a half, or shapes differ.

    References:
        [Reiner2010] (2.6).
    """

    amplitudes: Float[Array, "terms joints"] = eqx.field(converter=as_real)
    orders: Float[Array, "terms joints"] = eqx.field(converter=as_real)
    phases: Float[Array, "terms joints"] = eqx.field(converter=as_real)
    start: PerJoint = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`orders` must be whole positive numbers: periods per turn of the output",
            self.orders,
            (self.orders > 0) & (self.orders == jnp.round(self.orders)),
        )
        if is_concrete(self.amplitudes, self.orders):
            change = np.sum(np.abs(self.amplitudes) * self.orders, axis=0)
            check_values(
                f"the ratio must vary by less than {_LARGEST:g} of itself: the sum of "
                "`orders` times `amplitudes` must stay below that",
                change,
                change < _LARGEST,
            )

    @classmethod
    def from_ratio(
        cls, ratio, amplitudes, orders, phases, start
    ) -> "TransmissionError":
        r"""From the text's parameters on the motor side.

        Args:
            ratio: $i_0$, shape (joints,).
            amplitudes: $\hat\imath_j$ of the ratio [-], shape (terms, joints).
            orders: $\check\imath_j$.
            phases: $\bar\imath_j$ [rad].
            start: $\varphi_{i0}$ on the motor side [rad], shape (joints,).
        """
        ratio, orders = np.asarray(ratio, float), np.asarray(orders, float)
        errors = np.asarray(amplitudes, float) / (ratio * orders)
        return cls(errors, orders, phases, np.asarray(start, float) / ratio)

    def motor_angle(self, angle: PerJoint) -> PerJoint:
        """Motor angle on the output side [rad] at the angle behind the teeth."""
        waves = jnp.sin(self.orders * angle[None] + self.phases)
        return angle + jnp.sum(self.amplitudes * waves, axis=0) + self.start

    def ratio(self, angle: PerJoint) -> PerJoint:
        """Ratio over its mean [-] at the angle behind the teeth, (2.6a) over $i_0$."""
        waves = jnp.cos(self.orders * angle[None] + self.phases)
        return 1.0 + jnp.sum(self.orders * self.amplitudes * waves, axis=0)

    def output_angle(self, theta: PerJoint) -> PerJoint:
        """Angle behind the teeth [rad] at a motor angle: the inverse of `motor_angle`.

        Args:
            theta: motor angle on the output side [rad].
        """
        return _output_angle(self, theta)


@jax.custom_jvp
def _output_angle(error, theta):
    angle = theta - error.start
    for _ in range(_NEWTON_STEPS):
        angle = angle - (error.motor_angle(angle) - theta) / error.ratio(angle)
    return angle


@_output_angle.defjvp
def _output_angle_jvp(primals, tangents):
    error, theta = primals
    error_change, theta_change = tangents
    angle = _output_angle(error, theta)
    _, moved = jax.jvp(lambda e: e.motor_angle(angle), (error,), (error_change,))
    return angle, (theta_change - moved) / error.ratio(angle)
