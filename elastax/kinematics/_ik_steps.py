r"""Corrections of an iterative inverse: what follows from Jacobian and error."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, as_real
from .._taylor import leading
from ._damping import AbstractDamping
from ._ik_dls import damped_least_squares, smallest_singular_value
from ._redundancy import CUTOFF, weighted_correction


Jacobian = Float[Array, "rows joints"]
Error = Float[Array, " rows"]

_FLOOR = 1e-6  # smallest damping over the largest entry of the Jacobian


class AbstractStep(eqx.Module):
    """How a correction follows from the weighted Jacobian and the weighted error."""

    @abc.abstractmethod
    def __call__(self, jacobian: Jacobian, error: Error, q: PerJoint) -> PerJoint:
        """Correction of the joint coordinates [rad] or [m].

        Args:
            jacobian: shape (rows, joints); columns of resting joints are zero.
            error: target minus actual, shape (rows,).
            q: coordinates at which both were taken.
        """


class PseudoInverseStep(AbstractStep):
    r"""Newton's method and Gauss-Newton: $\Delta\theta = J^+ \Delta x$.

    $J^+ = J^{-1}$ of a square matrix, $J^T (J J^T)^{-1}$ for a redundant arm,
    $(J^T J)^{-1} J^T$ for an over-determined one; by singular values, so that
    directions in which the arm cannot move are left out instead of dividing by zero.

    Attributes:
        cutoff: singular values below this part of the largest one count as zero.

    References:
        [KinModell] (3-43), (3-130); [Reiner2010] (3.57c), (3.60); [Berns].
    """

    cutoff: Scalar = eqx.field(converter=as_real, default=CUTOFF)

    def __check_init__(self):
        check_fields(self)
        inside = (self.cutoff > 0) & (self.cutoff < 1)
        check_values("`cutoff` must be between 0 and 1", self.cutoff, inside)

    def __call__(self, jacobian: Jacobian, error: Error, q: PerJoint) -> PerJoint:
        return jnp.linalg.pinv(jacobian, rtol=self.cutoff) @ error


class DampedStep(AbstractStep):
    """Damped least squares with a damping from the smallest singular value.

    Attributes:
        damping: law, in the unit of the weighted rows.

    References:
        [Reiner2010] (3.63b), (3.65), (3.66).
    """

    damping: AbstractDamping

    def __call__(self, jacobian: Jacobian, error: Error, q: PerJoint) -> PerJoint:
        value = self.damping(smallest_singular_value(jacobian))
        return leading(damped_least_squares(jacobian, error, value))


class ErrorDampedStep(AbstractStep):
    r"""Levenberg-Marquardt with a damping that falls with the error.

    $\lambda^2 = g\,|\Delta x|^2$: bounded steps far away and at singular postures,
    Newton's rate at the solution.

    Attributes:
        gain: g > 0.

    References:
        [Sugihara2011], whose constant bias is left out; [Reiner2010] (3.63b).
    """

    gain: Scalar = eqx.field(converter=as_real, default=1e-2)

    def __check_init__(self):
        check_fields(self)
        check_values("`gain` must be positive", self.gain, self.gain > 0)

    def __call__(self, jacobian: Jacobian, error: Error, q: PerJoint) -> PerJoint:
        least = _FLOOR * jnp.max(jnp.abs(jacobian)) + jnp.finfo(error.dtype).tiny
        damping = jnp.sqrt(self.gain * error @ error + least**2)
        return leading(damped_least_squares(jacobian, error, damping))


class RestPostureStep(AbstractStep):
    r"""Steps of a redundant arm that keep near a natural posture.

    Removes the error and, of all corrections that do, takes the one closest to
    $\Delta\theta' = s\,(\theta_r - \theta)$.

    Attributes:
        rest: $\theta_r$, the most natural posture [rad] or [m], shape (joints,).
        weights: w > 0, shape (joints,).
        share: s in (0, 1], part of the way to the posture in one step.

    References:
        [Berns] "Unterbestimmtes System".
    """

    rest: PerJoint = eqx.field(converter=as_real)
    weights: PerJoint = eqx.field(converter=as_real)
    share: Scalar = eqx.field(converter=as_real, default=0.5)

    def __check_init__(self):
        check_fields(self)
        check_values("`weights` must be positive", self.weights, self.weights > 0)
        inside = (self.share > 0) & (self.share <= 1)
        check_values("`share` must be in (0, 1]", self.share, inside)

    def __call__(self, jacobian: Jacobian, error: Error, q: PerJoint) -> PerJoint:
        preferred = self.share * (self.rest - q)
        return weighted_correction(jacobian, error, self.weights, preferred)


def limit_step(correction: PerJoint, largest: Scalar | PerJoint) -> PerJoint:
    r"""Correction shortened until no joint moves more than it may, direction kept.

    $\Delta\varphi / \max(1, \max_k |\Delta\varphi_k| / \Delta\varphi_{max,k})$. The
    text divides one element of the error by a factor for each joint, where the whole
    vector is meant, and which turns the direction of the correction.

    Args:
        correction: [rad] or [m], shape (joints,).
        largest: limit, one for all joints or shape (joints,).

    References:
        [Reiner2010] (3.58), corrected.
    """
    return correction / jnp.maximum(1.0, jnp.max(jnp.abs(correction) / largest))
