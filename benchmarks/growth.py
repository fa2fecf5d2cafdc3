"""How does cost grow with samples, cases, axes and elastic coordinates?

Time is fitted by c * size**p; the table gives p. Samples: ASIM over a whole motion.
Cases: vmapped closed-loop simulations, and vmapped ASIM. Axes and elastic coordinates:
one evaluation of forward dynamics in a scan, over the coordinates (q, eta).
"""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
from elastax.dynamics import forward_dynamics, inverse_dynamics, simulate
from elastax.inverse import ASIM
from elastax.robots import kr210

from ._growth import exponent
from ._rows import Check, row
from ._systems import (
    chain_robot,
    controller,
    move_commands,
    random_states,
    swing,
)
from ._timing import Compiled, Effort, compile_timed, measure
from ._uses import scanned


SAMPLES = (100, 1000, 3000, 10000)
CASES = (8, 32, 128, 256)
AXES = (3, 6, 9, 12, 18)
ELASTIC = (0, 4, 8, 16, 24)
WINDOW = 0.1  # s, of the simulations
EVALUATIONS = 1000


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: "samples", "cases", "cases_asim", "axes" or "elastic"."""
    yield from {
        "samples": samples,
        "cases": cases,
        "cases_asim": cases_asim,
        "axes": axes,
        "elastic": elastic,
    }[case](effort)


def _row(name, sizes, seconds, programs: list[Compiled], limit, **extra) -> dict:
    shown = [f"{size}: {_time(t)}" for size, t in zip(sizes, seconds)]
    compiling = exponent(sizes, [program.seconds for program in programs])
    return row(
        name,
        exponent(sizes, seconds),
        "exponent",
        compile_s=programs[-1].seconds,
        checks=(Check("value", limit, 6),),
        sizes=list(sizes),
        seconds=list(seconds),
        compile_seconds=[program.seconds for program in programs],
        compile_exponent=compiling,
        program_mib=programs[-1].program_mib,
        note=f"{', '.join(shown)}; of compilation {compiling:.2f}",
        **extra,
    )


def _time(seconds: float) -> str:
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def samples(effort: Effort) -> Iterator[dict]:
    """Offline feed-forward of longer and longer motions."""
    robot, inverse = kr210(), ASIM()
    programs, seconds = [], []
    for count in SAMPLES:
        motion = swing(count, robot.axes)
        program = compile_timed(inverse.feedforward, robot, motion)
        (time,) = measure(effort, lambda: program.call(robot, motion))
        programs.append(program)
        seconds.append(time.best)
    yield _row(
        "growth_samples",
        SAMPLES,
        seconds,
        programs,
        1.05,
        variant="asim offline",
        threads=2,
    )


def _tiled(tree, count: int):
    """The cases over again until there are `count`."""
    return jax.tree.map(lambda x: x[jnp.arange(count) % x.shape[0]], tree)


def cases(effort: Effort) -> Iterator[dict]:
    """Vmapped simulations."""
    robot = kr210()
    commands = move_commands(robot, WINDOW)
    loop = lambda r, c: simulate(r, c, controller()).tool_pose
    programs, seconds = [], []
    for count in CASES:
        batch = _tiled(commands, count)
        program = compile_timed(jax.vmap(loop, (None, 0)), robot, batch)
        (time,) = measure(effort, lambda: program.call(robot, batch))
        programs.append(program)
        seconds.append(time.best)
    yield _row(
        "growth_cases",
        CASES,
        seconds,
        programs,
        1.05,
        variant="simulation, vmapped",
        threads=2,
    )


def cases_asim(effort: Effort) -> Iterator[dict]:
    """Vmapped feed-forwards of 100 samples."""
    robot, inverse = kr210(), ASIM()
    motion = swing(100, robot.axes)
    programs, seconds = [], []
    for count in CASES:
        shift = 1e-3 * jnp.arange(count)

        def one(robot, motion, shift):
            derivatives = motion.derivatives.at[0].add(shift)
            return inverse.feedforward(
                robot, type(motion)(motion.times, derivatives)
            ).theta

        program = compile_timed(jax.vmap(one, (None, None, 0)), robot, motion, shift)
        (time,) = measure(effort, lambda: program.call(robot, motion, shift))
        programs.append(program)
        seconds.append(time.best)
    yield _row(
        "growth_cases",
        CASES,
        seconds,
        programs,
        1.05,
        variant="asim offline, vmapped",
        threads=2,
    )


def _coordinates(robots, effort: Effort):
    """Seconds and programs of one evaluation in a scan, forward and inverse."""
    inverse = lambda r, q, eta, qd, etad, qdd, etadd: inverse_dynamics(
        r, q, qd, qdd, eta, etad, etadd
    )
    uses = {
        "forward dynamics, scan": (
            forward_dynamics,
            ("q", "eta", "theta", "qd", "etad", "thetad", "tau_m"),
        ),
        "inverse dynamics, scan": (
            inverse,
            ("q", "eta", "qd", "etad", "qdd", "etadd"),
        ),
    }
    for variant, (function, inputs) in uses.items():
        programs, seconds = [], []
        for robot in robots:
            states = random_states(robot, EVALUATIONS)
            batch = [jnp.asarray(states[name]) for name in inputs]
            program = compile_timed(scanned(function), robot, *batch)
            (time,) = measure(effort, lambda: program.call(robot, *batch))
            programs.append(program)
            seconds.append(time.best / EVALUATIONS)
        yield variant, seconds, programs


def axes(effort: Effort) -> Iterator[dict]:
    """Arms with elastic gears and rigid links."""
    robots = [chain_robot(count) for count in AXES]
    for variant, seconds, programs in _coordinates(robots, effort):
        yield _row("growth_axes", AXES, seconds, programs, 2.0, variant=variant)


def elastic(effort: Effort) -> Iterator[dict]:
    """Arms of six axes with more and more elastic hinges."""
    robots = [chain_robot(6, count) for count in ELASTIC]
    sizes = [6 + count for count in ELASTIC]
    for variant, seconds, programs in _coordinates(robots, effort):
        yield _row("growth_elastic", sizes, seconds, programs, 2.0, variant=variant)
