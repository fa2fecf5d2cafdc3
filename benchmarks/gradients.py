"""What do derivatives of a simulation cost, in forward runs?

The motion of `simulation`. The 20 parameters are the logarithms of gear stiffness, gear
damping and structural stiffness. The reverse gradient is that of the mean square of the
tool's distance from its start; the forward Jacobian is that of the tool's path. Both
are compared with central differences of a run at rtol 1e-10.
"""

from collections.abc import Iterator

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import simulate
from elastax.robots import kr210

from ._rows import Check, relative_difference, row
from ._systems import PARAMETERS, controller, move_commands, one_case, scaled_robot
from ._timing import Effort, compile_timed, measure


RTOL = 1e-6
EXACT = {"solver": dfx.Dopri8(), "rtol": 1e-10, "atol": 1e-13}
DIFFERENCE = 1e-4  # of gradients, to differences
STEP = 0.02


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: "reverse", "forward" or "forward_18"."""
    robot = kr210()
    commands = move_commands(robot)
    here = jnp.zeros((PARAMETERS,))
    if case == "reverse":
        yield from reverse(robot, one_case(commands), here, effort)
        return
    many = case.endswith("18")
    command = commands if many else one_case(commands)
    path = lambda p, c: tool_path(robot, p, c, rtol=RTOL, adjoint=dfx.ForwardMode())
    value, slope = path, jax.jacfwd(path)
    if many:
        value, slope = jax.vmap(value, (None, 0)), jax.vmap(slope, (None, 0))
    program = compile_timed(slope, here, command)
    forward = compile_timed(value, here, command)
    time, base = measure(
        effort,
        lambda: program.call(here, command),
        lambda: forward.call(here, command),
    )
    checks = [
        Check("ratio", 25.0 if many else 6.0, 3),
        Check("max_difference", DIFFERENCE, 7),
    ]
    if not many:
        checks.append(Check("value", 150.0, 3))
    exact = one_case(commands) if many else command
    jacobian = program.call(here, command)
    yield row(
        "simulation_forward_jacobian_20",
        1e3 * time.best,
        "ms",
        batch=18 if many else 1,
        threads=2,
        peer="own forward run",
        peer_value=1e3 * base.best,
        max_difference=path_difference(
            robot, exact, np.asarray(jacobian[0] if many else jacobian)
        ),
        compile_s=program.seconds,
        checks=tuple(checks),
        median=1e3 * time.median,
        program_mib=program.program_mib,
        variant="jacfwd",
        note="difference: to central differences at rtol 1e-10, one direction",
    )
    if not many:
        yield compile_row("simulation_forward_jacobian_20", program.seconds)


def compile_row(name: str, seconds: float) -> dict:
    """The compile time as a row of its own."""
    return row(
        f"compile_{name}",
        seconds,
        "s",
        threads=2,
        compile_s=seconds,
        checks=(Check("value", 20.0, 5),),
    )


def tool_path(robot, parameters, command, **options):
    """Positions of the tool [m], (times, 3)."""
    moved = scaled_robot(robot, parameters)
    return simulate(moved, command, controller(), **options).tool_pose[:, :3, 3]


def cost(robot, parameters, command, **options):
    """Mean square distance of the tool from its start [m^2]."""
    path = tool_path(robot, parameters, command, **options)
    return jnp.mean(jnp.sum((path - path[:1]) ** 2, axis=1))


def reverse(robot, command, here, effort: Effort) -> Iterator[dict]:
    """Gradient of one number by all parameters."""
    function = lambda p, c: cost(robot, p, c, rtol=RTOL)
    program = compile_timed(jax.value_and_grad(function), here, command)
    forward = compile_timed(function, here, command)
    time, base = measure(
        effort,
        lambda: program.call(here, command),
        lambda: forward.call(here, command),
    )
    _, gradient = program.call(here, command)
    yield row(
        "simulation_reverse_gradient",
        1e3 * time.best,
        "ms",
        threads=2,
        peer="own forward run",
        peer_value=1e3 * base.best,
        max_difference=gradient_difference(robot, command, np.asarray(gradient)),
        compile_s=program.seconds,
        checks=(Check("ratio", 5.0, 3), Check("max_difference", DIFFERENCE, 7)),
        median=1e3 * time.median,
        program_mib=program.program_mib,
        variant="vjp",
        note="20 parameters; difference: to central differences at rtol 1e-10",
    )
    yield compile_row("simulation_reverse_gradient", program.seconds)


def directions() -> np.ndarray:
    """Two random unit directions of the parameters."""
    found = np.random.default_rng(0).standard_normal((2, PARAMETERS))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def slopes(function, along: np.ndarray) -> np.ndarray:
    """Derivatives of `function` along directions by differences of four points."""
    lengths = STEP * np.array([-2.0, -1.0, 1.0, 2.0])
    points = jnp.asarray(lengths[None, :, None] * along[:, None])
    flat = points.reshape(-1, PARAMETERS)
    values = np.asarray(jax.jit(lambda x: jax.lax.map(function, x))(flat))
    values = values.reshape(len(along), 4, *values.shape[1:])
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * STEP)
    return np.einsum("w,kw...->k...", weights, values)


def gradient_difference(robot, command, gradient: np.ndarray) -> float:
    """Difference of the gradient's products with directions, over its length."""
    along = directions()
    exact = slopes(lambda p: cost(robot, p, command, **EXACT), along)
    return float(np.max(np.abs(along @ gradient - exact)) / np.linalg.norm(gradient))


def path_difference(robot, command, jacobian: np.ndarray) -> float:
    """Difference of the path's derivative along a direction, over the largest."""
    along = directions()[:1]
    exact = slopes(lambda p: tool_path(robot, p, command, **EXACT), along)
    found = np.einsum("tai,ki->kta", jacobian, along)
    return relative_difference(found, exact)
