"""Motion of the joints, to any order, that gives the tool its motion."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, as_real
from .._kernel import kernel
from ._chain import SerialChain
from ._damping import AbstractDamping
from ._ik_dls import row_weights, smallest_singular_value
from ._jacobian import jacobian
from ._motion import tool_derivatives


class AbstractRateInverse(eqx.Module):
    """Generalised inverse of a Jacobian: joint rates from a twist."""

    @abc.abstractmethod
    def __call__(
        self, jacobian: Float[Array, "rows joints"]
    ) -> Float[Array, "joints rows"]:
        """Inverse of a Jacobian in one unit of length."""

    @abc.abstractmethod
    def is_bounded(self) -> bool:
        """Whether the inverse exists at singular poses too."""


class ExactRateInverse(AbstractRateInverse):
    """The inverse of a square Jacobian.

    References:
        [KinModell] (3-106), (3-126).
    """

    def __call__(
        self, jacobian: Float[Array, "rows joints"]
    ) -> Float[Array, "joints rows"]:
        rows, joints = jacobian.shape
        if rows != joints:
            raise ValueError(
                "`ExactRateInverse` needs as many rows as joints, but the Jacobian has "
                f"{rows} rows and {joints} joints: choose `rows`, or take "
                "`LeastSquaresRateInverse`"
            )
        return jnp.linalg.inv(jacobian)

    def is_bounded(self) -> bool:
        return False


class LeastSquaresRateInverse(AbstractRateInverse):
    r"""Pseudo-inverse of a Jacobian of full rank.

    With more joints than rows the rates are the smallest ones,
    $J^+ = W^{-1}J^T(JW^{-1}J^T)^{-1}$; with fewer the error is,
    $J^+ = (J^TJ)^{-1}J^T$.

    Attributes:
        weights: of the squared rates, diagonal of W, positive, one for all joints or
            shape (joints,). They matter to redundant arms only.

    References:
        [Berns], pseudo-inverse and weighted redundancy.
    """

    weights: Float[Array, "*joints"] = eqx.field(converter=as_real, default=1.0)

    def __check_init__(self):
        check_fields(self)
        check_values("`weights` must be positive", self.weights, self.weights > 0)

    def __call__(
        self, jacobian: Float[Array, "rows joints"]
    ) -> Float[Array, "joints rows"]:
        # by orthogonal factors: the product J J^T would square the condition
        rows, joints = jacobian.shape
        if rows > joints:
            Q, R = jnp.linalg.qr(jacobian)
            return jax.scipy.linalg.solve_triangular(R, Q.T)
        light = 1 / jnp.sqrt(jnp.broadcast_to(self.weights, (joints,)))[:, None]
        Q, R = jnp.linalg.qr(light * jacobian.T)
        return light * jax.scipy.linalg.solve_triangular(R, Q.T).T

    def is_bounded(self) -> bool:
        return False


class DampedRateInverse(AbstractRateInverse):
    r"""Damped inverse, bounded at singular poses: $J^T (J J^T + \lambda^2 I)^{-1}$.

    Attributes:
        damping: law from the smallest singular value [m] to $\lambda$ [m].

    References:
        [Reiner2010] (3.65), (3.66).
    """

    damping: AbstractDamping

    def __call__(
        self, jacobian: Float[Array, "rows joints"]
    ) -> Float[Array, "joints rows"]:
        value = self.damping(smallest_singular_value(jacobian))
        identity = jnp.eye(jacobian.shape[0], dtype=jacobian.dtype)
        square = jacobian @ jacobian.T + value**2 * identity
        return jax.scipy.linalg.solve(square, jacobian, assume_a="pos").T

    def is_bounded(self) -> bool:
        return True


class JointMotion(eqx.Module):
    """Joint coordinates and their derivatives that give the tool a motion.

    Attributes:
        derivatives: shape (order + 1, joints), row 0 the coordinates [rad/s^k] or
            [m/s^k].
        error: wanted minus reached derivatives of the twist, shape (order, rows).
        smallest: smallest singular value [m] of the Jacobian, its rotation rows scaled
            by the characteristic length.
        is_regular: whether it exceeds the tolerance. Where the pose is singular and
            the inverse is not bounded, all derivatives are zero.
    """

    derivatives: Float[Array, "terms joints"]
    error: Float[Array, "order rows"]
    smallest: Scalar
    is_regular: Bool[Array, ""]


def inverse_motion(
    chain: SerialChain,
    q: PerJoint,
    twists: Float[Array, "order rows"],
    *,
    inverse: AbstractRateInverse = ExactRateInverse(),
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
    tolerance: float = 1e-9,
    throw: bool = True,
) -> JointMotion:
    r"""Velocities, accelerations, jerks, ... of the joints from those of the tool.

    $\dot x = J^{-1}\dot y$, $\ddot x = J^{-1}(\ddot y - \dot J\dot x)$,
    $\dddot x = J^{-1}(\dddot y - \ddot J\dot x - 2\dot J\ddot x)$ and so on to any
    order: what the lower derivatives of the joints do to the tool is found by running
    the motion forward, and the rest is left to the highest one.

    Each derivative is the inverse's answer for its own order. For redundant arms that
    is the smallest derivative of every order, and the tool's motion is met; it is not
    the derivative of the law $\dot x = J^+\dot y$, for which see `resolved_motion`. A
    damped inverse, or one with more rows than joints, leaves an `error`.

    Args:
        chain: the chain.
        q: joint coordinates, shape (joints,) [rad] or [m].
        twists: derivatives of the tool's twist from order 0 on, as
            `ToolMotion.twists`, of the chosen rows; shape (order, rows). Of a motion
            in roll-pitch-yaw angles take `motion_from_rpy`.
        inverse: `ExactRateInverse`, `LeastSquaresRateInverse` or `DampedRateInverse`.
        rows: rows of the twist that are given; (0, 1) for a planar arm of two joints.
        characteristic_length: length that turns 1 rad into a distance [m].
        tolerance: smallest singular value over the norm of the Jacobian at which a
            pose counts as singular.
        throw: raise an error at a singular pose where the inverse is not bounded;
            otherwise see `is_regular`.

    Raises:
        ValueError: shapes or rows do not fit.

    References:
        [KinModell] (3-125) to (3-133). In (3-110), (3-113), (3-127) and (3-128) the
        printed symbols look like inverses of the differentiated Jacobian, and the print
        asks for their determinants; only that of J itself matters.
    """
    rows = checked_rows(rows, twists)
    given = np.array(rows)
    weights = row_weights(jnp.asarray(characteristic_length, q.dtype), rows)
    plain = jacobian(chain, q)[given]
    matrix = weights[:, None] * plain
    size = jnp.sqrt(jnp.sum(jax.lax.stop_gradient(matrix) ** 2))
    smallest = smallest_singular_value(matrix)
    is_regular = smallest > tolerance * size

    if not inverse.is_bounded():
        # a safe operand: a singular matrix would spoil values and derivatives
        safe = jnp.eye(*matrix.shape, dtype=matrix.dtype)
        solvable = jnp.where(is_regular, matrix, safe)
        general = jnp.where(is_regular, inverse(solvable), 0.0)
        if throw:
            general = eqx.error_if(
                general,
                ~is_regular,
                "the pose is singular: move `q`, leave out `rows`, take "
                "`DampedRateInverse`, or pass `throw=False` and heed `is_regular`",
            )
    else:
        general = inverse(matrix)
    general = general * weights[None]  # of rows in their own units

    derivatives, error = _recursion(chain, q, twists, general, plain, rows)
    return JointMotion(derivatives, error, smallest, is_regular)


def checked_rows(rows: tuple[int, ...], twists: Any) -> tuple[int, ...]:
    """The chosen rows of a twist, if they are rows and `twists` has as many columns."""
    rows = tuple(rows)
    if len(set(rows)) != len(rows) or not rows or not set(rows) <= set(range(6)):
        raise ValueError(f"`rows` must be distinct indices from 0 to 5, but is {rows}")
    if twists.ndim != 2 or twists.shape[1] != len(rows) or twists.shape[0] < 1:
        raise ValueError(
            f"`twists` must have the shape (order, {len(rows)}), the order one or "
            f"more, but has {twists.shape}"
        )
    return rows


@kernel
def _recursion(chain, q, twists, general, matrix, rows):
    """Derivatives of the joints, one order after the other, and what is left over.

    As one kernel: what the orders have in common is computed once.
    """
    given, order = np.array(rows), twists.shape[0]
    derivatives = jnp.zeros((order + 1, chain.number), q.dtype).at[0].set(q)
    errors = []
    for k in range(order):
        # the highest derivative is still zero: what is there comes from the lower ones
        reached = tool_derivatives(chain, derivatives[: k + 2]).twists[k]
        rest = twists[k] - reached[given]
        highest = general @ rest
        errors.append(rest - matrix @ highest)
        derivatives = derivatives.at[k + 1].set(highest)
    return derivatives, jnp.stack(errors)
