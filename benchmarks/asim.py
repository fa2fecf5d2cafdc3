"""What does the structurally elastic feed-forward cost, offline and sample by sample?

ASIM on the KR210, 1 s at 1 kHz. The reference route is the other one: the streamed
steps for the offline computation, and the offline computation for the steps. Steps run
as `docs/speed.md` says a controller runs them: in the calling thread, on a core of
their own, without garbage collection.
"""

import gc
import time
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import MotorCommand
from elastax.inverse import (
    ASIM,
    AbstractInverse,
    FlexibleJointInverse,
    RigidInverse,
    compile_step,
    feedforward_by_steps,
    latency,
)
from elastax.robots import kr210

from ._rows import Check, relative_difference, row
from ._systems import DT, swing
from ._timing import Effort, compile_timed, measure


SAMPLES = 1000
INVERSES: dict[str, AbstractInverse] = {
    "rigid": RigidInverse(),
    "flexible_joint": FlexibleJointInverse(),
    "asim": ASIM(),
}
FIELDS = ("theta", "thetad", "thetadd", "tau_m", "tau_a", "q", "eta")


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: "asim_offline", "asim_step", "asim_vjp" and the like."""
    name, use = case.rsplit("_", 1)
    if use == "offline":
        yield from offline(name, effort)
    elif use == "step":
        yield from streamed(name, effort)
    else:
        yield from derivative(name, use, effort)


def difference(actual: MotorCommand, desired: MotorCommand) -> float:
    """Largest difference of a field, over the field's largest magnitude."""
    pairs = [[getattr(c, name) for c in (actual, desired)] for name in FIELDS]
    return max(relative_difference(a[None], b[None]) for a, b in pairs)


def offline(name: str, effort: Effort) -> Iterator[dict]:
    """The whole motion in one call."""
    robot, inverse = kr210(), INVERSES[name]
    reference = swing(SAMPLES, robot.axes)
    program = compile_timed(inverse.feedforward, robot, reference)
    (found,) = measure(effort, lambda: program.call(robot, reference))
    steps = jax.jit(lambda m, r: feedforward_by_steps(inverse, m, r))
    asim = name == "asim"
    yield row(
        f"{name}_offline",
        1e3 * found.best,
        "ms",
        batch=SAMPLES,
        threads=2,
        max_difference=difference(
            program.call(robot, reference), steps(robot, reference)
        ),
        compile_s=program.seconds,
        checks=(
            *([Check("value", 50.0, 4)] if asim else []),
            Check("max_difference", 1e-9, 7),
        ),
        median=1e3 * found.median,
        program_mib=program.program_mib,
        note="1 s at 1 kHz in one call; difference: to the streamed steps",
    )
    if asim:
        yield row(
            "compile_asim_offline",
            program.seconds,
            "s",
            threads=2,
            compile_s=program.seconds,
            checks=(Check("value", 10.0, 5),),
        )


def streamed(name: str, effort: Effort) -> Iterator[dict]:
    """One sample at a time, as a controller asks."""
    robot, inverse = kr210(), INVERSES[name]
    reference = swing(SAMPLES, robot.axes)
    samples = np.asarray(reference.derivatives)[: inverse.order(robot) + 1].swapaxes(
        0, 1
    )
    both = lambda: compile_step(inverse, robot, DT)
    stream, seconds = _timed(both)
    gc.freeze()
    gc.disable()
    times = latency(stream, samples, 500 * effort.repeats)
    gc.enable()
    stream.init(samples[0])
    outputs = [jax.tree.map(np.array, stream(sample)) for sample in samples]
    outputs = jax.tree.map(lambda *x: np.stack(x), *outputs)
    command = MotorCommand.from_samples(reference.times, outputs)
    offline = jax.jit(lambda m, r: inverse.feedforward(m, r))(robot, reference)
    asim = name == "asim"
    yield row(
        f"{name}_step",
        1e6 * times.p99,
        "us",
        threads=1,
        max_difference=difference(command, offline),
        compile_s=seconds,
        checks=(
            *([Check("value", 200.0, 4)] if asim else []),
            Check("max_difference", 1e-9, 7),
        ),
        p50=1e6 * times.p50,
        p99=1e6 * times.p99,
        p999=1e6 * times.p999,
        calls=times.calls,
        note=(
            f"99th percentile of {times.calls} calls; median {1e6 * times.p50:.0f} us, "
            f"99.9th percentile {1e6 * times.p999:.0f} us"
        ),
    )
    if asim:
        yield row(
            "compile_asim_step",
            seconds,
            "s",
            threads=1,
            compile_s=seconds,
            checks=(Check("value", 10.0, 5),),
            note="first sample and step together",
        )


def _timed(function):
    start = time.perf_counter()
    result = function()
    return result, time.perf_counter() - start


def derivative(name: str, use: str, effort: Effort) -> Iterator[dict]:
    """Derivatives of a step by all parameters, the state and the sample."""
    robot, inverse = kr210(), INVERSES[name]
    reference = swing(2, robot.axes)
    sample = jnp.asarray(reference.derivatives[: inverse.order(robot) + 1, 0])
    state = jax.jit(lambda m, s: inverse.init(m, s, DT))(robot, sample)

    def pushed(robot, state, sample):
        args = (robot, state, sample)
        tangents = jax.tree.map(lambda x: 0.1 * x, args)
        return jax.jvp(inverse.step, args, tangents)[1]

    def pulled(robot, state, sample):
        result, pull = jax.vjp(inverse.step, robot, state, sample)
        return pull(jax.tree.map(jnp.ones_like, result))

    args = robot, state, sample
    program = compile_timed({"jvp": pushed, "vjp": pulled}[use], *args)
    value = compile_timed(inverse.step, *args)
    here, there = measure(
        effort, lambda: program.call(*args), lambda: value.call(*args)
    )
    yield row(
        f"{name}_step_derivative",
        1e6 * here.best,
        "us",
        threads=2,
        peer="own step, jitted",
        peer_value=1e6 * there.best,
        compile_s=program.seconds,
        variant=use,
        median=1e6 * here.median,
    )
    yield row(
        f"compile_{name}_step",
        program.seconds,
        "s",
        threads=2,
        compile_s=program.seconds,
        checks=(Check("value", 20.0, 5),),
        variant=use,
    )
