"""Inverses of linear systems: exact, on the zero dynamics, and by high gain."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._custom_types import Scalar
from ._linear_model import LinearModel, SignalNames
from ._markov import linear_relative_degree


def inverse_model(model: LinearModel) -> LinearModel:
    r"""Exact inverse of a square system, with the zero dynamics as its states.

    Its poles are the zeros of the system: with a zero in the right half-plane the
    inverse is unstable. Its inputs are every output with its derivatives up to the
    relative degree, y1, y1', ..., y2, ...: a proper system has no inverse that does
    without them, or without a filter of that order. (The text asks for $d_G \ge 0$;
    what holds is that only $d_G = 0$ needs no derivatives.)

    Args:
        model: as many inputs as outputs, and a regular decoupling matrix.

    Raises:
        ValueError: another number of outputs than inputs, or a singular decoupling
            matrix.

    References:
        [Reiner2010] (3.1), (3.2), section 3.1; the normal form of section 3.2 for a
        linear system.
    """
    A, B, C, D = (np.asarray(x) for x in (model.A, model.B, model.C, model.D))
    degrees, decoupling = linear_relative_degree(model)
    check_square(len(model.names.inputs), len(model.names.outputs))
    check_decoupling(decoupling, degrees)
    rows, drift, names = [], [], []
    for i, degree in enumerate(degrees):
        c = C[i]
        for _ in range(degree):
            rows.append(c)
            c = c @ A
        drift.append(c)
        names += [model.names.outputs[i] + "'" * k for k in range(degree + 1)]
    seen = np.array(rows).reshape(-1, len(A))
    feedback = np.linalg.solve(decoupling, np.array(drift))
    entry = np.linalg.inv(decoupling)
    closed, forced = A - B @ feedback, B @ entry
    hidden = np.linalg.svd(seen)[2][len(seen) :] if len(seen) else np.eye(len(A))
    back = np.linalg.inv(np.concatenate([seen, hidden]))
    by_output, by_state = back[:, : len(seen)], back[:, len(seen) :]
    # columns in the order of the names: derivatives below the degree, then the last
    order = np.argsort(_places(degrees), kind="stable")
    B_i = np.concatenate([hidden @ closed @ by_output, hidden @ forced], axis=1)
    D_i = np.concatenate([-feedback @ by_output, entry], axis=1)
    states = tuple(f"z{k + 1}" for k in range(len(hidden)))
    return LinearModel(
        hidden @ closed @ by_state,
        B_i[:, order],
        -feedback @ by_state,
        D_i[:, order],
        SignalNames(states, tuple(names), model.names.inputs),
    )


def _places(degrees: tuple[int, ...]) -> list[int]:
    """Output of every column: derivatives below the degrees, then the highest."""
    lower = [i for i, degree in enumerate(degrees) for _ in range(degree)]
    return lower + list(range(len(degrees)))


def check_square(inputs: int, outputs: int) -> None:
    """Refuse systems whose outputs cannot be set one by one."""
    if inputs != outputs:
        raise ValueError(
            f"an inverse needs as many outputs as inputs, but there are {outputs} "
            f"outputs and {inputs} inputs: choose {min(inputs, outputs)} of each"
        )


def check_decoupling(matrix: np.ndarray, degrees) -> None:
    """Refuse singular decoupling matrices."""
    values = np.linalg.svd(np.asarray(matrix), compute_uv=False)
    if len(values) and values[-1] <= 1e-10 * values[0]:
        raise ValueError(
            f"the decoupling matrix of the degrees {tuple(degrees)} is singular "
            f"(singular values {values[0]:.3g} to {values[-1]:.3g}): there is no "
            "relative degree; choose other outputs or another operating point"
        )


def high_gain_inverse(model: LinearModel, gain) -> LinearModel:
    r"""Approximate inverse by feedback of the output, $k / (1 + k G)$.

    Args:
        model: one input and one output.
        gain: k of the feedback; the larger, the closer to the inverse and the worse
            conditioned.

    References:
        [Reiner2010] (3.3a). See `high_gain_condition` for when it is stable.
    """
    _check_single(model)
    k = jnp.asarray(gain, model.A.dtype)
    A, B, C, D = model.A, model.B, model.C, model.D
    # u = k (w - y), y = C x + D u
    factor = k / (1.0 + k * D[0, 0])
    names = SignalNames(model.names.states, model.names.outputs, model.names.inputs)
    return LinearModel(
        A - factor * (B @ C), factor * B, -factor * C, factor[None, None], names
    )


class HighGainCondition(eqx.Module):
    """Whether the high-gain inverse is stable for every gain that is large enough.

    Attributes:
        degree: differential degree d_G.
        high_frequency_gain: k of (3.1), which fixes the sign of the feedback.
        right_zeros: number of zeros in the closed right half-plane.
        centroid: where the asymptotes of the poles meet [1/s]; counts for d_G = 2.
    """

    high_frequency_gain: Scalar
    centroid: Scalar
    degree: int = eqx.field(static=True)
    right_zeros: int = eqx.field(static=True)

    @property
    def holds(self) -> bool:
        """Stable for all large positive gains."""
        if self.right_zeros or float(self.high_frequency_gain) <= 0:
            return False
        if self.degree == 2:
            return float(self.centroid) < 0
        return self.degree < 2

    @property
    def reason(self) -> str:
        """In one line, what decides."""
        if self.right_zeros:
            return f"{self.right_zeros} zeros do not lie in the left half-plane"
        if float(self.high_frequency_gain) <= 0:
            return "the high-frequency gain is negative: turn the sign of the output"
        if self.degree > 2:
            return (
                f"{self.degree} poles go to infinity along {self.degree} asymptotes, "
                "some of them to the right"
            )
        if self.degree == 2:
            where = float(self.centroid)
            return f"two poles go to infinity along Re s = {where:.4g} 1/s"
        return "all poles go to the zeros or along the negative real axis"


def high_gain_condition(model: LinearModel) -> HighGainCondition:
    r"""Condition under which $k / (1 + k G)$ is stable as k grows.

    The text has none: the d_G poles that do not end in zeros go to infinity along
    asymptotes. For $G = 1/(s+1)^3$ without any zero the inverse is unstable.

    Args:
        model: one input and one output.

    References:
        [Reiner2010] (3.3b), with the condition that is missing there; root locus
        [Evans1950].
    """
    _check_single(model)
    (degree,), decoupling = linear_relative_degree(model)
    zeros = model.zeros()
    poles = np.asarray(model.poles())
    centroid = (np.real(poles).sum() - np.real(zeros).sum()) / max(degree, 1)
    return HighGainCondition(
        high_frequency_gain=jnp.asarray(float(decoupling[0, 0])),
        centroid=jnp.asarray(centroid),
        degree=degree,
        right_zeros=int(np.sum(np.real(zeros) >= 0)),
    )


def _check_single(model: LinearModel) -> None:
    counts = dataclasses.astuple(model.names)[1:]
    if tuple(map(len, counts)) != (1, 1):
        raise ValueError(
            "the high-gain inverse needs one input and one output, but there are "
            f"{len(counts[0])} and {len(counts[1])}: take a `channel`"
        )
