"""Small systems with closed forms, random robots and smooth motions for the tests."""

import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import (
    CoulombViscousFriction,
    DriveTrain,
    Motor,
    SpringCounterbalance,
)
from elastax.dynamics import (
    AbstractMotorController,
    Axis,
    Body,
    CommandInterpolant,
    ElasticJoint,
    ElasticRobot,
    EndSlope,
    JointLimits,
    MotorCommand,
    MotorSetpoint,
    Offset,
    assemble,
)
from elastax.kinematics import JointKind
from elastax.signals import Reference
from elastax.structure import CubicStiffness, LinearStiffness


Z = (0.0, 0.0, 1.0)


class TorqueControl(AbstractMotorController):
    """The motors give the commanded torque, whatever they do."""

    def motors(self, setpoint, theta, thetad):
        return theta, thetad

    def torque(self, setpoint, theta, thetad, inertia, load, memory):
        return setpoint.tau_m

    @property
    def states(self) -> int:
        return 0

    def rates(self, setpoint, theta, thetad, memory):
        return memory

    def resting_memory(self, setpoint, load, inertia):
        return jnp.zeros((0, load.shape[0]))

    def resting_motors(self, setpoint, load, inertia):
        return setpoint.theta


def friction(viscous, coulomb=0.0, steepness=1.0) -> CoulombViscousFriction:
    """Friction (2.3) with one set of numbers for all axes, or arrays."""
    viscous, coulomb, steepness = np.broadcast_arrays(viscous, coulomb, steepness)
    return CoulombViscousFriction(viscous * 1.0, coulomb * 1.0, steepness * 1.0)


def drive_train(
    number,
    *,
    stiffness=2e4,
    hardening=0.0,
    damping=20.0,
    ratio=100.0,
    motor_inertia=1e-4,
    motor_friction=0.0,
    joint_friction=0.0,
) -> DriveTrain:
    """Drive trains with the same numbers on every axis; friction is viscous."""
    full = lambda value: np.full(number, float(value))
    if hardening:
        spring = CubicStiffness(full(stiffness), full(hardening))
    else:
        spring = LinearStiffness(full(stiffness))
    return DriveTrain(
        ratio=full(ratio),
        motor=Motor(full(motor_inertia)),
        stiffness=spring,
        damping=full(damping),
        motor_friction=friction(full(motor_friction)),
        joint_friction=friction(full(joint_friction)),
    )


def limits(number: int) -> JointLimits:
    """Wide limits."""
    one = np.ones(number)
    return JointLimits(-3.0 * one, 3.0 * one, 2.0 * one, 8.0 * one, 80.0 * one)


def assembled(name: str, parts, drives: DriveTrain, **options) -> ElasticRobot:
    """`assemble` with the chain's own angles as the maker's."""
    n = drives.number
    options = {"axis_signs": np.ones(n), "axis_zeros": np.zeros(n)} | options
    options = {"poses": {"zero": np.zeros(n)}} | options
    return assemble(name, parts, drives, limits(n), **options)


def pendulum(*, mass, length, inertia, drives, gravity=(0.0, -9.81, 0.0)):
    """One axis about z; the angle counts from the horizontal x axis."""
    body = Body("bob", mass, (length, 0.0, 0.0), inertia * np.eye(3))
    parts = [Axis("A1"), body, Offset((length, 0.0, 0.0))]
    return assembled("pendulum", parts, drives, gravity=gravity, counterbalanced_axis=0)


def two_mass_oscillator(
    *, load: float, rotor: float, stiffness: float, damping: float
) -> ElasticRobot:
    """Rotor and load on a gear spring, without gravity and friction."""
    drives = drive_train(
        1, stiffness=stiffness, damping=damping, ratio=10.0, motor_inertia=rotor / 100.0
    )
    return pendulum(
        mass=0.0, length=1.0, inertia=load, drives=drives, gravity=(0.0, 0.0, 0.0)
    )


def two_mass_response(t, *, load, rotor, stiffness, damping, torque):
    """Angles (q, theta) of the oscillator after a step of the motor torque at rest."""
    inverse = 1.0 / load + 1.0 / rotor
    decay = 0.5 * damping * inverse
    omega = np.sqrt(stiffness * inverse - decay**2)
    rest = -torque / (rotor * stiffness * inverse)
    swing = np.cos(omega * t) + decay / omega * np.sin(omega * t)
    torsion = rest * (1.0 - np.exp(-decay * t) * swing)
    centre = 0.5 * torque * t**2 / (load + rotor)
    q = centre + rotor / (load + rotor) * torsion
    return q, q - torsion


