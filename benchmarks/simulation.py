"""How fast is the closed-loop simulation of the elastic robot, and how exact?

The KR210 on the first 0.5 s of its default motion, with the ASIM feed-forward and the
cascade at the motors, at rtol 1e-6, all 501 samples of all results. The 18 cases are
three poses of A2, three of A3 and two moves. The measure of error is a run with another
solver at rtol 1e-10: largest difference of angles and of speeds, for each of joints,
structure and motors over its own largest magnitude.
"""

from collections.abc import Iterator

import diffrax as dfx
import jax
from elastax import over_devices
from elastax.dynamics import MotorCommand, simulate
from elastax.robots import kr210

from ._rows import Check, relative_difference, row
from ._systems import controller, move_commands, one_case
from ._timing import Effort, compile_timed, measure


RTOL = 1e-6
STATE = ("q", "eta", "theta", "qd", "etad", "thetad")


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: one motion, 18 vmapped, 18 over the devices."""
    robot = kr210()
    commands = move_commands(robot)
    if case == "one":
        command = one_case(commands)
        program = compile_timed(closed_loop, robot, command)
        name, batch, limit = "closed_loop_simulation", 1, 25.0
        exact = jax.jit(accurate)(robot, command)
    else:
        command = commands
        use = jax.vmap if case == "vmap" else over_devices
        program = compile_timed(use(closed_loop, (None, 0)), robot, command)
        name, batch, limit = "closed_loop_18_cases", 18, 400.0
        exact = jax.jit(jax.vmap(accurate, (None, 0)))(robot, command)
    (time,) = measure(effort, lambda: program.call(robot, command))
    result = program.call(robot, command)
    steps = int(result.steps.max())
    if case == "devices":
        name += "_over_devices"
    yield row(
        name,
        1e3 * time.best,
        "ms",
        batch=batch,
        threads=2,
        max_difference=difference(result, exact, batch > 1),
        compile_s=program.seconds,
        checks=(
            *([] if case == "devices" else [Check("value", limit, 3)]),
            Check("max_difference", 10 * RTOL, 7),
        ),
        median=1e3 * time.median,
        program_mib=program.program_mib,
        steps=steps,
        note=f"0.5 s at rtol 1e-6, {steps} steps; difference: to rtol 1e-10",
    )
    if case == "one":
        yield row(
            "compile_simulation",
            program.seconds,
            "s",
            threads=2,
            compile_s=program.seconds,
            checks=(Check("value", 10.0, 5),),
        )


def closed_loop(robot, command: MotorCommand):
    """What is measured."""
    return simulate(robot, command, controller(), rtol=RTOL)


def accurate(robot, command: MotorCommand):
    """State of the same motion, by another solver at a tight tolerance."""
    result = simulate(
        robot, command, controller(), solver=dfx.Dopri8(), rtol=1e-10, atol=1e-13
    )
    return {name: getattr(result, name) for name in STATE}


def difference(result, exact: dict, batched: bool) -> float:
    """Largest relative difference of a part of the state."""
    pairs = [(getattr(result, name), exact[name]) for name in STATE]
    if not batched:
        pairs = [(a[None], b[None]) for a, b in pairs]
    return max(relative_difference(*pair) for pair in pairs)
