"""What does each part of the drive trains cost, and what does it change?

`python -m benchmarks.drive_parts`; no peers, and not a part of `make bench` (some ten
minutes). Every file of `examples/drive_parts` is taken into the plant of the KR210 on
its default motion, under ASIM and the cascade at the motors: once with an inverse that
knows the part, for an exact part its smooth counterpart, and once with one that does
not. Writes `drive_parts.json` and `DRIVE_PARTS.md`.
"""

import argparse
import dataclasses
import functools
import json
import pathlib
import sys

import jax
import numpy as np
from elastax.cli._arguments import FeedforwardConfig
from elastax.cli._feedforward import bare
from elastax.cli._motion import ORDER, build_motion
from elastax.control import CascadeMotorControl, run_command
from elastax.dynamics import ElasticRobot
from elastax.inverse import ASIM
from elastax.io import load_drive_parts
from elastax.robots import kr210
from elastax.signals import Reference

from ._machine import header
from ._timing import Effort, compile_timed, measure


EXAMPLES = pathlib.Path(__file__).resolve().parents[1] / "examples" / "drive_parts"
# what the inverse knows of an exact part
COUNTERPARTS = {
    "exact_backlash": "backlash",
    "exact_efficiency": "efficiency",
    "exact_friction": None,
    "exact_stops": "hysteresis_stops",
}
EFFORT = Effort(least=0.1, repeats=5, budget=5.0)


def with_part(robot: ElasticRobot, name: str | None) -> ElasticRobot:
    """Robot with the part of an example."""
    if name is None:
        return robot
    drives = load_drive_parts(EXAMPLES / f"{name}.toml", robot.drives)
    return dataclasses.replace(robot, drives=drives)


@functools.cache
def unaware():
    """Command of an inverse that knows none of the parts, the same for all."""
    robot = kr210()
    reference = build_motion(robot, FeedforwardConfig()).reference
    plain = Reference(reference.times, reference.derivatives[: ORDER + 1])
    return bare(jax.jit(lambda m, r: ASIM().feedforward(m, r))(robot, plain))


def figures(name: str | None) -> dict:
    """Row of one part."""
    robot, controller = kr210(), CascadeMotorControl()
    plant = with_part(robot, name)
    model = with_part(robot, COUNTERPARTS.get(name or "", name))
    reference = build_motion(model, FeedforwardConfig()).reference
    inverse = compile_timed(ASIM().feedforward, model, reference)
    command = inverse.call(model, reference)
    drive = lambda p, c, r: run_command(p, c, r, controller, throw=False)
    loop = compile_timed(drive, plant, bare(command), reference)
    asim, closed = measure(
        EFFORT,
        lambda: inverse.call(model, reference),
        lambda: loop.call(plant, bare(command), reference),
    )
    simulation, known = loop.call(plant, bare(command), reference)
    _, ignored = loop.call(plant, unaware(), reference)
    samples = reference.times.shape[0]
    duration = float(reference.times[-1] - reference.times[0])
    return {
        "name": name or "as kr210 has it",
        "simulation_ms_per_s": 1e3 * closed.best / duration,
        "steps": int(simulation.steps),
        "step_us": 1e6 * closed.best / int(simulation.steps),
        "simulation_compile_s": loop.seconds,
        "asim_us_per_sample": 1e6 * asim.best / samples,
        "asim_compile_s": inverse.seconds,
        "path_error_known_mm_s": 1e3 * float(known.path_error_integral),
        "path_error_ignored_mm_s": 1e3 * float(ignored.path_error_integral),
        "criterion_known": float(known.criterion),
        "criterion_ignored": float(ignored.criterion),
    }


def markdown(header: dict, rows: list[dict]) -> str:
    """The table and what stands above it."""
    found = header["versions"]
    lines = [
        "# Parts of the drive trains",
        "",
        f"{header['date']}, {header['machine']['cpu']}, {header['machine']['cores']} "
        f"cores, jax {found['jax']}, float64. KR210, default motion, ASIM, cascade at "
        "the motors; each part alone, numbers of `examples/drive_parts`. Path error: "
        "integral with an inverse that knows the part (of an exact part its smooth "
        "counterpart), and with one that does not; C: criterion (6.1) for both.",
        "",
        "| part | closed loop [ms per s] | step [us] | compile [s] | ASIM [us per "
        "sample] | compile [s] | path error known / ignored [mm s] | C known / ignored "
        "[m/s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['name']} | {row['simulation_ms_per_s']:.0f} | {row['step_us']:.0f}"
            f" | {row['simulation_compile_s']:.1f} | {row['asim_us_per_sample']:.1f} | "
            f"{row['asim_compile_s']:.1f} | {row['path_error_known_mm_s']:.3f} / "
            f"{row['path_error_ignored_mm_s']:.3f} | {row['criterion_known']:.4f} / "
            f"{row['criterion_ignored']:.4f} |"
        )
    return "\n".join(lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Measure, write, and return 1 if a figure is not finite."""
    parser = argparse.ArgumentParser("benchmarks.drive_parts", description=__doc__)
    parser.add_argument("names", nargs="*", help="examples; all if none")
    parser.add_argument(
        "--out", type=pathlib.Path, default=pathlib.Path(__file__).parent
    )
    options = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    head = header()
    names = options.names or sorted(path.stem for path in EXAMPLES.glob("*.toml"))
    rows: list[dict] = []
    for name in [None, *names]:
        rows.append(figures(name))
        print(json.dumps(rows[-1]), flush=True)
        options.out.mkdir(parents=True, exist_ok=True)
        content = json.dumps({**head, "rows": rows}, indent=1) + "\n"
        (options.out / "drive_parts.json").write_text(content)
        (options.out / "DRIVE_PARTS.md").write_text(markdown(head, rows))
    print(markdown(head, rows))
    numbers = [v for row in rows for v in row.values() if isinstance(v, float)]
    return 0 if np.all(np.isfinite(numbers)) else 1


if __name__ == "__main__":
    sys.exit(main())