def rigid_2r(*, mass, length, com, inertia, gravity=9.81) -> ElasticRobot:
    """Planar arm in the x-y plane with gravity along -y; angles math-positive."""
    bodies = [
        Body(f"link {k}", mass[k], (com[k], 0.0, 0.0), inertia[k] * np.eye(3))
        for k in range(2)
    ]
    hop = Offset((length, 0.0, 0.0))
    parts = [Axis("A1"), bodies[0], hop, Axis("A2"), bodies[1], hop]
    return assembled("planar 2R", parts, drive_train(2), gravity=(0.0, -gravity, 0.0))


def two_link(
    *, length=2.0, share=0.2, mass=100.0, stiffness=1e6, damping=150.0, inertia=10.0,
    beyond=0.0,
) -> ElasticRobot:  # fmt: skip
    """The two-link example: one driven axis, one elastic joint, a horizontal plane.

    References:
        [Reiner2010] (3.36), figure 3.3; `beyond` is x_l.
    """
    parts = [
        Axis("A1"),
        Offset((share * length, 0.0, 0.0)),
        ElasticJoint("hinge", Z, stiffness, damping),
        Offset(((1.0 - share) * length, 0.0, 0.0)),
        Body("tip", mass, (0.0, 0.0, 0.0), inertia * np.eye(3)),
        Offset((beyond, 0.0, 0.0)),
    ]
    # motor and gear play no part in the example
    return assembled("two links", parts, drive_train(1), gravity=(0.0, 0.0, 0.0))


def elastic_2r(
    *,
    gear_stiffness=3e4,
    hinge_stiffness=(6e4, 4e4),
    hinge_hardening=0.0,
    hinge_damping=20.0,
    drives: DriveTrain | None = None,
    counterbalance=None,
    slope=0.5,
) -> ElasticRobot:
    """Vertical planar arm of two links that bend in their plane, 1.1 m long.

    The hinge of the first link is that of a beam with an end slope.
    """
    c1, c2 = hinge_stiffness
    parts = [
        Axis("A1"),
        Body("shoulder", 4.0, (0.05, 0.0, 0.0), 0.05 * np.eye(3)),
        Offset((0.1, 0.0, 0.0)),
        ElasticJoint("bend 1", Z, c1, hinge_damping, hinge_hardening),
        Body("upper arm", 8.0, (0.25, 0.01, 0.0), 0.2 * np.eye(3)),
        Offset((0.5, 0.0, 0.0)),
        EndSlope("bend 1", slope),
        Axis("A2"),
        Body("elbow", 3.0, (0.02, 0.0, 0.0), 0.03 * np.eye(3)),
        Offset((0.1, 0.0, 0.0)),
        ElasticJoint("bend 2", Z, c2, hinge_damping, hinge_hardening),
        Body("forearm", 5.0, (0.2, 0.0, 0.0), 0.1 * np.eye(3)),
        Offset((0.4, 0.0, 0.0)),
    ]
    if drives is None:
        drives = drive_train(
            2,
            stiffness=gear_stiffness,
            damping=15.0,
            motor_inertia=3e-4,
            motor_friction=8.0,
            joint_friction=2.0,
        )
    robot = assembled(
        "elastic 2R",
        parts,
        drives,
        gravity=(0.0, -9.81, 0.0),
        counterbalance=counterbalance,
        counterbalanced_axis=0,
    )
    return robot.with_payload(6.0, np.zeros(3), 0.02 * np.eye(3))


def spring_counterbalance(damping: float = 0.0) -> SpringCounterbalance:
    """Spring of a few hundred newtons on a lever of 0.15 m."""
    return SpringCounterbalance(
        base_distance=0.5,
        lever=0.15,
        angle_offset=0.7,
        spring_rate=3000.0,
        reference_length=0.35,
        preload=150.0,
        damping=damping,
    )


