"""Runs of feed-forwards on the plant; the figures of the main comparison."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import criterion
from elastax.control import (
    CascadeMotorControl,
    IdealMotorControl,
    rigid_tool_path,
    run_feedforward,
)
from elastax.dynamics import tool_state
from elastax.inverse import ASIM, FlexibleJointInverse, RigidInverse
from elastax.kinematics import forward_kinematics
from elastax.robots import kr210
from elastax.signals import BesselFilter, Reference
from elastax.trajectory import PointToPoint

from tests import systems
from tests.helpers import assert_close
from tests.runs import feedforward, run


def test_flexible_joint_plant_is_followed_exactly():
    """Without structural elasticity the flexible-joint inverse leaves no error."""
    plant = systems.elastic_2r().flexible_joint()
    reference = systems.smooth_reference([0.3, -0.9], [0.3, 0.4], settle=1.0)
    controller = CascadeMotorControl()
    made = eqx.filter_jit(run_feedforward)(
        plant, plant, FlexibleJointInverse(), reference, controller
    )
    # what the interpolation of the sampled command leaves, 7e-8 m on an arm of 1 m
    assert made.judgement.path_error_max < 1e-6
    assert made.judgement.settling_time < 1e-3

    @jax.jit
    @jax.vmap
    def wrist_acceleration(q, qd, qdd):
        none = jnp.zeros((0,))
        return tool_state(plant, q, none, qd, none, qdd, none)[3]

    # from t_0 on the reference itself still slows down, from 1e-3 of its peak speed
    slowing = wrist_acceleration(*reference.derivatives[:3])
    least = criterion(reference.times, slowing, reference.rest_time())
    assert_close(made.judgement.criterion, least, rtol=2e-3)
    path = rigid_tool_path(plant, reference)
    ends = [forward_kinematics(plant.chain, q) for q in reference.positions[::200]]
    assert_close(path[::200], [pose[:3, 3] for pose in ends], rtol=1e-13, atol=1e-15)


@pytest.fixture(scope="module")
def robot():
    return kr210()


def move(robot, pose: str, cutoff: float = 10.0) -> Reference:
    """5 degrees on three axes from a named pose, filtered."""
    start = robot.poses[pose]
    end = start + jnp.deg2rad(jnp.array([5.0, 5.0, 5.0, 0.0, 0.0, 0.0]))
    limits = robot.limits
    motion = PointToPoint(
        robot.from_maker(start),
        robot.from_maker(end),
        limits.velocity,
        limits.acceleration,
        limits.jerk,
    )
    return sampled(motion, float(motion.duration), BesselFilter(6, cutoff))


@eqx.filter_jit
def sampled(motion, duration: float, filter) -> Reference:
    return Reference.from_position_function(
        motion.position, duration, 1e-3, filter=filter, settle=1.2
    )


@pytest.fixture(scope="module")
def runs(robot):
    """The default move with all three feed-forwards."""
    reference = move(robot, "stretched")
    inverses = {
        "rigid": RigidInverse(),
        "flexible": FlexibleJointInverse(),
        "asim": ASIM(),
    }
    return {
        name: run(robot, robot, inverse, reference, CascadeMotorControl())
        for name, inverse in inverses.items()
    }


@pytest.mark.slow
def test_main_figure_in_miniature(runs):
    """ASIM leaves at most 15 % of the flexible-joint path error, and that is best."""
    judgements = {name: made.judgement for name, made in runs.items()}
    for figure in (
        "path_error_integral",
        "path_error_integral_relative",
        "path_error_max",
        "criterion",
    ):
        values = {k: float(getattr(j, figure)) for k, j in judgements.items()}
        assert values["asim"] < values["flexible"] < values["rigid"], (figure, values)
        if figure.startswith("path_error_integral"):
            assert values["asim"] <= 0.15 * values["flexible"], (figure, values)


@pytest.mark.slow
def test_wrong_deformations_show(robot, runs):
    """A model whose structure gives way by 0.7 of the plant's fails the figure."""
    model = dataclasses.replace(
        robot,
        structure_stiffness=robot.structure_stiffness.scaled(1.0 / 0.7),
        structure_damping=robot.structure_damping / 0.7,
    )
    made = run(robot, model, ASIM(), move(robot, "stretched"), CascadeMotorControl())
    flexible = runs["flexible"].judgement
    for figure in ("path_error_integral", "path_error_integral_relative"):
        ratio = float(getattr(made.judgement, figure) / getattr(flexible, figure))
        assert ratio > 0.2, (figure, ratio)


@pytest.mark.slow
def test_command_agrees_with_the_plant(robot, runs):
    """What ASIM predicts inside the robot is what the plant does."""
    made = runs["asim"]
    for name in ("q", "theta", "eta"):
        predicted = np.asarray(getattr(made.command, name))
        found = np.asarray(getattr(made.simulation, name))
        swing = np.abs(predicted - predicted[:1]).max()
        assert np.abs(found - predicted).max() < 0.1 * swing, name


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["stretched", "upright", "cannon"])
def test_bounded_at_named_poses(pose, robot):
    """Finite everywhere, corrections below the error over twice the damping."""
    reference = move(robot, pose)
    inverse = ASIM()
    command = feedforward(inverse, robot, reference)
    for leaf in jax.tree.leaves(command):
        assert np.all(np.isfinite(leaf))

    @jax.jit
    @jax.vmap
    def error(q, eta):
        tool = lambda eta: forward_kinematics(
            robot.chain, robot.joint_coordinates(q, eta)
        )[:3, 3]
        return jnp.linalg.norm(tool(eta) - tool(jnp.zeros_like(eta)))

    deformed = error(reference.positions, command.eta)
    correction = jnp.linalg.norm(command.q - reference.positions, axis=1)
    smallest = float(inverse.damping.law.minimum)
    assert np.all(correction <= deformed / (2.0 * smallest))
    if pose != "cannon":
        # at the singular poses themselves the damping is within 10 % of its largest
        largest = 0.9 * float(inverse.damping.law.maximum)
        assert correction[0] <= deformed[0] / (2.0 * largest)
    assert np.abs(correction).max() < 0.02


@pytest.mark.slow
def test_ideal_control_leaves_what_the_structure_leaves(robot, runs):
    """Motors that follow exactly: the error is that of the inverse alone."""
    made = run(robot, robot, ASIM(), move(robot, "stretched"), IdealMotorControl())
    flexible = runs["flexible"].judgement.path_error_integral
    assert made.judgement.path_error_integral < 0.15 * flexible
    assert_close(made.simulation.theta, made.command.theta, rtol=0, atol=1e-12)
