"""The table again with a model whose parameters are wrong."""

import dataclasses

import equinox as eqx

from ..control import Run
from ..dynamics import ElasticRobot
from ..signals import Reference
from ._progress import Progress


def perturbed_models(robot: ElasticRobot, fraction: float) -> dict[str, ElasticRobot]:
    """Models whose stiffness, damping or payload is off by plus or minus `fraction`."""
    models = {}
    for sign in (1, -1):
        factor = 1 + sign * fraction
        label = f"{sign * fraction:+.0%}"
        models[f"stiffness {label}"] = scale_stiffness(robot, factor)
        models[f"damping {label}"] = scale_damping(robot, factor)
        models[f"payload {label}"] = scale_payload(robot, factor)
    return models


def scale_stiffness(robot: ElasticRobot, factor: float) -> ElasticRobot:
    """Springs of gears and structure times `factor`."""
    gears, structure = robot.drives.stiffness, robot.structure_stiffness
    drives = dataclasses.replace(
        robot.drives, stiffness=None if gears is None else gears.scaled(factor)
    )
    springs = None if structure is None else structure.scaled(factor)
    return dataclasses.replace(robot, drives=drives, structure_stiffness=springs)


def scale_damping(robot: ElasticRobot, factor: float) -> ElasticRobot:
    """Dampers of gears and structure times `factor`."""
    return eqx.tree_at(
        lambda r: (r.drives.damping, r.structure_damping),
        robot,
        replace_fn=lambda d: d * factor,
    )


def scale_payload(robot: ElasticRobot, factor: float) -> ElasticRobot:
    """Mass and inertia of the payload times `factor`."""
    return eqx.tree_at(
        lambda r: (r.payload.mass, r.payload.inertia),
        robot,
        replace_fn=lambda x: x * factor,
    )


def run_perturbed(
    robot: ElasticRobot,
    plant: ElasticRobot,
    reference: Reference,
    programs,
    nominal: dict[str, Run],
    fraction: float,
    progress: Progress,
) -> dict[str, dict[str, dict[str, float]]]:
    """Path errors of every feed-forward with wrong models on the true plant.

    Returns:
        case -> inverse -> figures: integral and largest path error [m s], [m], and
        criterion [m/s].
    """
    from ._feedforward import bare

    def figures(judgement):
        return {
            name: float(getattr(judgement, name))
            for name in ("path_error_integral", "path_error_max", "criterion")
        }

    table = {"nominal": {n: figures(run.judgement) for n, run in nominal.items()}}
    for case, model in perturbed_models(robot, fraction).items():
        progress.say(f"model with {case} ...")
        table[case] = {}
        for name, program in programs.inverses.items():
            command = program(model, reference)
            _, judgement = programs.plant(plant, bare(command), reference)
            table[case][name] = figures(judgement)
    return table
