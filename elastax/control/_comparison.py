"""One feed-forward on the elastic plant: command, simulation, judgement."""

import equinox as eqx
import jax
from jaxtyping import Array, Float

from ..analysis import Judgement, judge
from ..dynamics import (
    AbstractMotorController,
    ElasticRobot,
    MotorCommand,
    SimulationResult,
    simulate,
)
from ..inverse import AbstractInverse
from ..kinematics import forward_kinematics
from ..signals import Reference


class Run(eqx.Module):
    """One motion under one feed-forward.

    Attributes:
        command: what the inverse asked of the motors.
        simulation: what the plant did.
        judgement: how well it did.
    """

    command: MotorCommand
    simulation: SimulationResult
    judgement: Judgement


def rigid_tool_path(
    robot: ElasticRobot, reference: Reference
) -> Float[Array, "times 3"]:
    """Path of the undeformed robot's tool on the reference [m], shape (times, 3)."""
    chain = robot.flexible_joint().chain
    poses = jax.vmap(lambda q: forward_kinematics(chain, q))(reference.positions)
    return poses[:, :3, 3]


def run_feedforward(
    plant: ElasticRobot,
    model: ElasticRobot,
    inverse: AbstractInverse,
    reference: Reference,
    controller: AbstractMotorController,
    **options,
) -> Run:
    """Feed-forward of `model` on `plant` under a motor controller.

    Args:
        plant: the robot that is simulated.
        model: the robot as the inverse knows it; the same unless parameters are wrong.
        inverse: the feed-forward.
        reference: filtered joint motion with derivatives; it must hold on for 0.9 s.
        controller: closes the loop at the motors.
        options: of `simulate`.

    References:
        [Reiner2010] chapter 6: the same filtered reference for every inverse.
    """
    command = inverse.feedforward(model, reference)
    simulation, judgement = run_command(
        plant, command, reference, controller, **options
    )
    return Run(command, simulation, judgement)


def run_command(
    plant: ElasticRobot,
    command: MotorCommand,
    reference: Reference,
    controller: AbstractMotorController,
    **options,
) -> tuple[SimulationResult, Judgement]:
    """Simulation of a command on the plant, and its figures.

    Args:
        plant, reference, controller, options: as for `run_feedforward`.
        command: of any inverse.
    """
    simulation = simulate(plant, command, controller, **options)
    path = rigid_tool_path(plant, reference)
    return simulation, judge(plant, simulation, path, reference.rest_time())
