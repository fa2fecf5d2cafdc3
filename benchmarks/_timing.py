"""Times of calls and of compilation, and memory."""

import dataclasses
import pathlib
import resource
import statistics
import time
from collections.abc import Callable
from typing import Any


@dataclasses.dataclass(frozen=True)
class Effort:
    """How long to measure.

    Attributes:
        least: of one repeat [s].
        repeats: of a measurement.
        budget: time after which no further repeat starts [s].
    """

    least: float = 0.2
    repeats: int = 7
    budget: float = 20.0


FULL = Effort()
QUICK = Effort(least=0.01, repeats=2, budget=2.0)


@dataclasses.dataclass(frozen=True)
class Timing:
    """Time of one call [s].

    Attributes:
        best: of the best repeat, which others on the machine disturbed least.
        median: over the repeats.
        repeats: how many there were.
    """

    best: float
    median: float
    repeats: int


def measure(effort: Effort, *runs: Callable[[], Any]) -> tuple[Timing, ...]:
    """Time several functions turn by turn, so that they meet the same disturbances.

    Args:
        effort: how long to measure.
        runs: functions without arguments; what they return is waited for.
    """
    import jax

    calls = []
    for run in runs:
        jax.block_until_ready(run())
        once = _repeat(jax.block_until_ready, run, 1)
        calls.append(max(1, round(effort.least / max(once, 1e-9))))
    times: list[list[float]] = [[] for _ in runs]
    start = time.perf_counter()
    while len(times[0]) < effort.repeats:
        for run, count, found in zip(runs, calls, times):
            found.append(_repeat(jax.block_until_ready, run, count) / count)
        if time.perf_counter() - start > effort.budget:
            break
    return tuple(Timing(min(t), statistics.median(t), len(t)) for t in times)


def _repeat(block: Callable, run: Callable, count: int) -> float:
    start = time.perf_counter()
    for _ in range(count):
        block(run())
    return time.perf_counter() - start


@dataclasses.dataclass(frozen=True)
class Compiled:
    """A program and what it took.

    Attributes:
        call: the program.
        seconds: tracing, lowering and compiling [s].
        program_mib: memory that the program allocates while it runs, results included.
    """

    call: Callable
    seconds: float
    program_mib: float


def compile_timed(function: Callable, *args) -> Compiled:
    """`jax.jit(function)` compiled for `args`."""
    import jax

    start = time.perf_counter()
    # a bound method of a module with arrays has no hash
    program = jax.jit(lambda *args: function(*args)).lower(*args).compile()
    seconds = time.perf_counter() - start
    memory = program.memory_analysis()
    size = memory.temp_size_in_bytes + memory.output_size_in_bytes
    return Compiled(program, seconds, size / 2**20)


def reset_peak_memory() -> None:
    """Start a new measurement of the peak memory, where the system allows it."""
    try:
        pathlib.Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        pass  # the peak since the start of the process is all there is


def peak_memory() -> float:
    """Largest resident memory of this process since the reset [MiB]."""
    try:
        lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    (peak,) = [line for line in lines if line.startswith("VmHWM:")]
    return int(peak.split()[1]) / 1024
