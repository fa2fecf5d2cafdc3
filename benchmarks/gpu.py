"""What do the batch functions cost on a GPU?

`python -m benchmarks.gpu` on a machine that has one; no peers, and not a part of `make
bench`. The functions are the ones that run on a CPU, as they are written: kernels are
for the CPU. Every result is compared with that of the same machine's CPU for the first
samples. Writes `gpu.json` and `GPU.md`, row by row, so that an interrupted run keeps
what it has.
"""

import argparse
import json
import pathlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import locked_frequencies
from elastax.dynamics import forward_dynamics, inverse_dynamics, simulate
from elastax.inverse import ASIM
from elastax.kinematics import (
    SphericalWrist,
    find_pose,
    forward_kinematics,
    inverse_kinematics,
    jacobian,
)
from elastax.robots import kr210
from elastax.signals import Reference

from ._machine import machine, versions
from ._rows import relative_difference
from ._systems import controller, move_commands, random_states, swing, tree_robot
from ._timing import Effort, compile_timed, measure


FEW = 16
EFFORT = Effort(least=0.1, repeats=5, budget=10.0)


class GPUCase(NamedTuple):
    """A function of shared parameters and of a batch.

    Attributes:
        function: of one sample.
        shared: what the samples share.
        batch: arrays with the samples in front.
        bound: on the difference to the CPU, over each sample's largest magnitude.
        note: what a sample is.
    """

    function: Callable
    shared: Any
    batch: tuple
    bound: float
    note: str


def cases() -> Iterator[tuple[str, Callable[[], GPUCase]]]:
    """Cases, the cheap ones to compile first."""
    yield "pose", lambda: _kinematics("pose", 1 << 18)
    yield "jacobian", lambda: _kinematics("jacobian", 1 << 18)
    yield "inverse_kinematics", lambda: _branches(1 << 16)
    yield "rigid_inverse_dynamics", lambda: _rigid(1 << 18)
    yield "elastic_forward_dynamics", lambda: _elastic(1 << 16)
    yield "find_pose", lambda: _search(1 << 14)
    yield "asim_offline", lambda: _asim(1024)
    yield "closed_loop_simulation", lambda: _simulation(128)
    yield "locked_frequencies", lambda: _frequencies(1 << 14)


def _states(robot, count: int, names: str) -> tuple:
    states = random_states(robot, count)
    return tuple(jnp.asarray(states[name]) for name in names.split())


def _kinematics(name: str, count: int) -> GPUCase:

    robot = kr210()
    function = {"pose": forward_kinematics, "jacobian": jacobian}[name]
    return GPUCase(
        lambda r, q, eta: function(r.chain, r.joint_coordinates(q, eta)),
        robot,
        _states(robot, count, "q eta"),
        1e-12,
        f"{name} of an elastic KR210, 17 joints",
    )


def _branches(count: int) -> GPUCase:

    chain = kr210().rigid().chain
    q = jnp.asarray(random_states(kr210(), count)["q"])
    poses = jax.jit(jax.vmap(lambda x: forward_kinematics(chain, x)))(q)

    def reached(arm, pose):
        """Poses of all branches, zero where a branch does not exist."""
        angles, valid = inverse_kinematics(arm, pose)
        found = jax.vmap(lambda x: forward_kinematics(arm.chain, x))(angles)
        return jnp.where(valid[:, None, None], found, 0.0)

    return GPUCase(
        reached,
        SphericalWrist.from_chain(chain),
        (poses,),
        1e-9,
        "eight branches of the inverse and their poses",
    )


def _search(count: int) -> GPUCase:
    arm = kr210().arm()
    share = np.random.default_rng(1).uniform(size=(count, arm.chain.number))
    q = arm.lower + jnp.asarray(share) * (arm.upper - arm.lower)
    poses = jax.jit(jax.vmap(lambda x: forward_kinematics(arm.chain, x)))(q)

    def reached(arm, pose):
        """Pose of what is found, zero if nothing is."""
        found = find_pose(arm, pose, starts=32, throw=False)
        tool = forward_kinematics(arm.chain, found.value)
        return jnp.where(found.reached, tool, 0.0)

    return GPUCase(
        reached,
        arm,
        (poses,),
        1e-5,  # each side stops within 1e-6
        "numeric inverse within the limits, up to 32 starts",
    )


def _rigid(count: int) -> GPUCase:

    robot = kr210().rigid()
    return GPUCase(
        lambda r, q, qd, qdd: inverse_dynamics(r, q, qd, qdd)[0],
        robot,
        _states(robot, count, "q qd qdd"),
        1e-11,
        "torques of the rigid arm",
    )


def _elastic(count: int) -> GPUCase:

    robot = tree_robot()
    names = "q eta theta qd etad thetad tau_m"
    return GPUCase(
        forward_dynamics,
        robot,
        _states(robot, count, names),
        1e-9,
        "accelerations of joints, structure and motors, 14 coordinates",
    )


