"""Simulation of the elastic robot under a motor controller."""

import abc

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._custom_types import PerElastic, PerJoint, Times
from .._taylor import leading
from ..kinematics import moving_frames, transform
from ._block_form import forward_dynamics
from ._command import CommandInterpolant, MotorCommand, MotorSetpoint
from ._equilibrium import static_equilibrium
from ._newton_euler import chain_motion, joint_screws
from ._robot import ElasticRobot


class AbstractMotorController(eqx.Module):
    """Turns a setpoint and the measured motor motion into motor torques."""

    @abc.abstractmethod
    def motors(
        self, setpoint: MotorSetpoint, theta: PerJoint, thetad: PerJoint
    ) -> tuple[PerJoint, PerJoint]:
        """Motor angles and speeds that act on the gears.

        The integrated ones, unless the controller is ideal and imposes its own.
        """

    @abc.abstractmethod
    def torque(
        self,
        setpoint: MotorSetpoint,
        theta: PerJoint,
        thetad: PerJoint,
        inertia: PerJoint,
        load: PerJoint,
    ) -> PerJoint:
        """Motor torques on the output side [N m].

        Args:
            setpoint: what the feed-forward asks for now.
            theta, thetad: measured motor angles [rad] and speeds.
            inertia: motor inertias on the output side [kg m^2].
            load: what gear and friction ask of the motors, `h_m` [N m].
        """

    @abc.abstractmethod
    def resting_motors(
        self, setpoint: MotorSetpoint, load: PerJoint, inertia: PerJoint
    ) -> PerJoint:
        """Motor angles [rad] at which the loop rests under a static `load` [N m]."""


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


def simulate(
    robot: ElasticRobot,
    command: MotorCommand,
    controller: AbstractMotorController,
    *,
    times: Times | None = None,
    solver: dfx.AbstractSolver = dfx.Tsit5(),
    rtol: float = 1e-6,
    atol: float = 1e-9,
    max_steps: int = 100_000,
    adjoint: dfx.AbstractAdjoint = dfx.RecursiveCheckpointAdjoint(),
    throw: bool = True,
) -> SimulationResult:
    """Motion of the robot that a command and a motor controller cause.

    Starts from the static equilibrium of robot and loop at the first sample; after the
    last sample the command holds on.

    Args:
        robot: the plant; with elastic gears.
        command: what the feed-forward tells the motors.
        controller: closes the loop at the motors.
        times: where the motion is wanted [s]; the command's own times unless given.
        solver, rtol, atol, max_steps, adjoint, throw: as in diffrax; the state is
            (q, eta, theta) and its rate, in rad and rad/s.

    Raises:
        ValueError: the plant's gears are rigid.
    """
    if not robot.has_elastic_gears:
        raise ValueError(
            "simulate a robot with elastic gears; `rigid()` took them away"
        )
    times = command.times if times is None else times
    setpoint = CommandInterpolant(command)
    n, m = robot.axes, robot.elastic

    def split(x):
        half = n + m + n
        positions, velocities = x[:half], x[half:]
        return (
            positions[:n],
            positions[n : n + m],
            positions[n + m :],
            velocities[:n],
            velocities[n : n + m],
            velocities[n + m :],
        )

    def drive(t, x):
        q, eta, theta, qd, etad, thetad = split(x)
        now = setpoint(t)
        theta, thetad = controller.motors(now, theta, thetad)
        gear = robot.drives.gear_torque(q - theta, qd - thetad)
        load = robot.drives.motor_friction.torque(thetad) - gear
        inertia = robot.drives.reflected_inertia()
        tau_m = controller.torque(now, theta, thetad, inertia, load)
        return (q, eta, theta, qd, etad, thetad), tau_m, gear

    def vector_field(t, x, _):
        state, tau_m, _ = drive(t, x)
        accelerations = forward_dynamics(robot, *state, tau_m)
        return jnp.concatenate([*state[3:], *accelerations])

    q, eta, theta = resting_state(robot, setpoint(times[0]), controller)
    rest = jnp.zeros((n + m + n,), q.dtype)
    solution = dfx.diffeqsolve(
        dfx.ODETerm(vector_field),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=None,
        y0=jnp.concatenate([q, eta, theta, rest]),
        saveat=dfx.SaveAt(ts=times),
        stepsize_controller=dfx.PIDController(rtol=rtol, atol=atol),
        max_steps=max_steps,
        adjoint=adjoint,
        throw=throw,
    )

    def observe(t, x):
        (q, eta, theta, qd, etad, thetad), tau_m, gear = drive(t, x)
        qdd, etadd, thetadd = forward_dynamics(
            robot, q, eta, theta, qd, etad, thetad, tau_m
        )
        pose, velocity, acceleration, wrist = tool_state(
            robot, q, eta, qd, etad, qdd, etadd
        )
        return (
            q, eta, theta, qd, etad, thetad, qdd, etadd, thetadd, tau_m, -gear,
            pose, velocity, acceleration, wrist,
        )  # fmt: skip

    observed = jax.vmap(observe)(times, solution.ys)
    return SimulationResult(times, *observed, steps=solution.stats["num_steps"])


def resting_state(
    robot: ElasticRobot, setpoint: MotorSetpoint, controller: AbstractMotorController
) -> tuple[PerJoint, PerElastic, PerJoint]:
    """Static equilibrium of robot and loop: q, eta, theta [rad].

    The motors give way by their loop's static stiffness; a fixed number of
    substitutions converges by the ratio of the gravity's stiffness to the loop's.
    """
    inertia = robot.drives.reflected_inertia()
    zero = jnp.zeros_like(setpoint.theta)

    def substitute(theta, _):
        q, eta = static_equilibrium(robot, theta)
        load = -robot.drives.gear_torque(q - theta, zero)
        return controller.resting_motors(setpoint, load, inertia), None

    theta, _ = jax.lax.scan(substitute, setpoint.theta, None, length=8)
    q, eta = static_equilibrium(robot, theta)
    return q, eta, theta


def tool_state(
    robot: ElasticRobot,
    q: PerJoint,
    eta: PerElastic,
    qd: PerJoint,
    etad: PerElastic,
    qdd: PerJoint,
    etadd: PerElastic,
):
    """Pose, velocity, acceleration of the tool and acceleration of the wrist centre.

    Returns:
        Pose (4, 4) [m], velocity (6,) and acceleration (6,) of the tool in the base
        frame, acceleration of the wrist centre (3,) [m/s^2]; without gravity.
    """
    frames = moving_frames(robot.chain, robot.joint_coordinates(q, eta))
    twist, spatial = chain_motion(
        robot,
        joint_screws(robot, frames),
        robot.joint_coordinates(qd, etad),
        robot.joint_coordinates(qdd, etadd),
    )

    def at(point, joint):
        v, w = twist[joint, :3], twist[joint, 3:]
        a, alpha = spatial[joint, :3] + robot.gravity, spatial[joint, 3:]
        velocity = v + jnp.cross(w, point)
        acceleration = a + jnp.cross(alpha, point) + jnp.cross(w, velocity)
        return jnp.concatenate([velocity, w]), jnp.concatenate([acceleration, alpha])

    velocity, acceleration = at(frames.tool_position, robot.chain.number - 1)
    _, wrist = at(frames.position[robot.wrist], robot.wrist)
    pose = transform(leading(frames.tool_rotation), leading(frames.tool_position))
    return pose, velocity, acceleration, wrist[:3]
