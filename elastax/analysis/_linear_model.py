"""Linear state-space models: poles, zeros, frequency response, exchange."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from .._checks import check_fields, is_concrete
from .._custom_types import as_real, require_float64
from ._markov import linear_relative_degree
from ._minimal import minimal_matrices
from ._modes import Modes, modes_of
from ._zero_structure import ZeroStructure, zero_structure


@dataclasses.dataclass(frozen=True)
class SignalNames:
    """Names of states, inputs and outputs, with units."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @staticmethod
    def numbered(states: int, inputs: int, outputs: int) -> "SignalNames":
        """x1, x2, ..., u1, ..., y1, ..."""
        many = lambda letter, n: tuple(f"{letter}{k + 1}" for k in range(n))
        return SignalNames(many("x", states), many("u", inputs), many("y", outputs))


class OperatingPoint(eqx.Module):
    """Where a model was linearised.

    Attributes:
        x, u, y: state, input and output there.
        rate: of the state; zero at an equilibrium.
    """

    x: Float[Array, " states"]
    u: Float[Array, " inputs"]
    y: Float[Array, " outputs"]
    rate: Float[Array, " states"]


class LinearModel(eqx.Module):
    r"""$\dot x = A x + B u$, $y = C x + D u$, in deviations from an operating point.

    Attributes:
        A: shape (states, states).
        B: shape (states, inputs).
        C: shape (outputs, states).
        D: shape (outputs, inputs); zeros unless given.
        names: of states, inputs and outputs; numbered unless given.
        operating_point: where it was linearised, or `None`.

    Raises:
        ValueError: shapes do not fit, names are too few or too many, values are not
            finite, or JAX runs in single precision.

    References:
        [Reiner2010] (3.1), (3.38); (3.39) with the transpose of C.

    Examples:
        >>> A, B, C = [[0.0, 1.0], [-4.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]]
        >>> model = LinearModel(A, B, C)
        >>> model.poles(), model.zeros()
    """

    A: Float[Array, "states states"] = eqx.field(converter=as_real)
    B: Float[Array, "states inputs"] = eqx.field(converter=as_real)
    C: Float[Array, "outputs states"] = eqx.field(converter=as_real)
    D: Float[Array, "outputs inputs"] = eqx.field(converter=as_real)
    names: SignalNames = eqx.field(static=True)
    operating_point: OperatingPoint | None = None

    def __init__(self, A, B, C, D=None, names=None, operating_point=None):
        require_float64("a linear model")
        self.A, self.B, self.C = as_real(A), as_real(B), as_real(C)
        if self.B.ndim != 2 or self.C.ndim != 2:
            raise ValueError(
                "`B` must be (states, inputs) and `C` (outputs, states), but are "
                f"{self.B.shape} and {self.C.shape}"
            )
        outputs, inputs = self.C.shape[0], self.B.shape[1]
        self.D = jnp.zeros((outputs, inputs)) if D is None else as_real(D)
        counts = self.A.shape[0], inputs, outputs
        self.names = SignalNames.numbered(*counts) if names is None else names
        self.operating_point = operating_point
        check_fields(self)
        for key, count in zip(("states", "inputs", "outputs"), counts):
            given = getattr(self.names, key)
            if len(given) != count:
                raise ValueError(
                    f"`names.{key}` must be {count} names, but are {len(given)}: "
                    f"{given}"
                )
        for key in "ABCD":
            value = getattr(self, key)
            if is_concrete(value) and not np.isfinite(np.asarray(value)).all():
                raise ValueError(f"`{key}` must be finite, but holds NaN or infinity")

    def poles(self) -> Complex[Array, " states"]:
        """Eigenvalues of A [1/s], sorted by real part; jittable."""
        values = jnp.linalg.eigvals(self.A)
        return values[jnp.lexsort((values.imag, values.real))]

    def modes(self) -> Modes:
        """Frequencies, damping ratios and participation of the states."""
        return modes_of(self.A)

    def zeros(self, *, tolerance: float | None = None) -> np.ndarray:
        """Invariant zeros [1/s], sorted by real part; on the host.

        Those of the system matrix, whatever cancels in the transfer matrix. For square
        systems under `jit`, and for derivatives, see `transmission_zeros`.

        Args:
            tolerance: of ranks, as for `zero_structure`.
        """
        return self.zero_structure(tolerance=tolerance).finite

    def transmission_zeros(self, *, tolerance: float | None = None) -> np.ndarray:
        """Zeros of the minimal realisation [1/s]: what cancels is left out."""
        return self.minimal(tolerance=tolerance).zeros(tolerance=tolerance)

    def zero_structure(self, *, tolerance: float | None = None) -> ZeroStructure:
        """Finite and infinite zeros, normal rank, and how clear the ranks were."""
        return zero_structure(self.A, self.B, self.C, self.D, tolerance=tolerance)

    def relative_degree(self) -> tuple[int, ...]:
        """Of every output: how often it is differentiated until an input appears.

        For one input and one output the differential degree d_G.

        Raises:
            ValueError: no input reaches an output.

        References:
            [Reiner2010] (3.2), (3.5), (3.15).
        """
        return linear_relative_degree(self)[0]

    def decoupling(self) -> np.ndarray:
        r"""Matrix of the rows $c_i A^{r_i - 1} B$, or $d_i$ for $r_i = 0$; (3.16)."""
        return linear_relative_degree(self)[1]

    def static_gain(self) -> Float[Array, "outputs inputs"]:
        """Transfer matrix at s = 0; infinite with an integrator."""
        return self.D - self.C @ jnp.linalg.solve(self.A, self.B)

    def frequency_response(self, omega) -> Complex[Array, "frequencies outputs inputs"]:
        r"""$C (i\omega - A)^{-1} B + D$ at angular frequencies [rad/s]."""
        omega = jnp.asarray(omega, self.A.dtype)
        return self.transfer(jax.lax.complex(jnp.zeros_like(omega), omega))

    def transfer(self, s) -> Complex[Array, "points outputs inputs"]:
        """Transfer matrix at points of the complex plane [1/s], (3.39)."""
        kind = jnp.zeros((), complex).dtype
        s = jnp.atleast_1d(jnp.asarray(s, kind))
        A, B, C, D = (x.astype(kind) for x in (self.A, self.B, self.C, self.D))
        identity = jnp.eye(A.shape[0], dtype=kind)
        return jax.vmap(lambda s: C @ jnp.linalg.solve(s * identity - A, B) + D)(s)

    def minimal(self, *, tolerance: float | None = None) -> "LinearModel":
        """Minimal realisation, in states of its own; on the host."""
        A, B, C, columns = minimal_matrices(
            self.A, self.B, self.C, self.D, tolerance=tolerance
        )
        states = SignalNames.numbered(columns.shape[1], 0, 0).states
        names = dataclasses.replace(self.names, states=states)
        return LinearModel(A, B, C, self.D, names)

    def channel(self, inputs, outputs) -> "LinearModel":
        """The model with some of its inputs and outputs, by name or index."""
        columns = [_index(x, self.names.inputs, "input") for x in inputs]
        rows = [_index(x, self.names.outputs, "output") for x in outputs]
        names = SignalNames(
            self.names.states,
            tuple(self.names.inputs[k] for k in columns),
            tuple(self.names.outputs[k] for k in rows),
        )
        i, o = np.array(columns, int), np.array(rows, int)
        point = self.operating_point
        if point is not None:
            point = OperatingPoint(point.x, point.u[i], point.y[o], point.rate)
        D = self.D[o[:, None], i[None]]
        return LinearModel(self.A, self.B[:, i], self.C[o], D, names, point)

    def to_scipy(self) -> Any:
        """The same as `scipy.signal.StateSpace`, without names."""
        import scipy.signal

        return scipy.signal.StateSpace(*map(np.asarray, self._matrices()))

    def to_control(self) -> Any:
        """The same as `control.StateSpace`, with names; needs the extra `control`."""
        try:
            import control
        except ImportError:
            raise ImportError(
                "python-control is missing: `pip install elastax[control]`"
            ) from None
        return control.ss(
            *map(np.asarray, self._matrices()),
            states=list(self.names.states),
            inputs=list(self.names.inputs),
            outputs=list(self.names.outputs),
        )

    def _matrices(self):
        return self.A, self.B, self.C, self.D


