"""Simulation of the elastic robot under a motor controller."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._custom_types import PerElastic, PerJoint, Scalar, Times
from .._kernel import kernel
from ._closed_loop import (
    AbstractMotorController,
    LoopState,
    loop_rates,
    observe,
    state_shapes,
)
from ._command import CommandInterpolant, MotorCommand, MotorSetpoint
from ._equilibrium import static_load
from ._gear_loads import resting_loads
from ._robot import ElasticRobot
from ._switching import simulate_switching
from ._switching_loop import SwitchingLoop


_RATE = 10.0  # [1/s], absolute tolerance of speeds over that of angles
_TORQUE = 1e6  # [N m/rad], the same of torques
_NEWTON_STEPS = 16  # of the resting state; four reach rounding
_CHECKPOINTS = 512  # one per step of 0.5 s; longer motions are recomputed in parts


class SimulationResult(eqx.Module):
    """Motion of a simulated robot; the leading axis of every field is time.

    Attributes:
        times: [s].
        q, eta, theta: joint angles, elastic coordinates, motor angles [rad].
        qd, etad, thetad: their velocities [rad/s].
        qdd, etadd, thetadd: their accelerations [rad/s^2].
        tau_m: motor torques on the output side [N m].
        tau_gear: torques of the gears, output side [N m], positive on the links.
        tool_pose: pose of the tool in the base frame, (times, 4, 4) [m].
        tool_velocity, tool_acceleration: of the tool, base frame, translation above
            rotation, (times, 6).
        wrist_acceleration: of the wrist centre, base frame, (times, 3) [m/s^2].
        steps: accepted and rejected steps of the solver.
        modes: of motors that can stick, +1, -1 for their direction and 0 at rest,
            (times, axes); `None` where no part switches.
    """

    times: Times
    q: Float[Array, "times axes"]
    eta: Float[Array, "times elastic"]
    theta: Float[Array, "times axes"]
    qd: Float[Array, "times axes"]
    etad: Float[Array, "times elastic"]
    thetad: Float[Array, "times axes"]
    qdd: Float[Array, "times axes"]
    etadd: Float[Array, "times elastic"]
    thetadd: Float[Array, "times axes"]
    tau_m: Float[Array, "times axes"]
    tau_gear: Float[Array, "times axes"]
    tool_pose: Float[Array, "times 4 4"]
    tool_velocity: Float[Array, "times 6"]
    tool_acceleration: Float[Array, "times 6"]
    wrist_acceleration: Float[Array, "times 3"]
    steps: Int[Array, ""]
    modes: Float[Array, "times axes"] | None = None


def simulate(
    robot: ElasticRobot,
    command: MotorCommand,
    controller: AbstractMotorController,
    *,
    times: Times | None = None,
    solver: dfx.AbstractSolver = dfx.Tsit5(),
    stepsize_controller: dfx.AbstractStepSizeController | None = None,
    step: Scalar | float | None = None,
    rtol: Scalar | float = 1e-6,
    atol: Scalar | float = 1e-9,
    max_steps: int = 100_000,
    adjoint: dfx.AbstractAdjoint = dfx.RecursiveCheckpointAdjoint(_CHECKPOINTS),
    throw: bool = True,
) -> SimulationResult:
    """Motion of the robot that a command and a motor controller cause.

    Plants with parts that switch, such as dry friction, are integrated from event to
    event (`simulate_switching`); they take explicit Runge-Kutta methods, tolerances and
    `step` alone, and their result is not differentiated.

    Starts from the static equilibrium of robot and loop at the first sample; after the
    last sample the command holds on.

    The first and the largest step is one sample of the command: the interpolated
    command has a kink at every sample, and where each step ends at one the error is ten
    times smaller. Steps get shorter where the tolerances ask for it. With
    `stepsize_controller=diffrax.ConstantStepSize()` all have the length `step`, so that
    the cost is known beforehand; an explicit solver is stable up to about 3.3 over the
    largest eigenvalue (1.5 ms for the KR210).

    Args:
        robot: the plant; with elastic gears.
        command: what the feed-forward tells the motors.
        controller: closes the loop at the motors.
        times: where the motion is wanted [s]; the command's own times unless given.
        solver: any of diffrax for an ordinary differential equation.
        stepsize_controller: of diffrax, instead of the one that `rtol` and `atol` make.
        step: first and largest step [s]; the time between the command's samples unless
            given. It has no derivative.
        rtol: relative tolerance of a step.
        atol: absolute tolerance of a step, of the angles [rad]; that of the speeds and
            of a controller's own states is 10 times larger [rad/s], that of the torques
            of motors with a lag a million times [N m].
        max_steps, throw: as in diffrax.
        adjoint: as in diffrax; forward sensitivities (`jax.jvp`, `jax.jacfwd`) need
            `diffrax.ForwardMode()`.

    Raises:
        ValueError: the plant's gears are rigid.
    """
    if not robot.has_elastic_gears:
        raise ValueError(
            "simulate a robot with elastic gears; `rigid()` took them away"
        )
    times = command.times if times is None else times
    step = command.times[1] - command.times[0] if step is None else jnp.asarray(step)
    step = jax.lax.stop_gradient(step)
    setpoint = CommandInterpolant(command)
    if stepsize_controller is None:
        stepsize_controller = dfx.PIDController(
            rtol=rtol,
            atol=atol * jnp.asarray(_scales(robot, controller), times.dtype),
            pcoeff=0.1,
            icoeff=0.3,
            dtmax=step,
        )

    def vector_field(t, x, _):
        return loop_rates(robot, controller, setpoint(t), x)

    start = resting_loop(robot, setpoint(times[0]), controller)
    if robot.drives.switches:
        return _simulate_switching(
            SwitchingLoop(robot, controller, setpoint),
            start.vector(),
            times,
            solver=solver,
            step=step,
            rtol=rtol,
            atol=atol * jnp.asarray(_scales(robot, controller), times.dtype),
            max_steps=max_steps,
            throw=throw,
        )
    solution = dfx.diffeqsolve(
        dfx.ODETerm(vector_field),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=step,
        y0=start.vector(),
        saveat=dfx.SaveAt(ts=times),
        stepsize_controller=stepsize_controller,
        max_steps=max_steps,
        adjoint=adjoint,
        throw=throw,
    )

    observed = jax.vmap(lambda t, x: observe(robot, controller, setpoint(t), x))(
        times, solution.ys
    )
    return SimulationResult(times, *observed, steps=solution.stats["num_steps"])


def _simulate_switching(system: SwitchingLoop, x0, times, **options):
    """The same for drive trains with parts that switch, motors at rest first."""
    rest = jnp.zeros((system.robot.axes,), x0.dtype)
    motion = simulate_switching(system, x0, rest, times, **options)

    def observed(t, x, mode):
        given = mode if system.robot.drives.sticks else None
        return observe(system.robot, system.controller, system.setpoint(t), x, given)

    shown = jax.vmap(observed)(times, motion.x, motion.mode)
    return SimulationResult(times, *shown, steps=motion.steps, modes=motion.mode)


def _scales(robot: ElasticRobot, controller: AbstractMotorController) -> np.ndarray:
    """Absolute tolerances of the parts of the state, in those of the angles."""
    parts = (1.0, 1.0, 1.0, _RATE, _RATE, _RATE, 1.0, _TORQUE, _RATE)
    shapes = state_shapes(robot, controller)
    return np.concatenate([np.full(np.prod(s), p) for s, p in zip(shapes, parts)])


def resting_loop(
    robot: ElasticRobot, setpoint: MotorSetpoint, controller: AbstractMotorController
) -> LoopState:
    """The whole state of robot and loop at rest under a setpoint."""
    q, eta, theta = resting_state(robot, setpoint, controller)
    _, load = resting_loads(robot, q, theta)
    drives, still = robot.drives, jnp.zeros_like(q)
    return LoopState(
        q,
        eta,
        theta,
        still,
        jnp.zeros_like(eta),
        still,
        drives.resting_memory(q - drives.behind_teeth(theta)),
        load[:0] if drives.motor.lag is None else load,
        controller.resting_memory(setpoint, load, drives.reflected_inertia()),
    )


def resting_state(
    robot: ElasticRobot, setpoint: MotorSetpoint, controller: AbstractMotorController
) -> tuple[PerJoint, PerElastic, PerJoint]:
    """Static equilibrium of robot and loop: q, eta, theta [rad].

    Newton's method for all of them at once, differentiated implicitly: the motors give
    way by their loop's static stiffness to the load of the gears.
    """
    n, m = robot.axes, robot.elastic
    x = _rest(robot, setpoint, controller)
    q, eta, theta = jnp.split(x, [n, n + m])
    return q, eta, theta


@kernel
def _unrest(robot, setpoint, controller, x):
    """Torques and motor angles by which x = (q, eta, theta) is not at rest."""
    n, m = robot.axes, robot.elastic
    q, eta, theta = jnp.split(x, [n, n + m])
    joint, structure = static_load(robot, q, eta)
    gear, load = resting_loads(robot, q, theta)
    inertia = robot.drives.reflected_inertia()
    motors = controller.resting_motors(setpoint, load, inertia)
    return jnp.concatenate([joint + gear, structure, theta - motors])


def _slope(robot, setpoint, controller, x):
    return jax.jacfwd(lambda y: _unrest(robot, setpoint, controller, y))(x)


@jax.custom_jvp
def _rest(robot, setpoint, controller):
    start = jnp.zeros((robot.elastic,), setpoint.theta.dtype)
    start = jnp.concatenate([setpoint.theta, start, setpoint.theta])
    enough = 0.1 * np.sqrt(jnp.finfo(start.dtype).eps)  # the next step is its square

    def onwards(carry):
        _, size, count = carry
        return (size > enough) & (count < _NEWTON_STEPS)

    def step(carry):
        x, _, count = carry
        slope = _slope(robot, setpoint, controller, x)
        change = jnp.linalg.solve(slope, _unrest(robot, setpoint, controller, x))
        return x - change, jnp.max(jnp.abs(change)), count + 1

    first = (start, jnp.full((), jnp.inf, start.dtype), 0)
    return jax.lax.while_loop(onwards, step, first)[0]


@_rest.defjvp
def _rest_jvp(primals, tangents):
    robot, setpoint, controller = primals
    x = _rest(robot, setpoint, controller)
    off = lambda robot, setpoint, controller: _unrest(robot, setpoint, controller, x)
    _, moved = jax.jvp(off, primals, tangents)
    return x, -jnp.linalg.solve(_slope(robot, setpoint, controller, x), moved)
