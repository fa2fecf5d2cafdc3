"""What do the functions of `analysis` cost, by use, with their compilation?

`python -m benchmarks.analysis`; no peers, not a part of `make bench`, eight minutes.
Linear model, transmission zeros and figures of a pose of the KR210 from the motor
torques of A1 to A3 to the place of the tool: one call at a time, one after another in a
scan, vmapped over poses, and with a forward and a reverse derivative by all parameters.
Then a map of 4,096 poses, from the start of the program on. Writes `analysis.json` and
`ANALYSIS.md`.
"""

import argparse
import json
import pathlib
import sys
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import (
    RobotChannel,
    linear_robot,
    pose_figures,
    transmission_zeros,
    zero_map,
)
from elastax.dynamics import ElasticRobot
from elastax.robots import kr210

from ._machine import header
from ._timing import Effort, compile_timed, measure


EFFORT = Effort(least=0.2, repeats=5, budget=5.0)
DEGREES = (3, 3, 3)
POSES = 256
CHANNEL = RobotChannel()


def model(robot: ElasticRobot, pose):
    """Matrices of the linear model at a pose."""
    found = linear_robot(robot, robot.from_maker(pose), CHANNEL)
    return found.A, found.B, found.C, found.D


def zeros(robot: ElasticRobot, pose):
    """Parts of the transmission zeros at a pose."""
    found = transmission_zeros(*model(robot, pose), DEGREES)
    return found.real, found.imag


def figures(robot: ElasticRobot, pose):
    """Figures of a map at a pose."""
    theta = robot.from_maker(pose)
    found = pose_figures(robot, theta, CHANNEL, DEGREES)
    return found.largest_real, found.frequency, found.damping_ratio


FUNCTIONS = {
    "linear model": model,
    "transmission zeros": zeros,
    "pose figures": figures,
}


def scanned(function):
    """One pose after another, each waiting for the result before it."""

    def run(robot, poses):
        def step(carry, pose):
            result = function(robot, pose + carry)
            return 1e-300 * jax.tree.leaves(result)[0].ravel()[0], result

        return jax.lax.scan(step, jnp.zeros(()), poses)[1]

    return run


def forward(function):
    """Derivative along all parameters at once."""

    def run(robot, pose):
        parameters, rest = eqx.partition(robot, eqx.is_inexact_array)
        push = jax.tree.map(lambda x: 1e-3 * x, parameters)
        of = lambda p: function(eqx.combine(p, rest), pose)
        return jax.jvp(of, (parameters,), (push,))[1]

    return run


def reverse(function):
    """Gradient of a sum by all parameters."""

    def run(robot, pose):
        total = lambda r: sum(jnp.sum(x) for x in function(r, pose))
        return eqx.filter_grad(total)(robot)

    return run


def row(name: str, robot: ElasticRobot, poses) -> dict:
    """Times of one function in all uses."""
    function = FUNCTIONS[name]
    uses = {
        "single": (function, robot, poses[0]),
        "scan": (scanned(function), robot, poses),
        "vmap": (jax.vmap(function, in_axes=(None, 0)), robot, poses),
        "forward": (forward(function), robot, poses[0]),
        "reverse": (reverse(function), robot, poses[0]),
    }
    found = {"name": name}
    for use, (run, *args) in uses.items():
        program = compile_timed(run, *args)
        (timing,) = measure(EFFORT, lambda p=program, a=args: p.call(*a))
        count = len(poses) if use in ("scan", "vmap") else 1
        found[f"{use}_us"] = 1e6 * timing.best / count
        found[f"{use}_compile_s"] = program.seconds
    return found


def whole_map(robot: ElasticRobot, count: int) -> dict:
    """A map over A2 and A3, compilation included."""
    lower, upper = np.asarray(robot.limits.lower), np.asarray(robot.limits.upper)
    grid = np.meshgrid(*(np.linspace(lower[k], upper[k], count) for k in (1, 2)))
    poses = np.zeros((count * count, 6))
    poses[:, 1], poses[:, 2] = (x.ravel() for x in grid)
    start = time.perf_counter()
    found = zero_map(robot, poses)
    first = time.perf_counter() - start
    start = time.perf_counter()
    zero_map(robot, poses)
    return {
        "poses": count * count,
        "cold_s": first,
        "warm_s": time.perf_counter() - start,
        "with_right_zeros": found.unstable,
        "masked": found.masked,
    }


def markdown(header: dict, rows: list[dict], mapped: dict | None) -> str:
    """The tables and what stands above them."""
    lines = [
        "# Analysis",
        "",
        f"{header['date']}, {header['machine']['cpu']}, {header['machine']['cores']} "
        f"cores, jax {header['versions']['jax']}, float64. KR210, motor torques of A1 "
        f"to A3 to x, y, z of the tool, 34 states. Scan and vmap over {POSES} poses, "
        "time per pose; derivatives at one pose by all parameters of the robot.",
        "",
        "| function | single [us] | scan [us] | vmap [us] | forward derivative [us] | "
        "reverse gradient [us] | compile [s] |",
        "|---|---|---|---|---|---|---|",
    ]
    for found in rows:
        times = [
            f"{found[f'{use}_us']:.0f}"
            for use in ("single", "scan", "vmap", "forward", "reverse")
        ]
        seconds = ", ".join(
            f"{found[f'{use}_compile_s']:.0f}"
            for use in ("single", "scan", "vmap", "forward", "reverse")
        )
        lines.append(f"| {found['name']} | {' | '.join(times)} | {seconds} |")
    if mapped is not None:
        lines += [
            "",
            f"A map of {mapped['poses']} poses over A2 and A3 takes "
            f"{mapped['cold_s']:.0f} s with compilation and {mapped['warm_s']:.1f} s "
            f"without; {mapped['with_right_zeros']} poses have zeros on the right, "
            f"{mapped['masked']} are masked.",
        ]
    return "\n".join(lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Measure, write, and return 1 if a figure is not finite."""
    parser = argparse.ArgumentParser("benchmarks.analysis")
    parser.add_argument("--functions", nargs="*", default=list(FUNCTIONS))
    parser.add_argument("--grid", type=int, default=64)
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path(__file__).parent
    )
    options = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    head = header()
    robot = kr210()
    draw = np.random.default_rng(0).uniform
    poses = np.zeros((POSES, 6))
    poses[:, 1], poses[:, 2] = draw(-1.5, 0.0, POSES), draw(0.2, 1.8, POSES)
    mapped = whole_map(robot, options.grid) if options.grid else None
    print(json.dumps(mapped), flush=True)
    rows = []
    for name in options.functions:
        rows.append(row(name, robot, jnp.asarray(poses)))
        print(json.dumps(rows[-1]), flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    content = json.dumps({**head, "rows": rows, "map": mapped}, indent=1)
    (options.out / "analysis.json").write_text(content + "\n")
    (options.out / "ANALYSIS.md").write_text(markdown(head, rows, mapped))
    print(markdown(head, rows, mapped))
    numbers = [v for found in rows for v in found.values() if isinstance(v, float)]
    return int(not np.all(np.isfinite(numbers)))


if __name__ == "__main__":
    sys.exit(main())