def random_robot(
    seed: int, axes: int, elastic: int, *, counterbalance: bool
) -> ElasticRobot:
    """Random elastic robot; every third axis is prismatic, some hinges harden."""
    rng = np.random.default_rng(seed)

    def unit():
        x = rng.standard_normal(3)
        return tuple(x / np.linalg.norm(x))

    def offset():
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        return Offset(0.4 * rng.standard_normal(3), turn * np.linalg.det(turn))

    def body(name):
        root = rng.standard_normal((3, 3))
        inertia = root @ root.T + np.eye(3)
        return Body(name, rng.uniform(2.0, 9.0), 0.2 * rng.standard_normal(3), inertia)

    per_axis = np.diff(np.linspace(0, elastic, axes + 1).round().astype(int))
    parts = [offset()]
    for k, hinges in enumerate(per_axis):
        kind = JointKind.PRISMATIC if k % 3 == 1 else JointKind.REVOLUTE
        parts += [Axis(f"A{k + 1}", kind), body(f"drum {k}")]
        for i in range(hinges):
            name = f"hinge {k} {i}"
            parts += [
                ElasticJoint(name, unit(), *rng.uniform(500.0, 2000.0, 2), 3.0 * i),
                offset(),
                body(f"link {k} {i}"),
                EndSlope(name, rng.uniform(0.3, 0.7)),
                body(f"end {k} {i}"),
            ]
        parts.append(offset())
    drives = DriveTrain(
        ratio=rng.uniform(-90.0, -40.0, axes),
        motor=Motor(rng.uniform(1e-3, 3e-3, axes)),
        stiffness=CubicStiffness(rng.uniform(1e3, 4e3, axes), np.full(axes, 20.0)),
        damping=rng.uniform(5.0, 30.0, axes),
        motor_friction=friction(rng.uniform(1.0, 5.0, axes), 3.0, 8.0),
        joint_friction=friction(rng.uniform(1.0, 5.0, axes), 2.0, 5.0),
    )
    robot = assembled(
        f"random {seed}",
        parts,
        drives,
        gravity=9.81 * np.asarray(unit()),
        counterbalance=spring_counterbalance(40.0) if counterbalance else None,
        counterbalanced_axis=0,
    )
    return robot.with_payload(5.0, (0.1, 0.2, 0.3), np.diag([0.3, 0.2, 0.4]))


def random_state(robot: ElasticRobot, seed: int, count: int, scale: float = 0.5):
    """Values, velocities, accelerations of (q, eta, theta), each (count, ...)."""
    rng = np.random.default_rng(seed)
    sizes = 3 * (robot.axes, robot.elastic, robot.axes)
    return tuple(jnp.asarray(scale * rng.standard_normal((count, s))) for s in sizes)


# 13th degree: the first six derivatives vanish at both ends
_STEP = (np.polynomial.Polynomial([0.0, 1.0, -1.0]) ** 6).integ()
_STEP = _STEP / _STEP(1.0)


def smooth_motion(start, change, duration: float, t, order: int) -> np.ndarray:
    """Rest-to-rest motion and exact derivatives, shape (order + 1, times, axes)."""
    t = np.asarray(t)
    s = np.clip(t / duration, 0.0, 1.0)
    rows = []
    for k in range(order + 1):
        step = _STEP.deriv(k) if k else _STEP
        rows.append(step(s)[:, None] / duration**k * np.asarray(change)[None])
    rows[0] = rows[0] + np.asarray(start)[None]
    return np.stack(rows)


def smooth_reference(
    start, change, duration=0.4, *, dt=1e-3, settle=0.0, order=4
) -> Reference:
    """Reference with exact derivatives."""
    times = dt * np.arange(round((duration + settle) / dt) + 1)
    return Reference(times, smooth_motion(start, change, duration, times, order))


def constant_command(times, theta, tau_m) -> MotorCommand:
    """Motors told to stay at `theta` and to give `tau_m`."""
    shape = (np.shape(times)[0], np.shape(theta)[0])
    full = lambda value: jnp.broadcast_to(jnp.asarray(value), shape)
    zero = jnp.zeros(shape)
    return MotorCommand(
        times, full(theta), zero, zero, full(tau_m), zero, zero, zero[:, :0]
    )


def run(function, *args):
    """`jax.jit(function)(*args)` with the result on the host, as NumPy arrays."""
    return jax.device_get(jax.jit(function)(*args))


def setpoint(command: MotorCommand, t: float) -> MotorSetpoint:
    """The command at one time."""
    return CommandInterpolant(command)(jnp.asarray(t))
