"""`elastax info`: what a robot is made of."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np

from ..analysis import locked_frequencies
from ..dynamics import ElasticRobot
from ..io import UrdfWarning
from ..kinematics import Arm
from ..robots import named_model
from ._arguments import InfoConfig
from ._info_arm import kinematics_text
from ._progress import Progress
from ._tables import table


def info(config: InfoConfig, progress: Progress) -> int:
    """Print kinematics, axes, elastic coordinates, eigenfrequencies, and sources.

    Arms without dynamics show their kinematics only.

    Raises:
        ValueError: unknown robot or bad file.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = named_model(config.robot, base=config.base, tip=config.tip)
    if isinstance(model, Arm):
        turns = model.chain.number
        print(f"{model.name}: {turns} joints, kinematics only\n")
        print(kinematics_text(model), end="\n\n")
    else:
        _print_robot(model, progress)
    lists = [("Sources", model.sources), ("Assumed", model.assumptions)]
    lists += [
        (f"Left out of {w.message.label}, or doubtful", w.message.notes)
        for w in caught
        if isinstance(w.message, UrdfWarning)
    ]
    for title, lines in lists:
        if lines:
            print(f"{title}:")
            print("\n".join(f"  - {line}" for line in lines))
    for warning in caught:
        if not isinstance(warning.message, UrdfWarning):
            warnings.warn_explicit(
                warning.message, warning.category, warning.filename, warning.lineno
            )
    return 0


def _print_robot(robot: ElasticRobot, progress: Progress) -> None:
    progress.say("compiling the eigenfrequencies ...")
    mass = float(np.sum(robot.bodies.mass))
    mass += sum(float(link.body.mass) for link in robot.modal_links)
    load = float(np.sum(robot.payload.mass))
    print(
        f"{robot.name}: {robot.axes} axes, {robot.elastic} elastic coordinates, "
        f"moving mass {mass:.0f} kg, payload {load:g} kg\n"
    )
    print(kinematics_text(robot.arm()), end="\n\n")
    print(axes_table(robot), end="\n\n")
    if robot.elastic:
        print(structure_table(robot), end="\n\n")
    print("First eigenfrequencies with the motors locked [Hz]")
    print(frequency_table(robot), end="\n\n")


def axes_table(robot: ElasticRobot) -> str:
    """Limits and drive trains of the axes."""
    drives, limits = robot.drives, robot.limits
    stiffness = np.full(robot.axes, np.inf)
    if drives.stiffness is not None:
        stiffness = np.asarray(drives.stiffness.stiffness(jnp.zeros(robot.axes)))
    rows = [
        [
            name,
            f"{np.rad2deg(float(limits.lower[k])):g} .. "
            f"{np.rad2deg(float(limits.upper[k])):g}",
            f"{np.rad2deg(float(limits.velocity[k])):.0f}",
            f"{float(drives.ratio[k]):.2f}",
            f"{float(drives.reflected_inertia()[k]):.1f}",
            f"{stiffness[k]:.3g}",
            f"{float(drives.damping[k]):.3g}",
        ]
        for k, name in enumerate(robot.axis_names)
    ]
    return table(
        rows,
        [
            "axis",
            "limits [deg]",
            "speed [deg/s]",
            "gear ratio",
            "rotor [kg m^2]",
            "gear [N m/rad]",
            "damper [N m s/rad]",
        ],
    )


def structure_table(robot: ElasticRobot) -> str:
    """Springs and dampers of hinges, frequencies and damping ratios of modes."""
    assert robot.structure_stiffness is not None
    stiffness = np.asarray(
        robot.structure_stiffness.stiffness(jnp.zeros(robot.elastic))
    )
    damping = np.asarray(robot.structure_damping)
    hinges = [
        [name, f"{stiffness[k]:.3g}", f"{damping[k]:.3g}"]
        for k, name in enumerate(robot.elastic_names)
        if k not in robot.modal_coordinates
    ]
    modes = []
    for link in robot.modal_links:
        for k, mass in enumerate(np.diag(np.asarray(link.body.M_e)), link.first):
            size = np.sqrt(stiffness[k] * mass)
            hertz, ratio = stiffness[k] / size / (2 * np.pi), damping[k] / (2 * size)
            modes.append([robot.elastic_names[k], f"{hertz:.4g}", f"{ratio:.3g}"])
    texts = []
    if hinges:
        columns = ["elastic coordinate", "spring [N m/rad]", "damper [N m s/rad]"]
        texts.append(table(hinges, columns))
    if modes:
        columns = ["mode of a body", "frequency, frame held [Hz]", "damping ratio [-]"]
        texts.append(table(modes, columns))
    return "\n\n".join(texts)


def frequency_table(robot: ElasticRobot) -> str:
    """First three frequencies at the named poses, with elastic and rigid structure."""
    names = list(robot.poses)
    poses = jnp.stack([robot.poses[name] for name in names])
    variants = {"elastic structure": robot}
    if robot.elastic:
        variants["rigid structure"] = robot.flexible_joint()
    program = jax.jit(
        jax.vmap(lambda r, p: locked_frequencies(r, r.from_maker(p)), (None, 0))
    )
    found = {label: np.asarray(program(r, poses)) for label, r in variants.items()}
    rows = [
        [name, label, *(f"{f:.2f}" for f in frequencies[k][:3])]
        for k, name in enumerate(names)
        for label, frequencies in found.items()
    ]
    return table(rows, ["pose", "model", "f1", "f2", "f3"])
