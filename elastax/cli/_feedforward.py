"""`elastax feedforward`: the main job."""

import concurrent.futures
import dataclasses
import pathlib
import sys
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from ..control import CascadeMotorControl, Run, run_command
from ..dynamics import CommandInterpolant, ElasticRobot, MotorCommand
from ..inverse import (
    ASIM,
    AbstractInverse,
    FlexibleJointInverse,
    RigidInverse,
    compile_step,
    latency,
)
from ..io import load_drive_parts, versions, write_results
from ..robots import named_robot
from ..signals import Reference
from ._arguments import FeedforwardConfig
from ._figures import figures
from ._grid import Grid, run_grid
from ._motion import Motion, build_motion
from ._perturb import run_perturbed
from ._progress import Progress
from ._recording import run_recording
from ._tables import grid_lines, perturbation_table, recording_table, runs_table


SCHEMA = "elastax.feedforward/1"

INVERSES: dict[str, AbstractInverse] = {
    "rigid": RigidInverse(),
    "flexible_joint": FlexibleJointInverse(),
    "asim": ASIM(),
}


@dataclasses.dataclass
class Compiled:
    """Programs of one robot topology and one length of motion, and their cost.

    Attributes:
        inverses: compiled feed-forwards of (model, reference).
        plant: compiled simulation and judgement of (plant, command, reference).
        seconds: time that compilation took.
    """

    inverses: dict[str, Callable]
    plant: Callable
    seconds: float


def feedforward(config: FeedforwardConfig, progress: Progress) -> int:
    """Compare the feed-forwards, print the table, write the results.

    Args:
        config: what to do.
        progress: where to say what is going on.

    Returns:
        Exit status: 0, or 1 where a figure is not finite.

    Raises:
        ValueError: bad input, before any long computation.
    """
    robot = with_payload(named_robot(config.robot), config.payload)
    robot = with_parts(robot, config.parts)
    if not robot.drives.invertible:
        raise ValueError(
            f"{config.parts}: an exact part has no inverse: give it with --plant-parts"
        )
    plant = with_parts(robot, config.plant_parts)
    _check(config)
    result = {"schema": SCHEMA, "robot": robot.name, "versions": versions()}
    result["configuration"] = dataclasses.asdict(config)
    result["sources"] = list(robot.sources)
    result["assumptions"] = list(robot.assumptions)
    arrays: dict[str, np.ndarray] = {}
    if config.recording is not None:
        report, motion = run_recording(robot, config, progress)
        robot, result["recording"] = report.robot, report.summary
        plant = robot
        arrays.update(report.arrays)
    else:
        report, motion = None, build_motion(robot, config)
    for note in motion.notes:
        print(note)
    progress.say(
        f"{robot.name}: {robot.axes} axes, {robot.elastic} elastic coordinates; "
        f"{motion.reference.times.shape[0]} samples"
    )
    both = (robot, plant)
    programs = compile_programs(*both, motion.reference, config.inverses, progress)
    runs, cost = run_all(*both, motion.reference, programs, progress)
    if config.stream:
        for name in config.inverses:
            cost[name].update(stream_cost(name, robot, motion.reference, progress))
    result["inverses"] = {n: summary(r) | cost[n] for n, r in runs.items()}
    print(runs_table(robot, result))
    perturbed = grid = None
    if config.perturb is not None:
        perturbed = run_perturbed(
            *both, motion.reference, programs, runs, config.perturb, progress
        )
        result["perturbation"] = perturbed
        print(perturbation_table(perturbed))
    if config.grid is not None:
        grid = run_grid(robot, config, {n: INVERSES[n] for n in runs}, progress)
        result["grid"] = grid.as_dict()
        print("\n".join(grid_lines(grid)))
    if report is not None:
        print(recording_table(report.summary))
    result |= {"wall_s": progress.elapsed(), "compile_s": programs.seconds}
    write(
        config, robot, motion, runs, perturbed, grid, report, result, arrays, progress
    )
    return 0 if _finite(result["inverses"]) else 1


