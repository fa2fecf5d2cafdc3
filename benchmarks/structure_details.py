"""What does each detail of the structure cost, and what does it change?

`python -m benchmarks.structure_details`; no peers, and not a part of `make bench` (some
ten minutes). The KR210 on its default motion, under the cascade at the motors, with the
same detail in plant and inverse: eigenfrequencies with motors locked in the stretched
pose, path error of RLFJ and ASIM, and of an ASIM that knows only the hinged arm. Then
the time of one evaluation over the number of modes. Writes `structure_details.json` and
`STRUCTURE_DETAILS.md`.
"""

import argparse
import functools
import json
import pathlib
import sys
import tempfile
import time

import jax
import jax.numpy as jnp
import numpy as np
from elastax.analysis import locked_frequencies
from elastax.cli._arguments import FeedforwardConfig
from elastax.cli._feedforward import bare
from elastax.cli._motion import ORDER, build_motion
from elastax.control import CascadeMotorControl, run_command
from elastax.dynamics import ElasticRobot, forward_dynamics, inverse_dynamics
from elastax.inverse import ASIM, FlexibleJointInverse
from elastax.io import load_sid, save_sid
from elastax.robots import (
    BodiesArm,
    HingedArm,
    LumpedArm,
    ModalArm,
    TiltedArm,
    kr210,
)
from elastax.signals import Reference
from elastax.structure import ModeCounts

from ._machine import header
from ._timing import Effort, compile_timed, measure


EFFORT = Effort(least=0.1, repeats=5, budget=5.0)
MODES = (1, 2, 3, 4, 6, 8)
BATCH = 256


def sid_robot() -> ElasticRobot:
    """The members of `ModalArm(2, 2, 1)`, written to SID files and read again."""
    source = kr210(ModalArm(ModeCounts(2, 2, 1)))
    bodies = []
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "member.SID_FEM"
        for link in source.modal_links:
            body = link.body
            base = np.asarray(body.nodes.position)[0]
            save_sid(path, body.moved(np.eye(3), -base))
            bodies.append(load_sid(path).modal_body())
    # the arm's frame is that of its joint: turned so that x runs along the member
    reach = np.asarray(bodies[1].nodes.position)[-1]
    bodies[1] = bodies[1].moved(_turn(reach / np.linalg.norm(reach)), np.zeros(3))
    return kr210(BodiesArm(bodies[0], bodies[1], base="1", tip="2"))


def _turn(direction: np.ndarray) -> np.ndarray:
    """Rotation that takes a direction to x."""
    rows = np.eye(3)[np.argsort(np.abs(direction))]
    q, _ = np.linalg.qr(np.stack([direction, rows[0], rows[1]], axis=1))
    q = q * np.sign(q[:, 0] @ direction)
    q[:, 2] = np.cross(q[:, 0], q[:, 1])
    return q.T


DETAILS = {
    "tilts only": lambda: kr210(TiltedArm()),
    "hinges with end slopes": lambda: kr210(HingedArm()),
    "segments, five hinges": lambda: kr210(LumpedArm()),
    "beams, modes 1 1 1": lambda: kr210(ModalArm()),
    "beams, modes 2 2 1": lambda: kr210(ModalArm(ModeCounts(2, 2, 1))),
    "SID bodies, modes 2 2 1": sid_robot,
    "beams, modes 3 3 2": lambda: kr210(ModalArm(ModeCounts(3, 3, 2))),
}


@functools.cache
def hinged_command():
    """Command of an ASIM that knows the hinged arm, for all plants."""
    robot = kr210()
    reference = build_motion(robot, FeedforwardConfig()).reference
    plain = Reference(reference.times, reference.derivatives[: ORDER + 1])
    return bare(jax.jit(lambda m, r: ASIM().feedforward(m, r))(robot, plain))


def figures(name: str) -> dict:
    """Row of one detail."""
    start = time.perf_counter()
    robot, controller = DETAILS[name](), CascadeMotorControl()
    built = time.perf_counter() - start
    theta = robot.from_maker(robot.poses["stretched"])
    hertz = np.asarray(jax.jit(locked_frequencies)(robot, theta))
    reference = build_motion(robot, FeedforwardConfig()).reference
    asim = compile_timed(ASIM().feedforward, robot, reference)
    joint = jax.jit(FlexibleJointInverse().feedforward)
    command = bare(asim.call(robot, reference))
    drive = lambda p, c, r: run_command(p, c, r, controller, throw=False)
    loop = compile_timed(drive, robot, command, reference)
    inverse, closed = measure(
        EFFORT,
        lambda: asim.call(robot, reference),
        lambda: loop.call(robot, command, reference),
    )
    simulation, known = loop.call(robot, command, reference)
    _, plain = loop.call(robot, bare(joint(robot, reference)), reference)
    _, hinged = loop.call(robot, hinged_command(), reference)
    samples = reference.times.shape[0]
    duration = float(reference.times[-1] - reference.times[0])
    return {
        "name": name,
        "elastic": robot.elastic,
        "build_s": built,
        "frequencies_hz": hertz[:6].tolist(),
        "highest_hz": float(hertz[-1]),
        "simulation_ms_per_s": 1e3 * closed.best / duration,
        "step_us": 1e6 * closed.best / int(simulation.steps),
        "simulation_compile_s": loop.seconds,
        "asim_us_per_sample": 1e6 * inverse.best / samples,
        "asim_compile_s": asim.seconds,
        "path_error_rlfj_mm_s": 1e3 * float(plain.path_error_integral),
        "path_error_asim_mm_s": 1e3 * float(known.path_error_integral),
        "path_error_hinged_asim_mm_s": 1e3 * float(hinged.path_error_integral),
    }


