"""Arguments of the command line and the frozen configurations they give."""

import argparse
import dataclasses
from typing import Any


INVERSES = ("rigid", "flexible_joint", "asim")


@dataclasses.dataclass(frozen=True)
class FeedforwardConfig:
    """What `elastax feedforward` is to do; angles in degrees, as typed.

    Attributes:
        robot: built-in name, TOML file or URDF.
        parts: TOML file of drive-train parts for plant and inverses, or `None`.
        plant_parts: the same for the plant alone.
        pose: named pose or one angle per axis [deg].
        move: angle per axis to move by [deg]; shorter lists leave the rest at rest.
        path: "rectangle" or a CSV file of way-points x, y, z [m], or `None`.
        payload: mass [kg], centre of mass x y z [m] in the flange frame, principal
            moments [kg m^2]; (0,) takes the payload off; `None` keeps it.
        inverses: which feed-forwards are compared.
        grid: poses per direction of the pose grid, or `None`.
        recording: recorded motion, `None` without.
        identify_on: recording that friction is fitted on, `recording` unless given.
        rate: rate of the command files [Hz], `None` writes none.
        perturb: relative error of the model's parameters, `None` without.
        cutoff: of the Bessel filter that delivers the reference's derivatives [Hz].
        filter_order: its order.
        stream: whether the time of single steps is measured.
        out: folder of the results.
        seed: kept in the results; nothing here draws random numbers.
        quiet: whether progress is silent.
    """

    robot: str = "kr210"
    parts: str | None = None
    plant_parts: str | None = None
    pose: tuple[str, ...] = ("stretched",)
    move: tuple[float, ...] = (5.0, 5.0, 5.0)
    path: str | None = None
    payload: tuple[float, ...] | None = None
    inverses: tuple[str, ...] = INVERSES
    grid: int | None = None
    recording: str | None = None
    identify_on: str | None = None
    rate: float | None = None
    perturb: float | None = None
    cutoff: float = 10.0
    filter_order: int = 6
    stream: bool = False
    out: str = "out/feedforward"
    seed: int = 0
    quiet: bool = False


@dataclasses.dataclass(frozen=True)
class InfoConfig:
    """What `elastax info` is to show.

    Attributes:
        robot: built-in name, TOML file or URDF.
        base, tip: links of a URDF between which the arm lies; the tree's unless given.
        quiet: whether progress is silent.
    """

    robot: str = "kr210"
    base: str | None = None
    tip: str | None = None
    quiet: bool = False


@dataclasses.dataclass(frozen=True)
class AnalyseConfig:
    """What `elastax analyse` is to do; angles in degrees, as typed.

    Attributes:
        robot: built-in name, TOML file or URDF.
        parts: TOML file of drive-train parts, or `None`.
        pose: named pose or one angle per axis [deg].
        payload: as for `feedforward`.
        input: "torque" or "angle" of the motors.
        axes: driven axes, from 1; the others are held.
        output: "tool", "motor" or "joint": place of the tool, or angles of the axes.
        directions: of the tool, of x, y, z.
        hold: "locked" motors of the other axes, or a "cascade" that controls them.
        grid: poses per direction of the map over A2 and A3, or `None`.
        sensitivity: whether derivatives by every parameter are computed.
        out: folder of the results.
        quiet: whether progress is silent.
    """

    robot: str = "kr210"
    parts: str | None = None
    pose: tuple[str, ...] = ("stretched",)
    payload: tuple[float, ...] | None = None
    input: str = "torque"
    axes: tuple[int, ...] = (1, 2, 3)
    output: str = "tool"
    directions: tuple[str, ...] = ("x", "y", "z")
    hold: str = "locked"
    grid: int | None = None
    sensitivity: bool = False
    out: str = "out/analyse"
    quiet: bool = False


Config = FeedforwardConfig | InfoConfig | AnalyseConfig


def parse(argv: list[str] | None) -> tuple[str, Config]:
    """Command and configuration; ends the program with status 2 on unknown options."""
    parser = argparse.ArgumentParser(
        prog="elastax",
        description="Structurally elastic industrial robots: feed-forward and models.",
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_feedforward(commands)
    _add_analyse(commands)
    info = commands.add_parser(
        "info", help="a robot's kinematics, axes, springs, eigenfrequencies, sources"
    )
    info.add_argument(
        "robot",
        nargs="?",
        default="kr210",
        metavar="NAME|FILE.toml|FILE.urdf",
        help="the robot; a URDF with gears in the TOML file beside it, or as an arm",
    )
    for link in ("base", "tip"):
        info.add_argument(f"--{link}", metavar="LINK", help=f"{link} link in a URDF")
    info.add_argument("--quiet", action="store_true", help="no progress")
    values = vars(parser.parse_args(argv))
    command = values.pop("command")
    values: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in values.items()
    }
    if command == "info":
        return command, InfoConfig(**values)
    if command == "analyse":
        return command, AnalyseConfig(**values)
    return command, FeedforwardConfig(**values)