def _check(config: FeedforwardConfig) -> None:
    if config.rate is not None and config.rate <= 0:
        raise ValueError(f"--rate must be positive [Hz], but is {config.rate:g}")
    if config.perturb is not None and not 0 < config.perturb < 1:
        raise ValueError(
            f"--perturb must lie between 0 and 1, but is {config.perturb:g}"
        )
    if config.grid is not None and config.grid < 2:
        raise ValueError(f"--grid must be 2 or more poses, but is {config.grid}")
    out = pathlib.Path(config.out)
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out must be a folder, but {config.out} is a file")
    if not config.cutoff > 0:
        raise ValueError(f"--cutoff must be positive [Hz], but is {config.cutoff:g}")
    elsewhere = config.grid is not None or config.recording is not None
    if config.plant_parts is not None and elsewhere:
        raise ValueError("--plant-parts goes with neither --grid nor --recording")
    if config.identify_on is not None and config.recording is None:
        raise ValueError("--identify-on needs a --recording to apply the fit to")


def with_parts(robot: ElasticRobot, path: str | None) -> ElasticRobot:
    """Robot with the drive-train parts of a file."""
    if path is None:
        return robot
    drives = load_drive_parts(path, robot.drives)
    return dataclasses.replace(robot, drives=drives)


def with_payload(robot: ElasticRobot, numbers: tuple[float, ...] | None):
    """Robot with the payload that was typed.

    Raises:
        ValueError: neither 0 nor seven numbers.
    """
    if numbers is None:
        return robot
    if numbers == (0.0,):
        return robot.with_payload(0.0, np.zeros(3), np.zeros((3, 3)))
    if len(numbers) != 7:
        raise ValueError(
            "--payload must give 7 numbers, the mass [kg], the centre of mass x y z "
            "[m] in the flange frame and the moments of inertia xx yy zz about it [kg "
            "m^2], "
            f"or a single 0 for none, but there are {len(numbers)}: a payload without "
            "inertia makes the model singular"
        )
    return robot.with_payload(numbers[0], np.array(numbers[1:4]), np.diag(numbers[4:]))


def compile_programs(
    robot: ElasticRobot,
    plant: ElasticRobot,
    reference: Reference,
    names: tuple[str, ...],
    progress: Progress,
) -> Compiled:
    """Compile the feed-forwards and the plant for one length of motion."""
    start = time.perf_counter()
    first = INVERSES[names[0]]
    command = jax.eval_shape(
        lambda m, r: bare(first.feedforward(m, r)), robot, reference
    )
    controller = CascadeMotorControl()
    # a failed simulation shows in its figures; an error raised from inside the program
    # would keep it out of the persistent cache
    drive = lambda p, c, r: run_command(p, c, r, controller, throw=False)
    jobs: dict[str, tuple] = {"elastic plant": (drive, plant, command, reference)}
    for name in names:
        inverse = INVERSES[name].feedforward
        jobs[f"{name} feed-forward"] = (inverse, robot, reference)
    # tracing takes Python, compiling does not: several at once
    with concurrent.futures.ThreadPoolExecutor() as pool:
        pending = []
        for what, (function, *args) in jobs.items():
            progress.say(f"compiling the {what} ...")
            lowered = jax.jit(lambda *x, f=function: f(*x)).lower(*args)
            pending.append(pool.submit(lowered.compile))
        compiled, *inverses = [job.result() for job in pending]
    return Compiled(dict(zip(names, inverses)), compiled, time.perf_counter() - start)


def bare(command: MotorCommand) -> MotorCommand:
    """The command without predicted deformations: one shape for every inverse."""
    return dataclasses.replace(command, eta=command.eta[:, :0])


def run_all(
    robot: ElasticRobot,
    plant: ElasticRobot,
    reference: Reference,
    programs: Compiled,
    progress: Progress,
) -> tuple[dict[str, Run], dict[str, dict]]:
    """Every feed-forward on the plant, and what a sample of it costs."""
    runs, cost = {}, {}
    for name, program in programs.inverses.items():
        progress.say(f"running {name} ...")
        command = jax.block_until_ready(program(robot, reference))
        start = time.perf_counter()
        jax.block_until_ready(program(robot, reference))
        seconds = (time.perf_counter() - start) / reference.times.shape[0]
        simulation, judgement = programs.plant(plant, bare(command), reference)
        runs[name] = Run(command, simulation, judgement)
        cost[name] = {"seconds_per_sample": seconds}
    return runs, cost


