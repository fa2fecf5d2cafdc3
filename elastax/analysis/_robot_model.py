r"""Linear models of robots at rest.

Prescribed motor angles enter the links by the gears' springs and dampers, with rigid
gears by the mass matrix, so by derivatives: $\dot x = A x + B_0 w + B_1 \dot w + B_2
\ddot w$. States that carry their part of the input, $x - B_2 \dot w - (B_1 + A B_2) w$,
have a rate without derivatives, and for outputs of position $y = C x + D w$.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import is_concrete
from .._custom_types import PerJoint, Scalar, as_real, require_float64
from ..drivetrain import CoulombViscousFriction
from ..dynamics import (
    AbstractMotorController,
    ElasticRobot,
    LoopState,
    MotorSetpoint,
    forward_dynamics,
    holding_torque,
    loop_rates,
    resting_loads,
    static_equilibrium,
    static_load,
)
from ._channels import (
    AbstractDrive,
    AbstractSensor,
    MotorAngles,
    MotorTorques,
    ToolPosition,
)
from ._linear_model import LinearModel, OperatingPoint, SignalNames


class RobotChannel(eqx.Module):
    """Inputs and outputs of a robot's linear model.

    Attributes:
        inputs: what is driven; motor torques of the first three axes unless given.
        outputs: what is measured; the position of the tool unless given.
        speed: at which friction counts with its slope [rad/s]. At rest the smoothed
            Coulomb step would count as a stiff damper.

    References:
        [Reiner2010] section 3.7, figure 3.18: the angles of axes 1 to 3 to x, y, z.
    """

    inputs: AbstractDrive = MotorTorques()
    outputs: AbstractSensor = ToolPosition()
    speed: Scalar = eqx.field(converter=as_real, default=1.0)


class _OpenLoop(AbstractMotorController):
    """Driven axes take the torque of the setpoint, the others that of `hold`."""

    hold: AbstractMotorController | None
    driven: tuple[bool, ...] = eqx.field(static=True)

    @property
    def states(self) -> int:
        return 0 if self.hold is None else self.hold.states

    def motors(self, setpoint, theta, thetad):
        return theta, thetad

    def torque(self, setpoint, theta, thetad, inertia, load, memory):
        if self.hold is None:
            return setpoint.tau_m
        held = self.hold.torque(setpoint, theta, thetad, inertia, load, memory)
        return jnp.where(np.array(self.driven), setpoint.tau_m, held)

    def rates(self, setpoint, theta, thetad, memory):
        if self.hold is None:
            return memory
        rates = self.hold.rates(setpoint, theta, thetad, memory)
        return jnp.where(np.array(self.driven)[None], 0.0, rates)

    def resting_motors(self, setpoint, load, inertia):
        return setpoint.theta

    def resting_memory(self, setpoint, load, inertia):
        if self.hold is None:
            return jnp.zeros((0, load.shape[0]), load.dtype)
        return self.hold.resting_memory(setpoint, load, inertia)


class _Open(NamedTuple):
    """Linear model whose inputs are the torques of all motors.

    Attributes:
        A, B: shapes (states, states), (states, axes).
        x: state at rest.
        torque: of the motors at rest [N m].
        names: of the states.
        q, eta, motor, speed, torques: places of joints, structure, motors, motor speeds
            and lagging torques among the states; `torques` is empty without a lag.
        idle: places of states that count for nothing.
    """

    A: Any
    B: Any
    x: Any
    torque: Any
    names: tuple[str, ...]
    q: np.ndarray
    eta: np.ndarray
    motor: np.ndarray
    speed: np.ndarray
    torques: np.ndarray
    idle: np.ndarray


def linear_robot(
    robot: ElasticRobot, theta: PerJoint, channel: RobotChannel = RobotChannel()
) -> LinearModel:
    """Linear model of a robot that rests at given motor angles.

    The equilibrium under gravity, counterbalance and springs is solved for. Compiled
    once per kind of robot and channel; inside other programs it can be vmapped
    (`equinox.filter_vmap`) over poses, robots and channels, and differentiated by all
    of them, but then nobody looks whether there is an equilibrium.

    Args:
        robot: the robot, with elastic or rigid gears and smooth parts.
        theta: motor angles on the output side [rad], shape (axes,).
        channel: inputs and outputs.

    Raises:
        ValueError: parts that switch, no equilibrium, an unknown axis, or a controller
            for the held axes of a robot with rigid gears.
    """
    model, rest = _linear_model(robot, jnp.asarray(theta), channel)
    _check_rest(robot, rest)
    return model


def model_and_locked_motors(
    robot: ElasticRobot, theta: PerJoint, channel: RobotChannel
) -> tuple[LinearModel, Float[Array, "states states"]]:
    """The linear model, and A of the links behind locked motors; jittable.

    One set of equations serves both. Controllers of held axes leave poles at zero in
    the second.
    """
    model, _, open_loop = _models(robot, theta, channel)
    every = np.arange(robot.axes)
    A, _, _, keep = _moved(open_loop, every)
    return model, A[jnp.ix_(keep, keep)]


@eqx.filter_jit
def _linear_model(robot: ElasticRobot, theta, channel: RobotChannel):
    model, rest, _ = _models(robot, theta, channel)
    return model, rest


class _Rest(NamedTuple):
    """Coordinates at rest, forces left on the structure there, and undeformed."""

    q: Any
    eta: Any
    left: Any
    scale: Any


def _models(robot: ElasticRobot, theta, channel: RobotChannel):
    require_float64("the linear model of a robot")
    held = channel.inputs.held(robot)
    output_names = channel.outputs.names(robot)
    if robot.drives.switches:
        raise ValueError(
            "a linear model needs smooth drive trains, but these have parts that "
            "switch: take their smooth counterparts"
        )
    robot = with_linear_friction(robot, channel.speed)
    q, eta = static_equilibrium(robot, theta)
    forces = jax.vmap(lambda eta: static_load(robot, q, eta)[1])
    rest = _Rest(q, eta, *forces(jnp.stack([eta, jnp.zeros_like(eta)])))
    build = _elastic_gears if robot.has_elastic_gears else _rigid_gears
    open_loop = build(robot, q, eta, theta, channel.inputs, held)
    C = _output_matrix(robot, open_loop, channel.outputs, q, eta, theta)
    driven = np.array(channel.inputs.axes, int)
    free = held if channel.inputs.hold is None else ()
    y = channel.outputs.measure(robot, q, eta, theta)
    if isinstance(channel.inputs, MotorAngles):
        A, B, C, D, keep = _prescribed(open_loop, C, driven, np.array(free, int))
        label, u = "angle", theta[driven]
    else:
        A, B, C, D, keep = _torque_driven(open_loop, C, driven, np.array(free, int))
        label, u = "torque", open_loop.torque[driven]
    unit = channel.inputs.unit
    names = SignalNames(
        tuple(open_loop.names[k] for k in keep),
        tuple(f"motor {label} {robot.axis_names[k]} [{unit}]" for k in driven),
        output_names,
    )
    x = open_loop.x[keep]
    point = OperatingPoint(x, u, y, jnp.zeros_like(x))
    return LinearModel(A, B, C, D, names, point), rest, open_loop


def with_linear_friction(robot: ElasticRobot, speed) -> ElasticRobot:
    """Friction as viscous, with the slope that it has at a speed [N m s/rad]."""
    one = jnp.ones((robot.axes,))
    none = jnp.zeros((robot.axes,))

    def linear(friction):
        slope = lambda v: jax.jvp(friction.torque, (v,), (one,))[1]
        mean = 0.5 * (slope(speed * one) + slope(-speed * one))
        return CoulombViscousFriction(jnp.maximum(mean, 0.0), none, one)

    drives = robot.drives
    return robot.with_drives(
        motor_friction=linear(drives.motor_friction),
        joint_friction=linear(drives.joint_friction),
    )


def _check_rest(robot: ElasticRobot, rest: _Rest) -> None:
    if not is_concrete(*rest):
        return
    q, eta, left, scale = map(np.asarray, rest)
    values = np.concatenate([q, eta])
    if not np.isfinite(values).all():
        raise ValueError(
            f"`{robot.name}` has no equilibrium at these motor angles: the springs "
            "cannot carry the load, or the pose is not finite"
        )
    if not robot.elastic:
        return
    if np.abs(left).max() > 1e-6 * (1.0 + np.abs(scale).max()):
        raise ValueError(
            f"`{robot.name}` finds no equilibrium at these motor angles: forces of "
            f"{np.abs(left).max():.3g} are left on the structure; check stiffness and "
            "payload"
        )


def _elastic_gears(robot, q, eta, theta, inputs: AbstractDrive, held) -> _Open:
    n, m = robot.axes, robot.elastic
    driven = tuple(k not in held for k in range(n))
    control = _OpenLoop(inputs.hold, driven)
    drives, still = robot.drives, jnp.zeros_like(q)
    _, load = resting_loads(robot, q, theta)
    rest = MotorSetpoint(theta, still, still, load)
    lag = drives.motor.lag is not None
    inertia = drives.reflected_inertia()
    state = LoopState(
        q,
        eta,
        theta,
        still,
        jnp.zeros_like(eta),
        still,
        drives.resting_memory(q - drives.behind_teeth(theta)),
        load if lag else load[:0],
        control.resting_memory(rest, load, inertia),
    )

    def rates(x, torque):
        setpoint = MotorSetpoint(theta, still, still, torque)
        return loop_rates(robot, control, setpoint, x)

    x = state.vector()
    A, B = jax.jacfwd(rates, argnums=(0, 1))(x, load)
    axes, structure = robot.axis_names, robot.elastic_names
    names = [f"q {a}" for a in axes] + list(structure) + [f"theta {a}" for a in axes]
    names += [f"{name}'" for name in names]
    names += [f"gear {k + 1} {a}" for k in range(drives.memory_states) for a in axes]
    names += [f"torque {a}" for a in axes] if lag else []
    names += [f"control {k + 1} {a}" for k in range(control.states) for a in axes]
    size = 2 * n + m
    behind = 2 * size + drives.memory_states * n
    loop = np.arange(behind + lag * n, len(names)).reshape(-1, n)
    return _Open(
        A,
        B,
        x,
        load,
        tuple(names),
        q=np.arange(n),
        eta=n + np.arange(m),
        motor=n + m + np.arange(n),
        speed=size + n + m + np.arange(n),
        torques=behind + np.arange(lag * n),
        idle=loop[:, np.array(driven)].ravel(),
    )


def _rigid_gears(robot, q, eta, theta, inputs: AbstractDrive, held) -> _Open:
    if inputs.hold is not None:
        raise ValueError(
            "rigid gears have no motor angles of their own for a controller to hold: "
            "leave `hold` out, which locks the other axes"
        )
    if robot.drives.motor.lag is not None:
        raise ValueError("rigid gears with a motor lag have no linear model here")
    n, m = robot.axes, robot.elastic
    load = holding_torque(robot, q, eta)

    def rates(x, torque):
        q, eta, qd, etad = jnp.split(x, [n, n + m, 2 * n + m])
        qdd, etadd, _ = forward_dynamics(robot, q, eta, q, qd, etad, qd, torque)
        return jnp.concatenate([qd, etad, qdd, etadd])

    x = jnp.concatenate([q, eta, jnp.zeros_like(q), jnp.zeros_like(eta)])
    A, B = jax.jacfwd(rates, argnums=(0, 1))(x, load)
    names = [f"q {a}" for a in robot.axis_names] + list(robot.elastic_names)
    names += [f"{name}'" for name in names]
    none = np.zeros(0, int)
    return _Open(
        A,
        B,
        x,
        load,
        tuple(names),
        q=np.arange(n),
        eta=n + np.arange(m),
        motor=np.arange(n),
        speed=n + m + np.arange(n),
        torques=none,
        idle=none,
    )


def _output_matrix(robot, open_loop: _Open, sensor: AbstractSensor, q, eta, theta):
    measure = lambda q, eta, theta: sensor.measure(robot, q, eta, theta)
    by_q, by_eta, by_theta = jax.jacfwd(measure, argnums=(0, 1, 2))(q, eta, theta)
    C = jnp.zeros((by_q.shape[0], open_loop.x.shape[0]), open_loop.A.dtype)
    C = C.at[:, open_loop.q].add(by_q).at[:, open_loop.eta].add(by_eta)
    return C.at[:, open_loop.motor].add(by_theta)


def _moved(open_loop: _Open, axes: np.ndarray):
    """With the accelerations of some motors as inputs instead of their torques.

    Returns:
        A, the input matrix of these accelerations, that of all torques, and the places
        of the states that are no motion or torque of these motors.
    """
    A, B = open_loop.A, open_loop.B
    push = A[:, open_loop.torques[axes]] if open_loop.torques.size else B[:, axes]
    rows = open_loop.speed[axes]
    entry = push @ jnp.linalg.inv(push[rows])
    gone = [open_loop.motor[axes], rows, open_loop.idle]
    if open_loop.torques.size:
        gone.append(open_loop.torques[axes])
    keep = np.setdiff1d(np.arange(A.shape[0]), np.concatenate(gone))
    return A - entry @ A[rows], entry, B - entry @ B[rows], keep


def _torque_driven(open_loop: _Open, C, driven, locked):
    A, _, B, keep = _moved(open_loop, locked)
    D = jnp.zeros((C.shape[0], len(driven)), A.dtype)
    return A[jnp.ix_(keep, keep)], B[jnp.ix_(keep, driven)], C[:, keep], D, keep


def _prescribed(open_loop: _Open, C, driven, locked):
    """Angles of the driven motors as inputs: their rates are absorbed in the state."""
    A, entry, _, keep = _moved(open_loop, np.concatenate([driven, locked]).astype(int))
    angle, speed = open_loop.motor[driven], open_loop.speed[driven]
    B_0, B_1 = A[jnp.ix_(keep, angle)], A[jnp.ix_(keep, speed)]
    B_2 = entry[keep][:, : len(driven)]
    inner, seen = A[jnp.ix_(keep, keep)], C[:, keep]
    carried = B_1 + inner @ B_2
    return inner, B_0 + inner @ carried, seen, C[:, angle] + seen @ carried, keep
