"""Robots, states and motions that the benchmarks share."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.control import CascadeMotorControl
from elastax.drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    LinearStiffness,
    Motor,
)
from elastax.dynamics import (
    Axis,
    Body,
    ElasticJoint,
    ElasticRobot,
    JointLimits,
    MotorCommand,
    Offset,
    assemble,
)
from elastax.inverse import ASIM
from elastax.robots import kr210
from elastax.signals import BesselFilter, Reference
from elastax.trajectory import PointToPoint
from jax.sharding import Mesh, NamedSharding, PartitionSpec


DT = 1e-3  # s
BATCH = 4096


def tree_robot() -> ElasticRobot:
    """The KR210 without end slopes: 14 joints, each with a coordinate of its own."""
    robot = kr210()
    return dataclasses.replace(robot, slopes=jnp.zeros_like(robot.slopes))


def random_states(
    robot: ElasticRobot, count: int, seed: int = 0
) -> dict[str, np.ndarray]:
    """Random states, accelerations and motor torques, one per row.

    Sizes are those of a robot at work: joints anywhere, gears and structure bent by
    some 1e-3 rad, speeds near 1 rad/s.
    """
    rng = np.random.default_rng(seed)
    n, m = robot.axes, robot.elastic
    normal = lambda scale, size: scale * rng.standard_normal((count, size))
    q, qd = rng.uniform(-2.0, 2.0, (count, n)), normal(1.0, n)
    return {
        "q": q,
        "eta": normal(2e-3, m),
        "theta": q + normal(1e-3, n),
        "qd": qd,
        "etad": normal(0.05, m),
        "thetad": qd + normal(0.02, n),
        "qdd": normal(5.0, n),
        "etadd": normal(5.0, m),
        "thetadd": normal(5.0, n),
        "tau_m": normal(1e3, n),
    }


def spread(robot: ElasticRobot, batch: list) -> tuple[ElasticRobot, list]:
    """The robot on every device of JAX, the batch split over them.

    As data lie that are computed with again and again; `over_devices` would else move
    them in every call.
    """
    mesh = Mesh(np.array(jax.devices()), ("batch",))
    place = lambda spec: NamedSharding(mesh, spec)
    split = [jax.device_put(x, place(PartitionSpec("batch"))) for x in batch]
    return jax.device_put(robot, place(PartitionSpec())), split


def chain_robot(axes: int, elastic: int = 0) -> ElasticRobot:
    """Arm of equal links whose axes alternate; hinges are spread over the links."""
    name, turns = f"arm of {axes} axes, {elastic} hinges", (0.0, np.pi / 2)
    mass, length = 10.0 / axes, 2.0 / axes
    inertia = np.eye(3) * 0.05
    hinges = np.diff(np.linspace(0, elastic, axes + 1).round().astype(int))
    parts: list = [Offset((0.0, 0.0, 0.3))]
    for k in range(axes):
        parts += [Axis(f"A{k + 1}"), Body(f"drum {k}", mass, (0.0, 0.0, 0.1), inertia)]
        for i in range(hinges[k]):
            axis = tuple(np.eye(3)[i % 3])
            parts += [
                Offset((0.1 * length, 0.0, 0.0)),
                ElasticJoint(f"hinge {k} {i}", axis, 2e4, 20.0),
                Body(f"link {k} {i}", mass, (0.1, 0.0, 0.0), inertia),
            ]
        c, s = np.cos(turns[k % 2]), np.sin(turns[k % 2])
        turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        parts.append(Offset((length, 0.0, 0.0), turn))
    one = np.ones(axes)
    viscous = lambda value: CoulombViscousFriction(value * one, 0.0 * one, one)
    drives = DriveTrain(
        ratio=100.0 * one,
        motor=Motor(1e-3 * one),
        stiffness=LinearStiffness(2e4 * one),
        damping=20.0 * one,
        motor_friction=viscous(5.0),
        joint_friction=viscous(0.0),
    )
    limits = JointLimits(-3.0 * one, 3.0 * one, 2.0 * one, 8.0 * one, 80.0 * one)
    return assemble(
        name,
        parts,
        drives,
        limits,
        axis_signs=one,
        axis_zeros=0.0 * one,
        poses={"zero": 0.0 * one},
    )


def swing(samples: int, axes: int, dt: float = DT) -> Reference:
    """Harmonic motion with exact derivatives up to the fourth."""
    t = dt * np.arange(samples)
    omega, phase = 2 * np.pi * np.linspace(0.4, 0.9, axes), np.linspace(0.0, 1.0, axes)
    start = np.array([0.0, -0.6, 0.9, 0.2, 0.4, 0.0])[np.arange(axes) % 6]
    rows = [
        0.1 * omega**k * np.sin(omega * t[:, None] + phase + k * np.pi / 2)
        for k in range(5)
    ]
    rows[0] = rows[0] + start
    return Reference(t, np.stack(rows))


def start_poses(robot: ElasticRobot) -> tuple[np.ndarray, np.ndarray]:
    """Start angles and moves of 18 cases, the maker's [rad], (18, axes) each.

    Three poses of A2, three of A3, moves of 5 and 20 degrees on three axes; the first
    case is the default motion of `elastax feedforward`.
    """
    poses, moves = [], []
    for move in (5.0, 20.0):
        for a2 in (0.0, -35.0, -70.0):
            for a3 in (0.0, 35.0, 70.0):
                poses.append([0.0, a2, a3, 0.0, 0.0, 0.0])
                moves.append([move, move if a2 else min(move, 5.0), move, 0, 0, 0])
    return np.deg2rad(poses), np.deg2rad(moves)


def move_commands(robot: ElasticRobot, duration: float = 0.5) -> MotorCommand:
    """ASIM commands of the 18 cases at 1 kHz; cases are the leading axis of all fields.

    The motions are jerk-limited and filtered; the window is their first `duration` [s].
    """
    limits = robot.limits

    @jax.jit
    @jax.vmap
    def command(start, move):
        profile = PointToPoint(
            robot.from_maker(start),
            robot.from_maker(start + move),
            limits.velocity,
            limits.acceleration,
            limits.jerk,
        )
        reference = Reference.from_position_function(
            profile.position, duration, DT, filter=BesselFilter(6, 10.0)
        )
        found = ASIM().feedforward(robot, reference)
        return dataclasses.replace(found, eta=found.eta[:, :0])

    return command(*(jnp.asarray(x) for x in start_poses(robot)))


def one_case(commands: MotorCommand, index: int = 0) -> MotorCommand:
    """A single command of a batch."""
    return jax.tree.map(lambda x: x[index], commands)


def controller() -> CascadeMotorControl:
    """The loop at the motors that every simulation here runs under."""
    return CascadeMotorControl()


# gear stiffness, gear damping, structural stiffness
PARAMETERS = 20


def scaled_robot(robot: ElasticRobot, logarithms) -> ElasticRobot:
    """The robot with 20 parameters scaled by exp(logarithms).

    Stiffness and damping of the six gears and the stiffness of the eight elastic
    coordinates.
    """
    n = robot.axes
    factors = jnp.exp(logarithms)
    leaves = lambda r: (
        r.drives.stiffness.linear,
        r.drives.damping,
        r.structure_stiffness.linear,
    )
    gear, damping, structure = leaves(robot)
    moved = (
        gear * factors[:n],
        damping * factors[n : 2 * n],
        structure * factors[2 * n :],
    )
    return eqx.tree_at(leaves, robot, moved)