def stream_cost(name, robot, reference, progress) -> dict[str, float]:
    """Latency of single steps [s] over the motion, repeated to 10,000 steps."""
    inverse = INVERSES[name]
    samples = np.swapaxes(reference.derivatives[: inverse.order(robot) + 1], 0, 1)
    progress.say(f"compiling the step of {name} ...")
    streamed = compile_step(inverse, robot, float(reference.dt))
    progress.say(f"timing the step of {name} ...")
    times = latency(streamed, samples)
    return {
        "step_median_s": times.p50,
        "step_p99_s": times.p99,
        "step_p999_s": times.p999,
    }


def summary(run: Run) -> dict:
    """Figures of a run for the results, SI units."""
    judgement = run.judgement
    figures = {
        name: float(getattr(judgement, name))
        for name in (
            "criterion",
            "path_error_integral",
            "path_error_integral_relative",
            "path_error_max",
            "path_error_max_relative",
            "settling_time",
            "rest_time",
        )
    }
    figures["peak_motor_torque"] = np.asarray(judgement.peak_motor_torque).tolist()
    figures["peak_gear_torque"] = np.asarray(judgement.peak_gear_torque).tolist()
    return figures


def _finite(inverses: dict) -> bool:
    numbers = [np.ravel(v) for one in inverses.values() for v in one.values()]
    good = bool(np.all(np.isfinite(np.concatenate(numbers))))
    if not good:
        print("a figure is not finite: see result.json", file=sys.stderr)
    return good


def write(
    config: FeedforwardConfig,
    robot: ElasticRobot,
    motion: Motion,
    runs: dict[str, Run],
    perturbed: dict | None,
    grid: Grid | None,
    report,
    result: dict,
    arrays: dict,
    progress: Progress,
) -> None:
    """Results, pictures and command files into the folder of the run."""
    progress.say("drawing ...")
    arrays["times"] = np.asarray(motion.reference.times)
    arrays["reference"] = np.asarray(motion.reference.derivatives)
    for name, run in runs.items():
        for field in ("theta", "tau_m", "q", "eta"):
            arrays[f"{name}_command_{field}"] = np.asarray(getattr(run.command, field))
        for field in ("q", "eta", "theta", "tau_m", "tau_gear", "wrist_acceleration"):
            arrays[f"{name}_{field}"] = np.asarray(getattr(run.simulation, field))
        arrays[f"{name}_tool_position"] = np.asarray(run.simulation.tool_pose[:, :3, 3])
        arrays[f"{name}_path_error"] = np.asarray(run.judgement.path_error)
    commands = {}
    if config.rate is not None:
        commands = {
            f"commands_{name}.csv": command_csv(robot, run.command, config.rate)
            for name, run in runs.items()
        }
    drawn = figures(robot, motion, runs, perturbed, grid, report)
    folder = pathlib.Path(config.out)
    write_results(folder, result, arrays, drawn)
    for name, text in commands.items():
        (folder / name).write_text(text, encoding="utf-8")
    progress.say(f"results in {folder}")
    print(f"report: {folder / 'report.html'}")


def command_csv(robot: ElasticRobot, command: MotorCommand, rate: float) -> str:
    """Command at `rate` [Hz] as CSV on the motor side: t, theta, thetad, tau_m."""
    interpolant = CommandInterpolant(command)
    end = float(command.times[-1])
    times = np.arange(int(round(end * rate, 6)) + 1) / rate
    points = jax.jit(jax.vmap(interpolant))(jnp.asarray(times))
    drives = robot.drives
    ratio = np.asarray(drives.ratio)
    columns = [
        times[:, None],
        np.asarray(points.theta) * ratio,
        np.asarray(points.thetad) * ratio,
        np.asarray(points.tau_m) / ratio,
    ]
    axes = range(1, robot.axes + 1)
    header = ["t [s]"]
    header += [f"theta_{k} [rad]" for k in axes]
    header += [f"thetad_{k} [rad/s]" for k in axes]
    header += [f"tau_m_{k} [N m]" for k in axes]
    lines = [",".join(header)]
    lines += [",".join(f"{x:.12g}" for x in row) for row in np.hstack(columns)]
    return "\n".join(lines) + "\n"
