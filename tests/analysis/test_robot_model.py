"""Linear models of robots: laws, second routes, the simplified KR210, refusals."""

import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import (
    BodyPoint,
    ControlSystem,
    JointEncoder,
    MotorAngles,
    MotorEncoder,
    MotorTorques,
    RobotChannel,
    SensorGroup,
    SignalNames,
    ToolPosition,
    linear_robot,
    locked_frequencies,
    relative_degree,
    transmission_zeros,
    zero_dynamics,
    zero_map,
)
from elastax.control import CascadeMotorControl
from elastax.drivetrain import Motor
from elastax.dynamics import forward_dynamics, static_equilibrium
from elastax.io import load_robot
from elastax.kinematics import forward_kinematics
from elastax.robots import simplified_kr210

from tests.helpers import assert_close


EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / "examples" / "robot.toml"
THETA = jnp.array([0.3, -0.5, 0.9])
linear = eqx.filter_jit(linear_robot)


@pytest.fixture(scope="module")
def robot():
    """Three axes, three hinges, elastic gears, a counterbalance."""
    return load_robot(EXAMPLE)


@pytest.fixture(scope="module")
def by_torque(robot):
    return linear(robot, THETA, RobotChannel())


@pytest.fixture(scope="module")
def by_angle(robot):
    return linear(robot, THETA, RobotChannel(MotorAngles()))


