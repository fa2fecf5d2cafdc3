"""How fast is the simulation of the elastic robot, against MuJoCo?

Both get the same robot: the KR210 without end slopes, counterbalance and Coulomb
friction, which MuJoCo does not have in this form. Its rotors are hinges with armature,
its gears are springs and dampers between rotor and axis, the motor control is linear.
First the accelerations of random states are compared, then the motion of 0.5 s.
MuJoCo runs its Runge-Kutta method, on one thread, with the largest step at which the
angles keep 1e-6 of their size; it holds the motor torques over a step. The reference
is our run at rtol 1e-10.
"""

import dataclasses
from collections.abc import Iterator

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import CoulombViscousFriction
from elastax.dynamics import (
    CommandInterpolant,
    ElasticRobot,
    MotorCommand,
    forward_dynamics,
    simulate,
)

from ._rows import Check, relative_difference, row
from ._systems import controller, move_commands, one_case, random_states, tree_robot
from ._timing import Effort, compile_timed, measure
from .peers import mujoco as peer


STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)  # s
INPUTS = ("q", "eta", "theta", "qd", "etad", "thetad", "tau_m")


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Accelerations first, then the motion."""
    robot = linear_robot()
    yield accelerations(robot, effort)
    yield motion(robot, effort)


def linear_robot() -> ElasticRobot:
    """What both packages can model."""
    robot = tree_robot()
    friction = robot.drives.motor_friction
    viscous = CoulombViscousFriction(
        friction.viscous, 0.0 * friction.coulomb, friction.steepness
    )
    drives = dataclasses.replace(robot.drives, motor_friction=viscous)
    return dataclasses.replace(robot, drives=drives, counterbalance=None)


def accelerations(robot: ElasticRobot, effort: Effort) -> dict:
    """Forward dynamics, one after another on both sides."""
    count = 256
    states = random_states(robot, count)
    batch = [jnp.asarray(states[name]) for name in INPUTS]

    def scan(robot, *batch):
        step = lambda _, state: (None, forward_dynamics(robot, *state))
        return jax.lax.scan(step, None, batch)[1]

    ours = compile_timed(scan, robot, *batch)
    model = peer.elastic_model(robot)
    positions = peer.coordinates(model, robot, *(states[k] for k in INPUTS[:3]))
    rates = peer.coordinates(model, robot, *(states[k] for k in INPUTS[3:6]))
    loop = peer.forward_loop(model, positions, rates, states["tau_m"])
    here, there = measure(effort, lambda: ours.call(robot, *batch), loop)
    found = peer.coordinates(model, robot, *ours.call(robot, *batch))
    return row(
        "mujoco_forward_dynamics",
        1e6 * here.best / count,
        "us",
        batch=count,
        threads=2,
        peer="mujoco mj_forward, 1 thread, from Python",
        peer_value=1e6 * there.best / count,
        max_difference=relative_difference(found, loop()),
        compile_s=ours.seconds,
        checks=(Check("max_difference", 1e-9, 7),),
        variant="scan",
        program_mib=ours.program_mib,
        note="gears, springs, dampers and motors on both sides",
    )


def motion(robot: ElasticRobot, effort: Effort) -> dict:
    """Closed loop over 0.5 s, to the same accuracy."""
    command = one_case(move_commands(robot))
    loop = lambda r, c: simulate(r, c, controller(), rtol=1e-6)
    ours = compile_timed(loop, robot, command)
    result = ours.call(robot, command)
    exact = jax.jit(
        lambda r, c: simulate(
            r, c, controller(), solver=dfx.Dopri8(), rtol=1e-10, atol=1e-13
        )
    )(robot, command)
    error = difference(result, exact)
    for step in STEPS:
        theirs = prepared(robot, command, result, step)
        peer_error = difference_of(theirs(), exact)
        if peer_error <= 1e-6:
            break
    here, there = measure(effort, lambda: ours.call(robot, command), theirs)
    return row(
        "mujoco_closed_loop_simulation",
        1e3 * here.best,
        "ms",
        threads=2,
        peer="mujoco rollout, RK4, 1 thread",
        peer_value=1e3 * there.best,
        max_difference=difference_of(theirs(), result),
        compile_s=ours.seconds,
        checks=(Check("max_difference", 1e-4, 7),),
        program_mib=ours.program_mib,
        error=error,
        peer_error=peer_error,
        note=(
            f"error to a run at rtol 1e-10: ours {error:.1e}, MuJoCo {peer_error:.1e} "
            f"with steps of {1e3 * step:g} ms; ours gives tool and torques as well"
        ),
    )


def _angles(result) -> list[np.ndarray]:
    return [np.asarray(getattr(result, name)) for name in ("q", "eta", "theta")]


def difference(result, exact) -> float:
    """Largest difference of the angles, each kind over its largest magnitude."""
    return difference_of(_angles(result), exact)


def difference_of(angles, exact) -> float:
    """The same of angles (q, eta, theta)."""
    pairs = zip(angles, _angles(exact), strict=True)
    return max(relative_difference(a[None], b[None]) for a, b in pairs)


def prepared(robot: ElasticRobot, command: MotorCommand, start, step: float):
    """Function that simulates with MuJoCo and returns angles at the command's times.

    The loop's proportional terms are springs and dampers of the rotors, the rest is the
    torque that the command asks for, held over every step at its middle.
    """
    loop = controller()
    inertia = np.asarray(robot.drives.reflected_inertia())
    damping = inertia * float(loop.speed_bandwidth)
    stiffness = damping * float(loop.position_gain)
    model = peer.elastic_model(robot, stiffness, damping, step)
    times = np.asarray(command.times)
    every = round((times[1] - times[0]) / step)
    middles = times[0] + step * (np.arange(every * (len(times) - 1)) + 0.5)
    asked = jax.jit(jax.vmap(CommandInterpolant(command)))(jnp.asarray(middles))
    torque = np.asarray(asked.tau_m) + damping * np.asarray(asked.thetad)
    torque = torque + stiffness * np.asarray(asked.theta)
    state = peer.coordinates(model, robot, *(x[:1] for x in _angles(start)))[0]
    return peer.rollout(model, robot, state, torque, every)