def growth(modes: int) -> dict:
    """Time of one evaluation with so many modes of each member in each plane."""
    robot = kr210(ModalArm(ModeCounts(modes, modes)))
    n, m = robot.axes, robot.elastic
    draw = np.random.default_rng(0).standard_normal
    state = [jnp.asarray(0.1 * draw((BATCH, k))) for k in (n, m, n, n, m, n, n)]
    forward = jax.vmap(lambda *x: forward_dynamics(robot, *x))
    inverse = jax.vmap(lambda *x: inverse_dynamics(robot, *x))
    motion = [state[k] for k in (0, 3, 5)] + [state[k] for k in (1, 4, 4)]
    there, back = compile_timed(forward, *state), compile_timed(inverse, *motion)
    first, second = measure(
        EFFORT, lambda: there.call(*state), lambda: back.call(*motion)
    )
    return {
        "modes": m - 4,
        "forward_us": 1e6 * first.best / BATCH,
        "forward_compile_s": there.seconds,
        "inverse_us": 1e6 * second.best / BATCH,
        "inverse_compile_s": back.seconds,
    }


def slope(rows: list[dict], key: str) -> float:
    """Exponent with which a time grows with the number of modes."""
    modes = np.log([row["modes"] for row in rows])
    return float(np.polyfit(modes, np.log([row[key] for row in rows]), 1)[0])


def markdown(header: dict, rows: list[dict], grown: list[dict]) -> str:
    """The tables and what stands above them."""
    found = header["versions"]
    lines = [
        "# Details of the structure",
        "",
        f"{header['date']}, {header['machine']['cpu']}, {header['machine']['cores']} "
        f"cores, jax {found['jax']}, float64. KR210, default motion, cascade at the "
        "motors; plant and inverse of the same detail. Path error: integral. "
        "Eigenfrequencies with motors locked, stretched pose with 210 kg.",
        "",
        "| detail | coordinates | eigenfrequencies [Hz] | path error RLFJ / ASIM / "
        "ASIM of the hinged arm [mm s] | closed loop [ms per s] | compile [s] | ASIM "
        "[us per sample] | compile [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        hertz = " ".join(f"{f:.2f}" for f in row["frequencies_hz"][:5])
        lines.append(
            f"| {row['name']} | {row['elastic']} | {hertz} ... "
            f"{row['highest_hz']:.0f} | {row['path_error_rlfj_mm_s']:.3f} / "
            f"{row['path_error_asim_mm_s']:.3f} / "
            f"{row['path_error_hinged_asim_mm_s']:.3f} | "
            f"{row['simulation_ms_per_s']:.0f} | {row['simulation_compile_s']:.1f} | "
            f"{row['asim_us_per_sample']:.1f} | {row['asim_compile_s']:.1f} |"
        )
    lines += [
        "",
        f"Time per evaluation over the modes, {BATCH} states at once:",
        "",
        "| modes | forward dynamics [us] | compile [s] | inverse dynamics [us] | "
        "compile [s] |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {row['modes']} | {row['forward_us']:.1f} | {row['forward_compile_s']:.1f} "
        f"| {row['inverse_us']:.1f} | {row['inverse_compile_s']:.1f} |"
        for row in grown
    ]
    if len(grown) > 1:
        forward, inverse = slope(grown, "forward_us"), slope(grown, "inverse_us")
        lines += [
            "",
            f"The times grow with the power {forward:.2f} (forward) and {inverse:.2f} "
            "(inverse) of the number of modes.",
        ]
    return "\n".join(lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Measure, write, and return 1 if a figure is not finite or growth too fast."""
    parser = argparse.ArgumentParser("benchmarks.structure_details")
    parser.add_argument("--details", nargs="*", default=list(DETAILS))
    parser.add_argument("--modes", nargs="*", type=int, default=list(MODES))
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path(__file__).parent
    )
    options = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    head = header()
    rows: list[dict] = []
    grown: list[dict] = []

    def keep(into: list[dict], row: dict) -> None:
        into.append(row)
        print(json.dumps(row), flush=True)
        options.out.mkdir(parents=True, exist_ok=True)
        content = json.dumps({**head, "rows": rows, "growth": grown}, indent=1)
        (options.out / "structure_details.json").write_text(content + "\n")
        text = markdown(head, rows, grown)
        (options.out / "STRUCTURE_DETAILS.md").write_text(text)

    for name in options.details:
        keep(rows, figures(name))
    for modes in options.modes:
        keep(grown, growth(modes))
    print(markdown(head, rows, grown))
    numbers = [v for row in rows + grown for v in row.values() if isinstance(v, float)]
    if not np.all(np.isfinite(numbers)):
        return 1
    return int(len(grown) > 1 and slope(grown, "forward_us") > 2.0)


if __name__ == "__main__":
    sys.exit(main())
