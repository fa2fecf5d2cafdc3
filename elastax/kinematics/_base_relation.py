r"""Where two cooperating chains stand to each other, from poses measured in a grip.

Each measurement is a pair of tool poses $A_i$ of the master and $B_i$ of the slave
with an object held by both, or a probe of one in a socket of the other:
$B_i = X A_i G$ with the relation X of the bases and the grasp G, both constant. G may
be known, or be solved for as well; in that case the turns of the object about at least
two directions are needed.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._checks import is_concrete
from .._custom_types import Scalar, Transform, require_float64
from ._cooperating import loop_error
from ._exponential import transform_from_twist
from ._ik_dls import row_weights
from ._orientation import check_transform
from ._se3 import transform


class BaseRelation(eqx.Module):
    """Outcome of `identify_base_relation`.

    Attributes:
        relation: pose of the master's base in the slave's base frame [m].
        grasp: pose of the slave's tool in the master's tool frame [m].
        covariance: of the unknowns: displacement of the relation in its own frame,
            translation [m] above rotation [rad], then that of the grasp if it was
            solved for; shape (6, 6) or (12, 12). From the spread of the residuals,
            zero if there are no more equations than unknowns.
        residuals: `loop_error` of every sample, shape (samples, 6) [m] and [rad].
        rank: number of unknowns that the samples determine.
        converged: whether the corrections died out.
    """

    relation: Transform
    grasp: Transform
    covariance: Float[Array, "unknowns unknowns"]
    residuals: Float[Array, "samples 6"]
    rank: Int[Array, ""]
    converged: Bool[Array, ""]


class _State(NamedTuple):
    relation: Transform
    grasp: Transform
    cost: Scalar
    damping: Scalar
    step: Scalar
    steps: Int[Array, ""]


def identify_base_relation(
    masters: Float[Array, "samples 4 4"],
    slaves: Float[Array, "pairs 4 4"],
    *,
    grasp: Transform | None = None,
    characteristic_length: Scalar | float = 1.0,
    tolerance: float = 1e-3,
    max_steps: int = 50,
    throw: bool = True,
) -> BaseRelation:
    r"""Relation of two bases, and the grasp, from tool poses measured in pairs.

    Least squares of `loop_error` over both rigid motions by Levenberg and Marquardt,
    from 24 orientations over all rotations if the grasp is unknown. The result has
    derivatives by the poses, those of one more Gauss-Newton step.

    Args:
        masters: poses $A_i$ of the master's tool in its base frame, shape
            (samples, 4, 4) [m].
        slaves: poses $B_i$ of the slave's tool in its base frame, likewise.
        grasp: G, pose of the slave's tool in the master's tool frame, if it is known;
            unknown unless given.
        characteristic_length: length that weighs rotations against translations [m]:
            the position noise over that of the angles.
        tolerance: an unknown counts as determined if it moves the loop by more than
            this share of what the best-determined one does; directions of turns that
            differ by less than this [rad] count as one.
        max_steps: largest number of corrections.
        throw: raise an error if the samples do not determine all unknowns, or if the
            corrections do not die out; otherwise see `rank` and `converged`.

    Returns:
        Relation, grasp, their covariance, residuals and rank.

    Raises:
        ValueError: shapes do not fit, a pose is no rigid motion, or precision is
            single.
        RuntimeError: the samples do not determine all unknowns: the message names the
            rank. Turns about one direction only leave at least one unknown open, no
            turns at least three.

    References:
        [KinModell] 3.6, (3-139).
    """
    require_float64("the identification of a base relation")
    _check_samples(masters, slaves)
    unknowns = 6 if grasp is not None else 12
    length = jnp.asarray(characteristic_length, masters.dtype)
    weights = jax.lax.stop_gradient(row_weights(length))

    def errors(change, relation, grasp, masters, slaves):
        """Weighted loop errors, shape (samples * 6,)."""
        relation = relation @ transform_from_twist(change[:6])
        if unknowns == 12:
            grasp = grasp @ transform_from_twist(change[6:])
        one = lambda a, b: weights * loop_error(relation, a, grasp, b)
        return jax.vmap(one)(masters, slaves).reshape(-1)

    zero = jnp.zeros(unknowns, masters.dtype)
    # the iteration itself is not differentiated
    fixed = jax.lax.stop_gradient((masters, slaves))

    def linearised(relation, grasp):
        function = lambda change: errors(change, relation, grasp, *fixed)
        return function(zero), jax.jacfwd(function)(zero)

    def improve(state: _State) -> _State:
        values, slopes = linearised(state.relation, state.grasp)
        gram = slopes.T @ slopes
        damped = gram + state.damping * jnp.trace(gram) * jnp.eye(unknowns)
        change = -jnp.linalg.solve(damped, slopes.T @ values)
        relation = state.relation @ transform_from_twist(change[:6])
        moved = state.grasp
        if unknowns == 12:
            moved = moved @ transform_from_twist(change[6:])
        cost = jnp.sum(errors(zero, relation, moved, *fixed) ** 2)
        better = cost <= state.cost
        keep = lambda new, old: jnp.where(better, new, old)
        return _State(
            keep(relation, state.relation),
            keep(moved, state.grasp),
            keep(cost, state.cost),
            state.damping * keep(jnp.array(0.1), jnp.array(10.0)),
            jnp.max(jnp.abs(change)),
            state.steps + 1,
        )

    def unfinished(state: _State):
        return (state.step > 1e-12) & (state.steps < max_steps)

    def fit(relation, grasp):
        cost = jnp.sum(errors(zero, relation, grasp, *fixed) ** 2)
        first = _State(
            relation, grasp, cost, jnp.array(1e-3), jnp.array(jnp.inf), jnp.array(0)
        )
        return jax.lax.while_loop(unfinished, improve, first)

    held = jax.lax.stop_gradient(jnp.eye(4) if grasp is None else grasp)
    starts = jax.vmap(lambda turn: _start(turn, held, *fixed, grasp is None))
    ends = jax.vmap(fit)(*starts(jnp.asarray(_octahedral() if grasp is None else _ONE)))
    best = jax.tree.map(lambda x: x[jnp.argmin(ends.cost)], ends)
    return _result(errors, best, masters, slaves, grasp, weights, tolerance, throw)


def _result(
    errors, best: _State, masters, slaves, grasp, weights, tolerance, throw
) -> BaseRelation:
    """Derivatives, covariance and rank at the best fit."""
    relation, held = best.relation, best.grasp
    unknowns = 6 if grasp is not None else 12
    zero = jnp.zeros(unknowns, masters.dtype)
    slopes = jax.lax.stop_gradient(
        jax.jacfwd(errors)(zero, relation, held, masters, slaves)
    )
    # in one unit: a rotation of the unknowns counts by the size of the poses
    size = jax.lax.stop_gradient(
        jnp.sqrt(jnp.mean(jnp.sum(masters[:, :3, 3] ** 2, axis=1)))
    )
    unit = jnp.tile(
        jnp.repeat(jnp.stack([jnp.ones_like(size), 1 / (size + weights[3])]), 3), 2
    )
    values = jnp.linalg.svd(slopes * unit[None, :unknowns], compute_uv=False)
    rank = jnp.sum(values > tolerance * values[0])
    inverse = jnp.linalg.pinv(slopes)

    # derivative of the least-squares solution; the value of the change is zero
    known = held if grasp is None else grasp
    now = errors(zero, relation, known, masters, slaves)
    change = -inverse @ (now - jax.lax.stop_gradient(now))
    relation = relation @ transform_from_twist(change[:6])
    if grasp is None:
        known = known @ transform_from_twist(change[6:])

    samples = masters.shape[0]
    spare = max(6 * samples - unknowns, 1)
    spread = jnp.sum(now**2) / spare
    # at the least squares the Gauss-Newton correction vanishes
    converged = jnp.max(jnp.abs(inverse @ now)) <= 1e-8
    if throw:
        relation = eqx.branched_error_if(
            relation, rank < unknowns, rank, _messages(unknowns)
        )
        relation = eqx.error_if(
            relation,
            ~converged,
            "the corrections did not die out: raise `max_steps`, or look for poses "
            "that do not belong together",
        )
    return BaseRelation(
        relation,
        known,
        spread * inverse @ inverse.T,
        now.reshape(samples, 6) / weights[None],
        rank,
        converged,
    )


def _messages(unknowns: int) -> list[str]:
    return [
        f"the samples must determine all {unknowns} unknowns, but determine only "
        f"{rank}: measure at least three poses whose turns between each other are "
        "about two directions or more, or give the `grasp`"
        for rank in range(unknowns + 1)
    ]


def _start(turn, held, masters, slaves, grasp_is_free: bool):
    """Relation with a given rotation, and the grasp and position that suit it."""
    inner, outer = masters[:, :3, :3], slaves[:, :3, :3]
    if grasp_is_free:
        # mean of R_A^T X^T R_B over the samples
        mean = jnp.einsum("nji,kj,nkl->il", inner, turn, outer)
        held = transform(_nearest(mean), held[:3, 3])
    else:
        turn = _nearest(jnp.einsum("nij,kj,nlk->il", outer, held[:3, :3], inner))
    # positions: B_p = X_p + X_R (A_p + A_R G_p), linear in X_p and G_p
    ahead = slaves[:, :3, 3] - jnp.einsum("ij,nj->ni", turn, masters[:, :3, 3])
    lever = jnp.einsum("ij,njk->nik", turn, inner)
    ones = jnp.broadcast_to(jnp.eye(3), lever.shape)
    if grasp_is_free:
        rows = jnp.concatenate([ones, lever], axis=2).reshape(-1, 6)
        both = jnp.linalg.pinv(rows, rtol=1e-6) @ ahead.reshape(-1)
        return transform(turn, both[:3]), transform(held[:3, :3], both[3:])
    place = jnp.mean(ahead - jnp.einsum("nij,j->ni", lever, held[:3, 3]), axis=0)
    return transform(turn, place), held


def _nearest(matrix):
    """Rotation closest to a matrix."""
    u, _, vt = jnp.linalg.svd(matrix)
    sign = jnp.where(jnp.linalg.det(u @ vt) < 0, -1.0, 1.0)
    return (u * jnp.stack([jnp.ones_like(sign), jnp.ones_like(sign), sign])[None]) @ vt


_ONE = np.eye(3)[None]


def _octahedral() -> np.ndarray:
    """The 24 rotations of a cube: none is farther than 63 degrees from one of them."""
    found = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        for signs in np.ndindex(2, 2, 2):
            matrix = np.zeros((3, 3))
            matrix[np.arange(3), np.array(order)] = 1.0 - 2.0 * np.array(signs)
            if np.linalg.det(matrix) > 0:
                found.append(matrix)
    return np.stack(found)


def _check_samples(masters, slaves) -> None:
    if masters.shape != slaves.shape or masters.shape[0] == 0:
        raise ValueError(
            "`masters` and `slaves` must hold poses in pairs, at least one, but have "
            f"the shapes {masters.shape} and {slaves.shape}"
        )
    for name, poses in (("masters", masters), ("slaves", slaves)):
        if not is_concrete(poses):
            continue
        for k, pose in enumerate(np.asarray(poses)):
            try:
                check_transform(pose)
            except ValueError as error:
                raise ValueError(f"`{name}[{k}]`: {error}") from None
