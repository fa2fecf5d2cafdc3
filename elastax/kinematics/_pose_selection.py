"""Choice of the poses of an experiment, so that parameters are determined well."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._custom_types import Scalar, require_float64
from ._instruments import AbstractInstrument
from ._observability import AbstractObservability, ProductIndex, reading_jacobian
from ._parameters import ChainParameters


class PoseSelection(eqx.Module):
    """Poses chosen from candidates.

    Attributes:
        indices: of the chosen candidates, ascending, shape (number,).
        q: their joint coordinates [rad] or [m], shape (number, joints).
        index: observability index of the choice.
        random_index: of the best random choice, with which the exchange began.
        exchanges: number of poses that were exchanged.
    """

    indices: Int[Array, " number"]
    q: Float[Array, "number joints"]
    index: Scalar
    random_index: Scalar
    exchanges: Int[Array, ""]


class _State(NamedTuple):
    chosen: Bool[Array, " candidates"]
    improving: Bool[Array, ""]
    exchanges: Int[Array, ""]


def select_poses(
    parameters: ChainParameters,
    instrument: AbstractInstrument,
    candidates: Float[Array, "candidates joints"],
    number: int,
    *,
    key: Array,
    index: AbstractObservability = ProductIndex(),
    characteristic_length: Scalar | float = 1.0,
    random_choices: int = 32,
    max_exchanges: int = 200,
) -> PoseSelection:
    """Candidate poses at which readings determine the parameters best.

    Begins with the best of some random choices. Then, as in Mitchell's DETMAX, the
    candidate that adds most is taken in and the pose that is missed least left out,
    until these are the same. The result is a local optimum, never worse than the random
    choices. All candidates are evaluated at once; call it under `jax.jit`.

    Args:
        parameters: that are sought; those that no candidates determine make every
            choice worthless, see `identifiability`.
        instrument: what is read at each pose.
        candidates: joint coordinates [rad] or [m], such as `random_joints` within the
            limits of an arm, without those that collide.
        number: poses to choose.
        key: of the random choices.
        index: what is maximised; `ProductIndex` makes the experiment D-optimal.
        characteristic_length: the length that counts as much as 1 rad [m].
        random_choices: to begin with.
        max_exchanges: largest number of exchanges.

    Raises:
        ValueError: more poses asked for than there are candidates, or too few for the
            number of parameters.

    References:
        [Mitchell1974]; [Borm1991] for the use in calibrations.
    """
    require_float64("a choice of poses")
    count = candidates.shape[0]
    jacobian = lambda q: reading_jacobian(
        parameters, instrument, q, characteristic_length
    )
    channels, _ = jax.eval_shape(jacobian, candidates[0]).shape
    _check_number(number, count, channels, parameters.number)
    rows = jax.vmap(jacobian)(candidates)
    information = jnp.einsum("kia,kib->kab", rows, rows)
    information = _determined(information)
    informed = lambda weight: jnp.einsum("k,kab->ab", weight, information)

    def value(matrix, poses):
        squares = jnp.linalg.eigvalsh(matrix)
        return index.index(jnp.sqrt(jnp.maximum(squares, 0.0)), poses)

    def choice(key):
        order = jax.random.permutation(key, count)
        return jnp.zeros((count,), bool).at[order[:number]].set(True)

    def exchange(state: _State) -> _State:
        chosen = state.chosen
        total = informed(chosen.astype(information.dtype))
        added = jax.vmap(lambda one: value(total + one, number + 1))(information)
        enters = jnp.argmax(jnp.where(chosen, -jnp.inf, added))
        larger = chosen.at[enters].set(True)
        total = informed(larger.astype(information.dtype))
        # what is left without each one; subtraction is exact enough here, because only
        # the comparison below decides
        left = jax.vmap(lambda one: value(total - one, number))(information)
        leaves = jnp.argmax(jnp.where(larger, left, -jnp.inf))
        # rounding must not exchange the same two poses for ever
        better = left[leaves] > left[enters] * (1 + 1e-12)
        chosen = jnp.where(better, larger.at[leaves].set(False), chosen)
        return _State(chosen, better, state.exchanges + jnp.where(better, 1, 0))

    starts = jax.vmap(choice)(jax.random.split(key, random_choices))
    weights = starts.astype(information.dtype)
    values = jax.vmap(lambda weight: value(informed(weight), number))(weights)
    best = jnp.argmax(values)
    state = jax.lax.while_loop(
        lambda state: state.improving & (state.exchanges < max_exchanges),
        exchange,
        _State(starts[best], jnp.array(True), jnp.array(0)),
    )
    (indices,) = jnp.nonzero(state.chosen, size=number)
    final = value(informed(state.chosen.astype(information.dtype)), number)
    return PoseSelection(
        indices, candidates[indices], final, values[best], state.exchanges
    )


def _check_number(number: int, count: int, channels: int, parameters: int) -> None:
    if not 0 < number <= count:
        raise ValueError(
            f"`number` must be from 1 to the {count} candidates, but is {number}"
        )
    if number * channels < parameters:
        raise ValueError(
            f"{parameters} parameters need as many readings at least, but {number} "
            f"poses give {number * channels}"
        )


def _determined(information):
    """`information`, with an error where all candidates together lack some."""
    total = jnp.sum(information, axis=0)
    lengths = jnp.sqrt(jnp.diagonal(total))
    absent = lengths <= 1e-12 * jnp.max(lengths)
    safe = jnp.where(absent, 1.0, lengths)
    least = jnp.linalg.eigvalsh(total / (safe[:, None] * safe[None, :]))[0]
    # columns of length one: rounding leaves less than this of a dependent one
    return eqx.error_if(
        information,
        jnp.any(absent) | (least < 1e-13),
        "the candidates cannot tell the parameters apart: see `identifiability`",
    )
