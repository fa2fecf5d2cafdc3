"""`elastax analyse`: modes, poles, zeros and zero dynamics of a robot."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from ..analysis import (
    AbstractDrive,
    AbstractSensor,
    JointEncoder,
    LinearModel,
    MotorAngles,
    MotorEncoder,
    MotorTorques,
    RobotChannel,
    Sensitivity,
    ToolPosition,
    ZeroMap,
    linear_robot,
    sensitivities,
    zero_map,
)
from ..control import CascadeMotorControl
from ..dynamics import ElasticRobot
from ..io import versions, write_results
from ..plotting import (
    plot_bode,
    plot_frequency_map,
    plot_poles_and_zeros,
    plot_zero_map,
)
from ..robots import named_robot
from ._arguments import AnalyseConfig
from ._feedforward import with_parts, with_payload
from ._motion import check_limits, resolve_pose
from ._progress import Progress
from ._tables import table


SCHEMA = "elastax.analyse/1"
_SHOWN = 12  # rows of a table
_BATCH = 256


def analyse(config: AnalyseConfig, progress: Progress) -> int:
    """Print modes, zeros and the verdict, write the results.

    Args:
        config: what to do.
        progress: where to say what is going on.

    Returns:
        Exit status 0.

    Raises:
        ValueError: bad input, before any long computation.
    """
    robot = with_payload(named_robot(config.robot), config.payload)
    robot = with_parts(robot, config.parts)
    channel = channel_of(robot, config)
    pose = resolve_pose(robot, config.pose)
    check_limits(robot, pose, "the pose")
    poses = None if config.grid is None else grid_poses(robot, pose, config.grid)
    progress.say(
        f"{robot.name}: {robot.axes} axes, {robot.elastic} elastic coordinates"
    )
    progress.say("compiling the linear model ...")
    theta = robot.from_maker(jnp.deg2rad(jnp.asarray(pose)))
    model = linear_robot(robot, theta, channel)
    result = figures_of(model)
    result |= {
        "schema": SCHEMA,
        "robot": robot.name,
        "versions": versions(),
        "configuration": dataclasses.asdict(config),
        "pose": np.deg2rad(pose).tolist(),
        "sources": list(robot.sources),
        "assumptions": list(robot.assumptions),
    }
    print("\n\n".join([modes_table(model), zeros_text(model, result)]))
    arrays = {name: np.asarray(getattr(model, name)) for name in "ABCD"}
    arrays["poles"], arrays["zeros"] = np.asarray(model.poles()), model.zeros()
    slopes: list[Sensitivity] = []
    if config.sensitivity:
        progress.say("compiling the derivatives (a minute or two) ...")
        slopes = sensitivities(robot, theta, channel, degrees=_degrees(model))
        result["sensitivity"] = [s._asdict() for s in slopes]
        print("\n" + sensitivity_table(slopes))
    found = None
    if poses is not None:
        progress.say(f"compiling the map of {len(poses)} poses (a minute) ...")
        tell = lambda done: progress.say(f"{done} of {len(poses)} poses")
        found = zero_map(robot, poses, channel, batch=_BATCH, progress=tell)
        result["grid"] = map_summary(found)
        print("\n" + map_text(found))
        arrays["grid_poses"] = np.asarray(found.poses)
        for name in ("largest_real", "slowest_right", "frequency", "damping_ratio"):
            arrays[f"grid_{name}"] = np.asarray(getattr(found.figures, name))
        arrays["grid_regular"] = np.asarray(found.figures.regular, float)
    result["wall_s"] = progress.elapsed()
    progress.say("drawing ...")
    folder = write_results(config.out, result, arrays, pictures(model, found))
    progress.say(f"results in {folder}")
    print(f"\nreport: {folder / 'report.html'}")
    return 0


def channel_of(robot: ElasticRobot, config: AnalyseConfig) -> RobotChannel:
    """Inputs and outputs as typed.

    Raises:
        ValueError: unknown axes, or a held axis of a robot with rigid gears.
    """
    axes = tuple(k - 1 for k in config.axes)
    if any(not 0 <= k < robot.axes for k in axes) or len(set(axes)) != len(axes):
        raise ValueError(
            f"--axes must be different numbers of 1 to {robot.axes}, but are "
            f"{' '.join(map(str, config.axes))}"
        )
    hold = CascadeMotorControl() if config.hold == "cascade" else None
    drive: AbstractDrive = MotorTorques(axes, hold)
    if config.input == "angle":
        drive = MotorAngles(axes, hold)
    sensor: AbstractSensor = ToolPosition(
        tuple("xyz".index(d) for d in config.directions)
    )
    if config.output == "motor":
        if config.input == "angle":
            raise ValueError(
                "--output motor with --input angle measures the input itself: take "
                "--output joint or tool"
            )
        sensor = MotorEncoder(axes)
    elif config.output == "joint":
        sensor = JointEncoder(axes)
    return RobotChannel(drive, sensor)


def grid_poses(robot: ElasticRobot, pose: np.ndarray, count: int) -> np.ndarray:
    """Poses of A2 and A3 over their limits [rad], the others as at the pose.

    Raises:
        ValueError: too few poses, or a robot without these axes.
    """
    if count < 2:
        raise ValueError(f"--grid must be 2 or more poses, but is {count}")
    if robot.axes < 3:
        raise ValueError(f"--grid needs three axes, but {robot.name} has {robot.axes}")
    lower, upper = np.asarray(robot.limits.lower), np.asarray(robot.limits.upper)
    second = np.linspace(lower[1], upper[1], count)
    third = np.linspace(lower[2], upper[2], count)
    poses = np.tile(np.deg2rad(pose), (count * count, 1))
    poses[:, 1], poses[:, 2] = (x.ravel() for x in np.meshgrid(second, third))
    return poses


def _degrees(model: LinearModel) -> tuple[int, ...]:
    """Orders of the infinite zeros, of an invertible square system."""
    structure = model.zero_structure()
    counts = len(model.names.inputs), len(model.names.outputs)
    if counts[0] != counts[1] or structure.normal_rank != counts[0]:
        raise ValueError(
            "--sensitivity needs as many outputs as inputs, and outputs that they can "
            f"set one by one; there are {counts[0]} inputs and {counts[1]} outputs"
        )
    direct = counts[0] - len(structure.infinite)
    return (0,) * direct + structure.infinite


def figures_of(model: LinearModel) -> dict:
    """Numbers of a linear model for the results."""
    modes, structure = model.modes(), model.zero_structure()
    zeros = structure.finite
    right = right_zeros(zeros)
    on_axis = len(zeros) - len(right) - len(right_zeros(-zeros))
    counts = len(model.names.inputs), len(model.names.outputs)
    square = counts[0] == counts[1] == structure.normal_rank
    return {
        "names": dataclasses.asdict(model.names),
        "modes": {
            "frequency": np.asarray(modes.frequency).tolist(),
            "damping_ratio": np.asarray(modes.damping_ratio).tolist(),
        },
        "zeros": {
            "real": np.real(zeros).tolist(),
            "imaginary": np.imag(zeros).tolist(),
        },
        "infinite_zeros": list(structure.infinite),
        "normal_rank": structure.normal_rank,
        "rank_tolerance": structure.tolerance,
        "right_zeros": len(right),
        "zeros_on_the_axis": on_axis,
        "slowest_right_zero": float(np.abs(right).min()) if len(right) else None,
        "invertible": bool(square),
        "stable_inverse": bool(square and not len(right) and not on_axis),
    }


def right_zeros(zeros: np.ndarray) -> np.ndarray:
    """Zeros in the right half-plane, but for rounding."""
    return zeros[np.real(zeros) > 1e-9 * np.abs(zeros).max(initial=0.0)]


def modes_table(model: LinearModel) -> str:
    """Frequency, damping and the three states that take part most."""
    modes = model.modes()
    share, damped = np.asarray(modes.participation), np.asarray(modes.damped_frequency)
    rows = []
    for k in np.flatnonzero(damped >= 0)[:_SHOWN]:
        part = np.argsort(-share[:, k])[:3]
        rows.append(
            [
                f"{float(modes.frequency[k]):.3f}",
                f"{100 * float(modes.damping_ratio[k]):.2f}",
                ", ".join(f"{model.names.states[i]} {share[i, k]:.0%}" for i in part),
            ]
        )
    titles = ["mode [Hz]", "damping [%]", "states that take part"]
    return table(rows, titles)


def zeros_text(model: LinearModel, result: dict) -> str:
    """Channel, zeros and the verdict."""
    zeros = model.zeros()
    lines = [
        f"from {', '.join(model.names.inputs)}",
        f"to   {', '.join(model.names.outputs)}",
        f"orders of the infinite zeros {tuple(result['infinite_zeros'])}, "
        f"{len(zeros)} finite zeros",
    ]
    if not result["invertible"]:
        lines.append(
            f"no inverse: the transfer matrix of {len(model.names.inputs)} inputs and "
            f"{len(model.names.outputs)} outputs has rank {result['normal_rank']}"
        )
        return "\n".join(lines)
    order = zeros[np.argsort(np.abs(zeros))]
    rows = [
        [f"{z.real:.4g}", f"{abs(z.imag):.4g}", f"{abs(z) / (2 * np.pi):.4g}"]
        for z in order[np.imag(order) >= 0][:_SHOWN]
    ]
    titles = ["zero, real [1/s]", "+- imaginary [rad/s]", "size [Hz]"]
    right = result["right_zeros"]
    verdict = "all zeros lie on the left: the exact inverse is stable"
    if result["zeros_on_the_axis"]:
        verdict = (
            f"{result['zeros_on_the_axis']} zeros on the imaginary axis, none on the "
            "right: the exact inverse is not asymptotically stable"
        )
    if right:
        verdict = (
            f"{right} zeros on the right, the nearest "
            f"{result['slowest_right_zero']:.4g} 1/s from the origin: the exact "
            "inverse is unstable"
        )
    return "\n".join([*lines, table(rows, titles), verdict])


def sensitivity_table(slopes: list[Sensitivity]) -> str:
    """The parameters that matter most."""
    rows = [
        [s.name, f"{s.value:.4g}", f"{s.frequency:.3f}", f"{s.zero:.3f}"]
        for s in slopes[:_SHOWN]
    ]
    titles = ["parameter", "value", "first frequency, % per %", "right zero, % per %"]
    return table(rows, titles)


def map_summary(found: ZeroMap) -> dict:
    """Numbers of a map for the results."""
    regular = np.asarray(found.figures.regular)
    slowest = np.asarray(found.figures.slowest_right)[regular]
    frequency = np.asarray(found.figures.frequency)
    some = slowest[np.isfinite(slowest)]
    return {
        "poses": len(regular),
        "masked": found.masked,
        "with_right_zeros": found.unstable,
        "relative_degrees": list(found.degrees),
        "slowest_right_zero": [float(x) for x in np.percentile(some, [0, 50, 100])]
        if some.size
        else None,
        "first_frequency": [float(x) for x in np.percentile(frequency, [0, 50, 100])],
    }


def map_text(found: ZeroMap) -> str:
    """A map in two lines."""
    numbers = map_summary(found)
    low, middle, high = numbers["first_frequency"]
    lines = [
        f"{numbers['poses']} poses: {numbers['with_right_zeros']} with zeros on the "
        f"right, {numbers['masked']} masked (singular decoupling matrix)",
        f"first locked eigenfrequency {low:.2f} to {high:.2f} Hz, "
        f"median {middle:.2f} Hz",
    ]
    if numbers["slowest_right_zero"] is not None:
        low, middle, high = numbers["slowest_right_zero"]
        lines.append(
            f"right zero nearest to the origin {low:.3g} to {high:.3g} 1/s, median "
            f"{middle:.3g} 1/s"
        )
    return "\n".join(lines)


def pictures(model: LinearModel, found: ZeroMap | None):
    """Figures of the report."""
    frequency = np.asarray(model.modes().frequency)
    some = frequency[frequency > 1e-3]
    span = np.geomspace(0.1, max(10.0, 2.0 * float(np.median(some))), 400)
    drawn = [
        (
            "poles_and_zeros",
            "Poles and zeros",
            "Crosses: poles; circles: zeros. Zeros on the right make the exact inverse "
            "unstable.",
            plot_poles_and_zeros({"model": model}),
        ),
        (
            "frequency_response",
            "Frequency response",
            "Magnitude and phase of every channel.",
            plot_bode({"model": model}, span, title="Frequency response"),
        ),
    ]
    if found is not None:
        drawn += [
            (
                "zero_map",
                "Zeros over the workspace",
                "Grey: no relative degree there; white: no zero on the right.",
                plot_zero_map(found, title="Transmission zeros over the workspace"),
            ),
            (
                "frequency_map",
                "Eigenfrequency over the workspace",
                "All motors locked.",
                plot_frequency_map(found, title="First eigenfrequency, motors locked"),
            ),
        ]
    return drawn