def _add_robot(add, default) -> None:
    """Options that say which robot, with what in its hand, and where."""
    add("--robot", default=default.robot, metavar="NAME|FILE", help="the robot")
    add(
        "--parts",
        metavar="FILE.toml",
        help="other parts in the drive trains: friction, stiffness, hysteresis, lag; "
        "see examples/drive_parts",
    )
    add(
        "--payload",
        nargs="+",
        type=float,
        metavar="NUMBER",
        help="mass [kg], centre of mass x y z [m] in the flange frame, moments of "
        "inertia xx yy zz about it [kg m^2]; 0 takes the payload off",
    )
    add(
        "--pose",
        nargs="+",
        default=list(default.pose),
        metavar="POSE",
        help="named pose, or one angle per axis [deg]",
    )


def _add_output(add, default) -> None:
    add("--out", default=default.out, metavar="DIR", help="folder of the results")
    add("--quiet", action="store_true", help="no progress")


def _add_feedforward(commands) -> None:
    default = FeedforwardConfig()
    parser = commands.add_parser(
        "feedforward",
        help="compare rigid, flexible-joint and elastic (ASIM) feed-forward on a "
        "motion",
        description="Rigid, flexible-joint (RLFJ) and structurally elastic (ASIM) "
        "feed-forward of the same motion, each simulated on the full elastic robot "
        "under "
        "the same motor control. Without options: kr210 with 210 kg, 5 degrees on "
        "three axes from the stretched pose.",
        allow_abbrev=False,
    )
    add = parser.add_argument
    _add_robot(add, default)
    add(
        "--plant-parts",
        metavar="FILE.toml",
        help="other parts in the plant alone, exact (switching) ones included",
    )
    add(
        "--move",
        nargs="+",
        type=float,
        default=list(default.move),
        metavar="DEG",
        help="angle to move by, axis by axis [deg]",
    )
    add(
        "--path",
        metavar="rectangle|FILE.csv",
        help="straight Cartesian path instead of a move: the rectangle of figure 6.5, "
        "or way-points x, y, z [m] in the base frame; orientation stays",
    )
    add(
        "--inverse",
        dest="inverses",
        nargs="+",
        choices=INVERSES,
        default=list(INVERSES),
        help="which feed-forwards to compare",
    )
    add(
        "--grid",
        nargs="?",
        type=int,
        const=6,
        metavar="N",
        help="criterion over N x N poses of A2 and A3 for moves of 5 and 20 degrees",
    )
    add("--recording", metavar="FILE.mat|FILE.csv", help="follow a recorded motion")
    add(
        "--identify-on",
        metavar="FILE.mat|FILE.csv",
        help="fit friction and torque offset on this recording instead",
    )
    add(
        "--rate",
        type=float,
        metavar="HZ",
        help="write the commands as CSV at this rate, motor side",
    )
    add(
        "--perturb",
        type=float,
        metavar="FRACTION",
        help="the table again with the model's stiffness, damping, payload off by plus "
        "and minus this fraction",
    )
    add(
        "--cutoff",
        type=float,
        default=default.cutoff,
        help="of the reference filter [Hz]",
    )
    add("--filter-order", type=int, default=default.filter_order, help="of that filter")
    add(
        "--stream",
        action="store_true",
        help="measure the time of single steps of each inverse",
    )
    add("--seed", type=int, default=default.seed, help="kept in the results")
    _add_output(add, default)


def _add_analyse(commands) -> None:
    default = AnalyseConfig()
    parser = commands.add_parser(
        "analyse",
        help="eigenfrequencies, poles, zeros and zero dynamics at a pose or over poses",
        description="Linear model of a robot at rest: modes, poles, transmission "
        "zeros, relative degree, and whether an exact inverse is stable. Without "
        "options: kr210 stretched, from the motor torques of A1 to A3 to the place of "
        "the tool.",
        allow_abbrev=False,
    )
    add = parser.add_argument
    _add_robot(add, default)
    add(
        "--input",
        choices=("torque", "angle"),
        default=default.input,
        help="of the motors; angle: a stiff position loop imposes it",
    )
    add(
        "--axes",
        nargs="+",
        type=int,
        default=list(default.axes),
        metavar="N",
        help="driven axes, from 1",
    )
    add(
        "--output",
        choices=("tool", "motor", "joint"),
        default=default.output,
        help="place of the tool, or angles of the driven axes",
    )
    add(
        "--directions",
        nargs="+",
        choices=("x", "y", "z"),
        default=list(default.directions),
        help="of the tool",
    )
    add(
        "--hold",
        choices=("locked", "cascade"),
        default=default.hold,
        help="what holds the motors of the other axes",
    )
    add(
        "--grid",
        nargs="?",
        type=int,
        const=64,
        metavar="N",
        help="maps over N x N poses of A2 and A3 within their limits",
    )
    add(
        "--sensitivity",
        action="store_true",
        help="derivatives of zero and frequency by every parameter",
    )
    _add_output(add, default)
