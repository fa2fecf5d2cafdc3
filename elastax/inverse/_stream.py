"""Inverses sample by sample at the rate of a controller: compiled ahead of time."""

import time
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._custom_types import Scalar, require_float64
from ..dynamics import ElasticRobot, MotorSample
from ._base import AbstractInverse, check_model
from ._flat import FlatLayout


class StepProgram(NamedTuple):
    """`init` and `step` of an inverse as functions of flat vectors.

    Attributes:
        init: (parameters, sample, dt) -> state.
        step: (parameters, state, sample) -> (output, state).
        parameters, state, output: what the entries of the vectors are; the output is a
            `MotorSample`.
        rest: parts of inverse and model that are no arrays.
        shape: of a sample, (order + 1, axes).
    """

    init: Any
    step: Any
    parameters: FlatLayout
    state: FlatLayout
    output: FlatLayout
    rest: Any
    shape: tuple[int, int]


def step_program(inverse: AbstractInverse, model: ElasticRobot) -> StepProgram:
    """Programs with few arguments: calling one costs time for each.

    Raises:
        ValueError: JAX runs in single precision, or a part is complex.
    """
    require_float64(type(inverse).__name__)
    check_model(inverse, model)
    arrays, rest = _parts(inverse, model)
    parameters = FlatLayout.of(arrays)
    shape = (inverse.order(model) + 1, model.axes)
    vector = lambda layout: jax.ShapeDtypeStruct((layout.size,), jnp.float64)
    sample = jax.ShapeDtypeStruct(shape, jnp.float64)

    def start(parameters_now, sample, dt):
        both = eqx.combine(parameters.unpack(parameters_now), rest)
        return both["inverse"].init(both["model"], sample, dt)

    dt = jax.ShapeDtypeStruct((), jnp.float64)
    state = FlatLayout.of(jax.eval_shape(start, vector(parameters), sample, dt))

    def advance(parameters_now, state_now, sample):
        both = eqx.combine(parameters.unpack(parameters_now), rest)
        now = state.unpack(state_now)
        return both["inverse"].step(both["model"], now, sample)

    both = jax.eval_shape(advance, vector(parameters), vector(state), sample)
    output = FlatLayout.of(both[0])
    return StepProgram(
        lambda parameters, sample, dt: state.pack(start(parameters, sample, dt)),
        lambda *args: tuple(
            layout.pack(tree) for layout, tree in zip((output, state), advance(*args))
        ),
        parameters,
        state,
        output,
        rest,
        shape,
    )


def _parts(inverse: AbstractInverse, model: ElasticRobot) -> tuple[Any, Any]:
    """Arrays, and the rest, of inverse and model."""
    return eqx.partition({"inverse": inverse, "model": model}, eqx.is_array)


class StreamedInverse:
    """An inverse that keeps its state, one call a sample, as a controller needs it.

    NumPy arrays go in and come out. The programs are compiled at construction, once for
    a structure of robot and inverse: the values of their parameters may change with
    `update`. One object drives one robot; it is not to be shared by threads.

    Examples:
        >>> streamed = compile_step(ASIM(), robot, 1e-3)
        >>> streamed.init(samples[0])
        >>> for sample in samples:
        ...     motors = streamed(sample)  # motors.theta, motors.tau_m, ...
    """

    def __init__(
        self, inverse: AbstractInverse, model: ElasticRobot, dt: Scalar | float
    ):
        program = step_program(inverse, model)
        self._program, self._dt, self._state = program, np.float64(float(dt)), None
        self._parameters = self._packed(inverse, model)
        sample = np.zeros(program.shape)
        state = jax.ShapeDtypeStruct((program.state.size,), jnp.float64)
        # the one place of the library that compiles: this is what the class is for
        init = jax.jit(program.init).lower(self._parameters, sample, self._dt)
        step = jax.jit(program.step, donate_argnums=1)
        self._init = init.compile()
        self._step = step.lower(self._parameters, state, sample).compile()

    def init(self, sample: Any) -> None:
        """Start, or start again, at rest in a sample of shape (order + 1, axes)."""
        self._state = self._init(self._parameters, self._checked(sample), self._dt)

    def __call__(self, sample: Any) -> MotorSample:
        """Motor angles and torques for the next sample.

        The first call after `init` takes the first sample again.

        Args:
            sample: reference and derivatives, shape (order + 1, axes); more derivatives
                are left out.

        Raises:
            ValueError: wrong shape, or `init` was not called.
        """
        if self._state is None:
            raise ValueError("call `init` with the first sample before the first step")
        sample = self._checked(sample)
        output, self._state = self._step(self._parameters, self._state, sample)
        return self._program.output.views(np.asarray(output))

    def update(self, inverse: AbstractInverse, model: ElasticRobot) -> None:
        """Other parameter values from the next sample on, without compiling.

        Raises:
            ValueError: the structure differs: other joints, laws or counts.
        """
        self._parameters = self._packed(inverse, model)

    def _packed(self, inverse: AbstractInverse, model: ElasticRobot) -> jax.Array:
        program = self._program
        arrays, rest = _parts(inverse, model)
        if not (program.parameters.fits(arrays) and eqx.tree_equal(program.rest, rest)):
            raise ValueError(
                "inverse and model must have the structure that was compiled: call "
                "`compile_step` for another one"
            )
        return jax.device_put(program.parameters.numbers(arrays))

    def _checked(self, sample: Any) -> np.ndarray:
        terms, axes = self._program.shape
        array = np.asarray(sample, np.float64)[:terms]
        if array.shape != (terms, axes):
            raise ValueError(
                f"a sample must have the shape ({terms}, {axes}), the reference with "
                f"{terms - 1} derivatives, but has {np.shape(sample)}"
            )
        return array


def compile_step(
    inverse: AbstractInverse, model: ElasticRobot, dt: Scalar | float
) -> StreamedInverse:
    """Compile an inverse for streaming, ahead of the first sample.

    Args:
        inverse: the feed-forward.
        model: the robot as the inverse knows it.
        dt: time between samples [s].

    Raises:
        ValueError: JAX runs in single precision.
    """
    return StreamedInverse(inverse, model, dt)


class Latency(NamedTuple):
    """Time of single steps [s].

    Attributes:
        p50, p99, p999: median, 99th and 99.9th percentile.
        largest: of all.
        calls: how many were measured.
    """

    p50: float
    p99: float
    p999: float
    largest: float
    calls: int


def latency(streamed: StreamedInverse, samples: Any, calls: int = 10_000) -> Latency:
    """Time from a sample to its motor torques, as the caller sees it.

    The motion is repeated from its start as often as needed; a few calls before are not
    counted.

    Args:
        streamed: the inverse.
        samples: a motion, shape (times, order + 1, axes).
        calls: how many steps to time.
    """
    samples, times = np.asarray(samples, np.float64), []
    streamed.init(samples[0])
    for sample in samples[:50]:
        streamed(sample)
    while len(times) < calls:
        streamed.init(samples[0])
        for sample in samples[: calls - len(times)]:
            start = time.perf_counter()
            streamed(sample)
            times.append(time.perf_counter() - start)
    p50, p99, p999 = (float(x) for x in np.quantile(times, [0.5, 0.99, 0.999]))
    return Latency(p50, p99, p999, max(times), calls)