def _frequencies(count: int) -> GPUCase:

    robot = kr210()
    return GPUCase(
        locked_frequencies,
        robot,
        _states(robot, count, "q"),
        1e-8,
        "eigenfrequencies of one pose with motors locked",
    )


def _asim(count: int) -> GPUCase:

    robot, one = kr210(), swing(1000, kr210().axes)
    motion = np.asarray(one.derivatives)
    rest = np.zeros_like(motion)
    rest[0] = motion[0, 0]
    scale = np.linspace(0.5, 1.0, count)[:, None, None, None]
    batch = jnp.asarray(rest + scale * (motion - rest))
    return GPUCase(
        lambda r, d: ASIM().feedforward(r, Reference(one.times, d)).tau_m,
        robot,
        (batch,),
        1e-9,
        "a motion of 1 s at 1 kHz",
    )


def _simulation(repeat: int) -> GPUCase:

    robot = kr210()
    commands = move_commands(robot)
    batch = jax.tree.map(lambda x: jnp.concatenate([x] * repeat), commands)
    return GPUCase(
        lambda r, c: simulate(r, c, controller(), rtol=1e-6).q,
        robot,
        (batch,),
        1e-5,
        "closed loop of 0.5 s at rtol 1e-6; the 18 cases repeated",
    )


def measured(name: str, case: GPUCase) -> dict:
    """Time on the default device, and the difference to the CPU."""
    mapped = jax.vmap(case.function, (None, *(0 for _ in case.batch)))
    size = jax.tree.leaves(case.batch)[0].shape[0]
    program = compile_timed(mapped, case.shared, *case.batch)
    (found,) = measure(EFFORT, lambda: program.call(case.shared, *case.batch))
    few = jax.tree.map(lambda x: x[:FEW], case.batch)
    result = jax.tree.map(lambda x: x[:FEW], program.call(case.shared, *case.batch))
    cpu = jax.devices("cpu")[0]
    on_cpu = jax.device_put((case.shared, *few), cpu)
    with jax.default_device(cpu):
        desired = jax.jit(mapped)(*on_cpu)
    pairs = zip(jax.tree.leaves(result), jax.tree.leaves(desired))
    difference = max(relative_difference(a, b) for a, b in pairs)
    return {
        "name": name,
        "value": 1e6 * found.best / size,
        "unit": "us",
        "batch": size,
        "call_ms": 1e3 * found.best,
        "max_difference": difference,
        "bound": case.bound,
        "holds": difference <= case.bound,
        "compile_s": program.seconds,
        "note": case.note,
    }


def main(argv: list[str] | None = None) -> int:
    """Measure, write, and return 1 if a result differs from the CPU's."""
    parser = argparse.ArgumentParser("python -m benchmarks.gpu", description=__doc__)
    parser.add_argument("names", nargs="*", help="cases; all if none")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path(__file__).parent
    )
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="no case starts after these"
    )
    options = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    device = jax.devices()[0]
    header = {
        "device": device.device_kind,
        "platform": device.platform,
        "machine": machine(),
        "versions": versions(),
        "date": time.strftime("%Y-%m-%d"),
    }
    print(f"benchmarks.gpu: {device.device_kind}, jax {jax.__version__}", flush=True)
    rows: list[dict] = []
    start = time.perf_counter()
    for name, make in cases():
        if options.names and name not in options.names:
            continue
        if time.perf_counter() - start > 60 * options.minutes:
            print(f"{name}: left out, {options.minutes:g} min are over", flush=True)
            continue
        rows.append(measured(name, make()))
        print(f"{time.perf_counter() - start:7.1f} s  {rows[-1]}", flush=True)
        write(options.out, header, rows)
    return 0 if all(entry["holds"] for entry in rows) else 1


def write(folder: pathlib.Path, header: dict, rows: list[dict]) -> None:
    """Both files."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"header": header, "rows": rows}, indent=1)
    (folder / "gpu.json").write_text(text + "\n", encoding="utf-8")
    lines = [
        "# On a GPU",
        "",
        f"{header['device']}; {header['machine']['cpu']}, "
        f"{header['machine']['cores']} cores; jax {header['versions']['jax']}, jaxlib "
        f"{header['versions']['jaxlib']}; float64; {header['date']}. Made by "
        "`python -m benchmarks.gpu`.",
        "",
        "| function | batch | per sample | whole call | difference to the CPU "
        "| compile | a sample is |",
        "|---|---|---|---|---|---|---|",
    ]
    for entry in rows:
        lines.append(
            f"| {entry['name']} | {entry['batch']} | {entry['value']:.3g} us "
            f"| {entry['call_ms']:.3g} ms | {entry['max_difference']:.1e} (at most "
            f"{entry['bound']:.0e}) | {entry['compile_s']:.1f} s | {entry['note']} |"
        )
    (folder / "GPU.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