def linear_model_of(system: Any) -> LinearModel:
    """The `LinearModel` of a system of python-control or scipy.

    Args:
        system: in continuous time: `control.StateSpace`, `control.TransferFunction`
            (converted by python-control), or one of `scipy.signal`'s `lti` classes.

    Raises:
        ValueError: a system in discrete time.
    """
    if getattr(system, "dt", None) not in (None, 0, 0.0):
        raise ValueError(
            f"the system must be in continuous time, but has a step of {system.dt}"
        )
    names = None
    if hasattr(system, "to_ss"):
        system = system.to_ss()
    elif not hasattr(system, "A"):
        import control

        system = control.ss(system)
    if hasattr(system, "state_labels"):
        names = SignalNames(
            tuple(system.state_labels),
            tuple(system.input_labels),
            tuple(system.output_labels),
        )
    matrices = (np.asarray(x, float) for x in (system.A, system.B, system.C, system.D))
    return LinearModel(*matrices, names=names)


def _index(key, names: tuple[str, ...], kind: str) -> int:
    if isinstance(key, str):
        if key not in names:
            raise ValueError(
                f"there is no {kind} `{key}`; there are {', '.join(names)}"
            )
        return names.index(key)
    if not -len(names) <= key < len(names):
        raise ValueError(f"there is no {kind} {key}; there are {len(names)}")
    return range(len(names))[key]