def sorted_match(found, expected, rtol):
    """Both sets one to one, each to the nearest."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    left = list(expected)
    for z in found[np.argsort(-np.abs(found))]:
        k = int(np.argmin(np.abs(np.array(left) - z)))
        assert abs(left[k] - z) <= rtol * abs(z), (z, left[k])
        left.pop(k)


# --------------------------------------------------------------------------- laws


def test_names_and_shapes(robot, by_torque, by_angle):
    assert by_torque.A.shape == (18, 18)
    assert by_torque.names.inputs[1] == "motor torque A2 [N m]"
    assert by_torque.names.outputs == ("tool x [m]", "tool y [m]", "tool z [m]")
    assert by_torque.names.states[:4] == ("q A1", "q A2", "q A3", "tilt 1 x")
    assert by_angle.A.shape == (12, 12)
    assert by_angle.names.inputs[0] == "motor angle A1 [rad]"


def test_locked_motors_swing_at_the_locked_frequencies(robot, by_angle):
    """To the square of the damping ratios, at most some percent."""
    hertz = np.asarray(jax.jit(locked_frequencies)(robot, THETA))
    modes = by_angle.modes()
    swinging = np.asarray(modes.damped_frequency) > 0
    found = np.asarray(modes.frequency)[swinging]
    damping = np.asarray(modes.damping_ratio)[swinging]
    assert len(found) >= 4
    for frequency, ratio in zip(found[:4], damping[:4]):
        nearest = hertz[np.argmin(np.abs(hertz - frequency))]
        assert abs(frequency / nearest - 1) < 2.0 * ratio**2 + 1e-6


def test_same_zeros_from_torques_and_from_angles(by_torque, by_angle):
    sorted_match(by_torque.zeros(), by_angle.zeros(), 1e-6)
    assert by_torque.zero_structure().infinite == (3, 3, 3)
    assert by_angle.zero_structure().infinite == (1, 1, 1)


def test_zeros_of_the_collocated_sensor_are_poles_of_locked_motors(robot, by_angle):
    channel = RobotChannel(MotorTorques(), MotorEncoder())
    model = linear(robot, THETA, channel)
    sorted_match(model.zeros(), by_angle.poles(), 1e-7)
    assert np.all(model.zeros().real < 0)


def test_static_gain_is_the_slope_of_the_equilibrium(robot, by_angle):
    """Second route: the tool at rest as a function of the motor angles."""

    def tool(theta):
        q, eta = static_equilibrium(robot, theta)
        return forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))[:3, 3]

    expected = jax.jit(jax.jacrev(tool))(THETA)
    assert_close(by_angle.static_gain(), expected, rtol=1e-8, atol=1e-9)
    assert_close(by_angle.operating_point.y, tool(THETA), rtol=1e-12)


def test_rigid_gears_by_torque_and_by_angle(robot):
    """Prescribed joints through the mass matrix have the zeros of the torques."""
    stiff = robot.rigid()
    flexible = eqx.tree_at(
        lambda r: r.drives.stiffness, robot, None, is_leaf=lambda x: x is None
    )
    torque = linear(flexible, THETA, RobotChannel())
    angle = linear(flexible, THETA, RobotChannel(MotorAngles()))
    sorted_match(torque.zeros(), angle.zeros(), 1e-6)
    assert torque.zero_structure().infinite == (2, 2, 2)
    assert np.abs(np.asarray(angle.D)).max() > 0.1
    with pytest.raises(ValueError, match="leave `hold` out"):
        linear_robot(
            flexible, THETA, RobotChannel(MotorTorques((0,), CascadeMotorControl()))
        )
    # nothing is elastic: the zeros are none
    rigid = linear(stiff, THETA, RobotChannel())
    assert rigid.zeros().size == 0


def test_fewer_axes_locked_or_held(robot):
    """Locked motors are controllers of endless gain."""
    outputs = ToolPosition((2,))
    locked = linear(robot, THETA, RobotChannel(MotorTorques((1,)), outputs))
    assert locked.A.shape == (14, 14)
    held = RobotChannel(MotorTorques((1,), CascadeMotorControl()), outputs)
    soft = linear(robot, THETA, held)
    assert soft.A.shape == (18, 18)
    stiff = RobotChannel(
        MotorTorques((1,), CascadeMotorControl(speed_bandwidth=1e6)), outputs
    )
    near = linear(robot, THETA, stiff).zeros()
    slow = near[np.abs(near) < 500.0]
    aim = locked.zeros()
    for z in slow[np.abs(slow) > 30.0]:
        assert np.abs(aim - z).min() < 1e-3 * abs(z)
    by_angle = RobotChannel(MotorAngles((1,), CascadeMotorControl()), outputs)
    sorted_match(linear(robot, THETA, by_angle).zeros(), soft.zeros(), 1e-6)


def test_lag_of_the_motors_adds_a_degree_and_no_zero(robot, by_torque):
    inertia = np.asarray(robot.drives.motor.inertia)
    lag = robot.with_drives(motor=Motor(inertia, lag=np.full(3, 2e-3)))
    model = linear(lag, THETA, RobotChannel())
    assert model.relative_degree() == (4, 4, 4)
    sorted_match(model.zeros(), by_torque.zeros(), 1e-6)
    angle = linear(lag, THETA, RobotChannel(MotorAngles()))
    sorted_match(angle.zeros(), by_torque.zeros(), 1e-6)


def test_sensors(robot):
    """A group of sensors, and a point of the last body at the tool."""
    last = robot.chain.number - 1
    q, eta = static_equilibrium(robot, THETA)
    point = BodyPoint(robot.chain.tool[:3, 3], last)
    group = SensorGroup((ToolPosition((0,)), JointEncoder((2,)), point))
    model = linear(robot, THETA, RobotChannel(MotorAngles(), group))
    assert model.names.outputs[1] == "joint A3 [rad]"
    assert len(model.names.outputs) == 5
    assert_close(model.operating_point.y[1], q[2], rtol=1e-9)


# ------------------------------------------------------------------- simplified KR210


@pytest.fixture(scope="module")
def simplified():
    return simplified_kr210()


def nonlinear(robot):
    """The same robot as a nonlinear system, from its forward dynamics."""

    def rate(x, u):
        q, eta, qd, etad = x[:1], x[1:2], x[2:3], x[3:]
        qdd, etadd, _ = forward_dynamics(robot, q, eta, q, qd, etad, qd, u)
        return jnp.concatenate([qd, etad, qdd, etadd])

    def output(x):
        coordinates = robot.joint_coordinates(x[:1], x[1:2])
        return forward_kinematics(robot.chain, coordinates)[1:2, 3]

    names = SignalNames(("q", "tilt", "q'", "tilt'"), ("tau",), ("y",))
    return ControlSystem(rate, output, names)


@pytest.mark.slow
def test_simplified_kr210_by_three_routes(simplified):
    """[Reiner2010] section 3.3: degree 2, unstable, with the structure of (3.26).

    Lie derivatives in the strict normal form, the constrained vector field, and the
    transmission zeros of the linear model.
    """
    system = nonlinear(simplified)
    assert relative_degree(system, jnp.zeros(4)).degrees == (2,)
    held = zero_dynamics(system, jnp.zeros(4))
    assert held.is_unstable
    strict = eqx.filter_jit(lambda form: form.straightened_matrix())(held.form)
    channel = RobotChannel(MotorTorques((0,)), ToolPosition((1,)))
    zeros = linear(simplified, jnp.zeros(1), channel).zeros()
    assert_close(held.eigenvalues, zeros, rtol=1e-8)
    assert_close(np.sort(np.linalg.eigvals(strict).real), zeros.real, rtol=1e-8)
    # s^2 - K (d s + c): one K for both coefficients
    total, product = np.sum(zeros).real, np.prod(zeros).real
    assert_close(total / 1e3, -product / 1e6, rtol=1e-8)
    # theirs, (3.27), of a geometry that is not printed: 0.0244; the order is the same
    assert 0.01 < total / 1e3 < 0.05


# ----------------------------------------------------------- programs and derivatives


@pytest.fixture(scope="module")
def right_zero(simplified):
    """The unstable zero as a function of spring and damper."""
    channel = RobotChannel(MotorTorques((0,)), ToolPosition((1,)))

    def at(stiffness, damping):
        robot = eqx.tree_at(
            lambda r: (r.structure_stiffness.linear, r.structure_damping),
            simplified,
            (stiffness[None], damping[None]),
        )
        model = linear_robot(robot, jnp.zeros(1), channel)
        zeros = transmission_zeros(model.A, model.B, model.C, model.D, (2,))
        return jnp.max(zeros.real)

    return at


def test_derivative_of_a_zero_by_spring_and_damper(right_zero):
    """Closed form: s^2 = K (d s + c) with K from the zero itself."""
    c, d = jnp.asarray(1e6), jnp.asarray(1e3)
    value, slopes = jax.jit(jax.value_and_grad(right_zero, argnums=(0, 1)))(c, d)
    s = float(value)
    K = s**2 / (1e3 * s + 1e6)
    assert_close(slopes[0], K / (2 * s - K * 1e3), rtol=1e-7)
    assert_close(slopes[1], K * s / (2 * s - K * 1e3), rtol=1e-7)
    forward = jax.jit(lambda c: jax.jvp(lambda c: right_zero(c, d), (c,), (1.0,))[1])
    assert_close(forward(c), slopes[0], rtol=1e-10)


def test_vmap_equals_loop(right_zero):
    stiffness = jnp.array([5e5, 1e6, 2e6])
    damping = jnp.array([8e2, 1e3, 1e2])
    one = jax.jit(right_zero)
    loop = jnp.stack([one(c, d) for c, d in zip(stiffness, damping)])
    assert_close(jax.jit(jax.vmap(right_zero))(stiffness, damping), loop, rtol=1e-12)


# ------------------------------------------------------------------------------- maps


def test_map_equals_single_models(robot):
    poses = np.array([[0.2, -0.4, 0.7], [0.0, 0.3, 1.1], [-0.5, -0.2, 0.5]])
    done = []
    found = zero_map(robot, poses, batch=2, progress=done.append)
    assert done == [2, 3]
    assert found.degrees == (3, 3, 3)
    for k, pose in enumerate(poses):
        model = linear(robot, robot.from_maker(jnp.asarray(pose)), RobotChannel())
        sorted_match(found.figures.zeros[k], model.zeros(), 1e-6)
    counts = np.sum(np.asarray(found.figures.zeros).real > 0, axis=1)
    assert_close(found.figures.right_zeros, counts.astype(float), rtol=0)
    assert found.unstable == int(np.sum(counts > 0))
    assert found.masked == 0


# -------------------------------------------------------------------------- refusals


def test_refusals(robot):
    with pytest.raises(ValueError, match="must be different ones of 0 to 2"):
        linear_robot(robot, THETA, RobotChannel(MotorTorques((0, 3))))
    with pytest.raises(ValueError, match="2 outputs and 3 inputs"):
        zero_map(robot, np.zeros((1, 3)), RobotChannel(outputs=ToolPosition((0, 1))))
    with pytest.raises(ValueError, match="must be \\(poses, 3\\)"):
        zero_map(robot, np.zeros(3))
    with pytest.raises(ValueError, match="singular at all poses"):
        twice = SensorGroup((ToolPosition((2,)), ToolPosition((2,))))
        zero_map(robot, np.zeros((1, 3)), RobotChannel(MotorTorques((1, 2)), twice))
    with pytest.raises(ValueError, match="no equilibrium at these motor angles"):
        linear_robot(robot, jnp.nan * THETA, RobotChannel())
