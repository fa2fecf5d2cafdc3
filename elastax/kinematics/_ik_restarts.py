r"""Inverse kinematics from many starts: any arm, within its limits.

Each start is a projected Levenberg-Marquardt iteration: the damping falls with the
error, joints at a limit that the error pushes outwards rest, corrections are limited by
a common factor. A start that makes too little progress is given up for the next one.
The whole search of one target is a single loop over one kernel; under `jax.vmap` the
targets are searched one after another on a processor, each for as long as it needs, and
side by side elsewhere.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._checks import check_fields, check_values
from .._custom_types import PerJoint, Scalar, Transform, as_real, require_float64
from .._kernel import kernel
from ._arm import Arm
from ._chain import SerialChain
from ._ik_dls import check_indices, damped_least_squares, row_weights
from ._ik_evaluate import attached, errors_of, evaluate, without_base
from ._joints import JointKind
from ._starts import low_discrepancy


_FLOOR = 1e-12  # of the squared damping over the square of the characteristic length


class SearchResults(eqx.Enumeration):
    """How a search from many starts ended."""

    successful = ""
    not_found = (
        "no start reached `target` within the limits: raise `starts`, widen the limits "
        "of the arm, or move `target`, which may be out of reach"
    )


class FoundPose(eqx.Module):
    """Outcome of a search from many starts.

    Attributes:
        value: joint coordinates within the limits [rad] or [m], shape (joints,); those
            of the smallest error if the pose was not reached.
        result: `SearchResults.successful`, or why not.
        position_error: distance of the tool from the target [m].
        rotation_error: angle between tool and target [rad].
        starts: number of starts used.
        steps: number of corrections made, all starts together.
    """

    value: PerJoint
    result: SearchResults
    position_error: Scalar
    rotation_error: Scalar
    starts: Int[Array, ""]
    steps: Int[Array, ""]

    @property
    def reached(self) -> Bool[Array, "*batch"]:
        """Whether the pose was reached: the mask of a batch."""
        return self.result == SearchResults.successful


class PoseSearch(eqx.Module):
    r"""How every start of a search proceeds.

    The damping is $\lambda^2 = g\,|e|^2$ of the weighted error e, so that it vanishes
    at the solution, singular or not. A start is given up when $|e|^2$ exceeds
    $s\,p^k\,|e_0|^2$ after k corrections, or after `max_steps` of them.

    Attributes:
        gain: g > 0.
        largest_step: largest correction of a joint [rad] or [m].
        progress: p in (0, 1].
        slack: s >= 1.
        max_steps: of one start.

    References:
        [Sugihara2011] for the damping, without its constant bias; [Reiner2010] (3.58),
        with one factor for all joints.
    """

    gain: Scalar = eqx.field(converter=as_real, default=1e-2)
    largest_step: Scalar = eqx.field(converter=as_real, default=1.0)
    progress: Scalar = eqx.field(converter=as_real, default=0.6)
    slack: Scalar = eqx.field(converter=as_real, default=30.0)
    max_steps: Scalar = eqx.field(converter=as_real, default=40.0)

    def __check_init__(self):
        check_fields(self)
        for name in ("gain", "largest_step", "max_steps"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)
        inside = (self.progress > 0) & (self.progress <= 1)
        check_values("`progress` must be in (0, 1]", self.progress, inside)
        check_values("`slack` must be 1 or more", self.slack, self.slack >= 1)


class _Lane(eqx.Module):
    """State of the search of one target.

    Attributes:
        q: posture to evaluate.
        best, distance, angle, square: posture of the smallest error so far, its errors
            and its squared weighted error.
        allowed: squared error up to which the start goes on.
        steps, total, start: corrections of this start and of all, number of this start.
        reached: 1 once the target is reached.
    """

    q: PerJoint
    best: PerJoint
    distance: Scalar
    angle: Scalar
    square: Scalar
    allowed: Scalar
    steps: Scalar
    total: Scalar
    start: Scalar
    reached: Scalar

    def packed(self) -> Float[Array, " state"]:
        scalars = jnp.stack(
            [
                self.distance,
                self.angle,
                self.square,
                self.allowed,
                self.steps,
                self.total,
                self.start,
                self.reached,
            ]
        )
        return jnp.concatenate([self.q, self.best, scalars])

    @staticmethod
    def unpacked(state: Float[Array, " state"]) -> "_Lane":
        n = (state.shape[0] - 8) // 2
        return _Lane(state[:n], state[n : 2 * n], *state[2 * n :])


def find_pose(
    arm: Arm,
    target: Transform,
    q: PerJoint | None = None,
    *,
    search: PoseSearch | None = None,
    starts: int = 32,
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5),
    characteristic_length: Scalar | float = 1.0,
    position_tolerance: Scalar | float = 1e-6,
    rotation_tolerance: Scalar | float = 1e-6,
    throw: bool = True,
) -> FoundPose:
    """Joint coordinates within the limits at which the tool has a pose, from any start.

    The starts are a low-discrepancy sequence within the limits, the same for every
    target; `q` goes first if given. Whole turns do not count while a revolute joint is
    searched: its range is one turn about the middle of its limits.

    The solution is differentiable with respect to the chain and `target` by the
    implicit function theorem, for a redundant arm with the smallest change of the
    joints; starts and limits have no derivative. Call it under `jax.jit`, a batch under
    `jax.vmap` in it, and `over_devices` to use all cores.

    Args:
        arm: chain and limits.
        target: pose of the tool in the base frame, shape (4, 4) [m].
        q: first start [rad] or [m], shape (joints,); the result is then the one of all
            equivalent turns that is nearest to it within the limits.
        search: how every start proceeds.
        starts: largest number of starts.
        rows: rows of the pose that count; (0, 1, 2) leaves the orientation free.
        characteristic_length: length that turns 1 rad into a distance [m].
        position_tolerance: largest distance in the rows that count [m].
        rotation_tolerance: largest angle in the rows that count [rad].
        throw: raise an error if the pose is not reached; otherwise see `result`.

    Raises:
        ValueError: `starts` is not positive, `rows` are not distinct indices, or JAX
            runs in single precision.

    References:
        [Berns] "Optimierung: Algorithmus"; [KinModell] (3-43), (3-44); [Reiner2010]
        (3.63b).
    """
    require_float64("the search of a pose")
    if starts < 1:
        raise ValueError(f"`starts` must be 1 or more, but is {starts}")
    check_indices("rows", rows, 6)
    search = PoseSearch() if search is None else search
    numbers = (characteristic_length, position_tolerance, rotation_tolerance)
    length, *tolerances = (as_real(x) for x in numbers)
    fixed, wanted, given = jax.lax.stop_gradient((arm, target, q))
    chain, wanted = without_base(fixed.chain, wanted)
    limits = jnp.stack([fixed.lower, fixed.upper])
    counted = as_real(np.isin(np.arange(6), rows))
    settings = (search, length, *tolerances, counted, as_real(starts))
    settings = jax.lax.stop_gradient(settings)
    first = _start(chain, limits, jnp.zeros(())) if given is None else given
    lane = _Lane.unpacked(_searched(chain, wanted, first, limits, settings))

    value = lane.best
    if given is not None:
        value = _nearest_turn(chain, limits, value, given)
    value = attached(rows, arm.chain, target, value, row_weights(length, rows))
    reached = lane.reached > 0
    result = SearchResults.where(
        reached, SearchResults.successful, SearchResults.not_found
    )
    if throw:
        value = result.error_if(value, ~reached)
    whole = lambda x: x.astype(int)
    return FoundPose(
        value,
        result,
        lane.distance,
        lane.angle,
        whole(lane.start) + 1,
        whole(lane.total),
    )


def _search(chain, target, q, limits, settings) -> Float[Array, " state"]:
    """Final state of the search of one target."""
    *_, starts = settings
    zero = jnp.zeros_like(starts)
    far = jnp.full_like(starts, jnp.inf)
    q = _within(chain, limits, q)
    lane = _Lane(q, q, far, far, far, far, zero, zero, zero, zero)

    def unfinished(state):
        # reached, or the number of the start
        return (state[-1] < 1) & (state[-2] < starts)

    def advance(state):
        return _advance(chain, target, limits, settings, state)

    state = jax.lax.while_loop(unfinished, advance, lane.packed())
    # a search that fails counts one start too many
    return state.at[-2].min(starts - 1)


@jax.custom_batching.custom_vmap
def _searched(chain, target, q, limits, settings):
    return _search(chain, target, q, limits, settings)


@_searched.def_vmap
def _searched_batch(size, is_batched, *args):
    leaves, structure = jax.tree.flatten(args)
    flags = jax.tree.leaves(is_batched)

    def filled(function):
        def one(moving):
            rest = iter(moving)
            own = [next(rest) if m else x for m, x in zip(flags, leaves)]
            return function(*jax.tree.unflatten(structure, own))

        return one

    # one loop over all targets, whose kernel is straight-line code anyway, wastes no
    # step on those that are found; many threads want them side by side
    one_after_another = lambda *moving: jax.lax.map(filled(_searched), moving)
    side_by_side = lambda *moving: jax.vmap(filled(_search))(moving)
    moving = [x for m, x in zip(flags, leaves) if m]
    found = jax.lax.platform_dependent(
        *moving, cpu=one_after_another, default=side_by_side
    )
    return found, True


@kernel
def _advance(chain, target, limits, settings, state) -> Float[Array, " state"]:
    """Evaluate a posture: reached, corrected, or given up for the next start."""
    search, length, position_tolerance, rotation_tolerance, counted, _ = settings
    lane, weights = _Lane.unpacked(state), counted * row_weights(length)
    number = lambda condition: jnp.where(condition, 1.0, 0.0)
    still = SerialChain(chain.joints, np.eye(4), chain.tool, chain.kinds)
    matrix, difference = evaluate(still, target, lane.q)
    difference = counted * difference
    distance, angle = errors_of(difference)
    reached = (distance <= position_tolerance) & (angle <= rotation_tolerance)
    matrix, error = weights[:, None] * matrix, weights * difference
    square = error @ error
    better = (square < lane.square) | reached

    # joints at a limit rest while the error pushes them outwards
    push = error @ matrix
    at_lower = (lane.q <= limits[0]) & (push < 0)
    at_upper = (lane.q >= limits[1]) & (push > 0)
    matrix = jnp.where((at_lower | at_upper)[None], 0.0, matrix)
    damping = jnp.sqrt(search.gain * square + _FLOOR * length**2)
    step = damped_least_squares(matrix, error, damping)
    step = step / jnp.maximum(1.0, jnp.max(jnp.abs(step)) / search.largest_step)

    allowed = jnp.where(lane.steps < 1, search.slack * square, lane.allowed)
    given_up = (square > allowed) | (lane.steps >= search.max_steps)
    next_start = _start(chain, limits, lane.start + 1)
    corrected = _within(chain, limits, lane.q + step)
    return _Lane(
        q=jnp.where(given_up, next_start, corrected),
        best=jnp.where(better, lane.q, lane.best),
        distance=jnp.where(better, distance, lane.distance),
        angle=jnp.where(better, angle, lane.angle),
        square=jnp.where(better, square, lane.square),
        allowed=search.progress * allowed,
        steps=jnp.where(given_up, 0.0, lane.steps + 1),
        total=lane.total + number(~(given_up | reached)),
        start=lane.start + number(given_up & ~reached),
        reached=number(reached),
    ).packed()


def _middle_and_span(chain, limits):
    """Middle of the limits and the part of them, about it, that is searched."""
    span = limits[1] - limits[0]
    turning = _turning(chain)
    return (limits[0] + limits[1]) / 2, jnp.where(
        turning, jnp.minimum(span, 2 * np.pi), span
    )


def _turning(chain) -> np.ndarray:
    return np.array([kind is JointKind.REVOLUTE for kind in chain.kinds])


def _within(chain, limits, q):
    """`q` less whole turns, then moved to the nearest limit."""
    middle, _ = _middle_and_span(chain, limits)
    turns = jnp.floor((q - middle) / (2 * np.pi) + 0.5)
    q = jnp.where(_turning(chain), q - 2 * np.pi * turns, q)
    return jnp.clip(q, limits[0], limits[1])


def _nearest_turn(chain, limits, q, near):
    """`q` plus the whole turns that bring it next to `near` within the limits."""
    turn = jnp.where(_turning(chain), 2 * np.pi, jnp.inf)
    turns = jnp.clip(
        jnp.round((near - q) / turn),
        jnp.ceil((limits[0] - q) / turn),
        jnp.floor((limits[1] - q) / turn),
    )
    moved = q + jnp.where(_turning(chain), 2 * np.pi * turns, 0.0)
    return jnp.clip(moved, limits[0], limits[1])


def _start(chain, limits, number):
    """Posture `number` of a low-discrepancy sequence within the limits."""
    middle, span = _middle_and_span(chain, limits)
    return middle + (low_discrepancy(chain.number, number + 1) - 0.5) * span
