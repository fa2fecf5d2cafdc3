"""Correction of the joint angles for a deformed structure."""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real
from .._taylor import Series, compose, concatenate, leading, linear, product
from ..dynamics import AxisRole, ElasticRobot
from ..kinematics import (
    CorrectionLimiter,
    MovingFrames,
    damped_least_squares,
    moving_frames,
    row_weights,
    smallest_singular_value,
    tool_jacobian,
    tool_levers,
)


class AbstractCorrection(eqx.Module):
    """Which error of the tool is corrected, and by which axes."""

    @abc.abstractmethod
    def target(self, model: ElasticRobot, q: Any) -> Any:
        """What the tool of the undeformed robot has to keep at the joint angles `q`."""

    @abc.abstractmethod
    def linearised(
        self, model: ElasticRobot, q: Any, eta: Any, target: Any
    ) -> tuple[Any, Any]:
        """Jacobian and error of the deformed robot at (q, eta), in one unit.

        Args:
            model: the robot.
            q, eta: joint angles and deformations, arrays or series.
            target: what `target` gave on the reference.

        Returns:
            Jacobian (rows, moving axes) and error (rows,), target minus actual [m].
        """

    @abc.abstractmethod
    def spread(self, model: ElasticRobot, correction: Any) -> Any:
        """Correction of all axes (axes,) from that of the moving ones."""

    @abc.abstractmethod
    def smallest(self, jacobian: Float[Array, "rows columns"]) -> Scalar:
        """Smallest singular value of the Jacobian that is not zero by structure."""


class PositionCorrection(AbstractCorrection):
    """The tool's position, by three axes; small errors of orientation remain.

    Attributes:
        axes: indices of the axes that correct.

    References:
        [Reiner2010] section 3.8.2 after (3.85), (3.54).
    """

    axes: tuple[int, ...] = eqx.field(static=True, default=(0, 1, 2))

    def target(self, model: ElasticRobot, q: Any) -> Any:
        return self._levers(model, q, _undeformed(model, q))[0]

    def linearised(
        self, model: ElasticRobot, q: Any, eta: Any, target: Any
    ) -> tuple[Any, Any]:
        position, jacobian = self._levers(model, q, eta)
        return jacobian, target - position

    def _levers(self, model: ElasticRobot, q: Any, eta: Any):
        joints = _driven_joints(model, self.axes)
        return tool_levers(model.chain, model.joint_coordinates(q, eta), joints)

    def spread(self, model: ElasticRobot, correction: Any) -> Any:
        return _spread(model, correction, self.axes)

    def smallest(self, jacobian: Float[Array, "rows columns"]) -> Scalar:
        return smallest_singular_value(jacobian)


class PoseCorrection(AbstractCorrection):
    """Position and orientation of the tool, by all axes.

    Attributes:
        characteristic_length: turns radians into metres in the orientation rows [m].
        rank: number of singular values that are not zero by structure; the number of
            rows or axes unless given.

    References:
        [Reiner2010] (3.56), (3.57), with the relative orientation error of the errata.
    """

    characteristic_length: Scalar = eqx.field(converter=as_real, default=1.0)
    rank: int | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_fields(self)
        length = self.characteristic_length
        check_values("`characteristic_length` must be positive [m]", length, length > 0)

    def target(self, model: ElasticRobot, q: Any) -> Any:
        return _frames(model, q, _undeformed(model, q))

    def linearised(
        self, model: ElasticRobot, q: Any, eta: Any, target: Any
    ) -> tuple[Any, Any]:
        frames = _frames(model, q, eta)
        columns = np.array(_driven_joints(model, tuple(range(model.axes))), int)
        jacobian = tool_jacobian(model.chain, frames)[:, columns]
        relative = product("ab,cb->ac", target.tool_rotation, frames.tool_rotation)
        turn = linear(_half_vee, relative)
        error = concatenate([target.tool_position - frames.tool_position, turn])
        weights = row_weights(self.characteristic_length)
        return product("ij,i->ij", jacobian, weights), product("i,i->i", error, weights)

    def spread(self, model: ElasticRobot, correction: Any) -> Any:
        return correction

    def smallest(self, jacobian: Float[Array, "rows columns"]) -> Scalar:
        return smallest_singular_value(jacobian, self.rank)


def correct(
    correction: AbstractCorrection,
    model: ElasticRobot,
    q,
    eta,
    damping,
    limiter: CorrectionLimiter | None,
    iterations: int,
):
    r"""Correction $\Delta\varphi_a$ of all axes that puts the deformed tool in place.

    Args:
        correction: which error, which axes.
        model: the robot.
        q: reference of the joints, array or series.
        eta: deformations, of the same kind.
        damping: lambda [m], scalar of the same kind.
        limiter: bounds the correction, or `None`.
        iterations: number of damped steps; the text takes one.

    References:
        [Reiner2010] (3.85) with the sign of the errata, (3.86), (3.71).
    """
    target = correction.target(model, q)
    moved = q
    for _ in range(iterations):
        jacobian, error = correction.linearised(model, moved, eta, target)
        step = correction.spread(model, damped_least_squares(jacobian, error, damping))
        moved = moved + step
    total = moved - q
    return total if limiter is None else compose(limiter, total)


def _undeformed(model: ElasticRobot, q):
    """Deformations of zero, of the kind of `q`."""
    if isinstance(q, Series):
        return Series(jnp.zeros((q.order + 1, model.elastic), leading(q).dtype))
    return jnp.zeros((model.elastic,), q.dtype)


def _frames(model: ElasticRobot, q, eta) -> MovingFrames:
    return moving_frames(model.chain, model.joint_coordinates(q, eta))


def _driven_joints(model: ElasticRobot, axes: tuple[int, ...]) -> tuple[int, ...]:
    """Joints of the chain that the axes drive."""
    driven = {
        role.index: joint
        for joint, role in enumerate(model.roles)
        if isinstance(role, AxisRole)
    }
    return tuple(driven[axis] for axis in axes)


def _spread(model: ElasticRobot, correction, axes: tuple[int, ...]):
    selection = np.zeros((model.axes, len(axes)))
    selection[np.array(axes), np.arange(len(axes))] = 1.0
    dtype = leading(correction).dtype
    return product("ij,j->i", jnp.asarray(selection, dtype), correction)


def _half_vee(relative: Float[Array, "3 3"]) -> Float[Array, "3"]:
    """Small-angle vector of a relative rotation, as in `rotation_error`."""
    return 0.5 * jnp.stack(
        [
            relative[2, 1] - relative[1, 2],
            relative[0, 2] - relative[2, 0],
            relative[1, 0] - relative[0, 1],
        ]
    )
