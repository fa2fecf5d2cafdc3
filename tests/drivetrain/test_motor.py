"""Motor: lag against the vector, its inverse, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import Motor

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


MOTOR = Motor(np.array([1e-3, 2e-3]), np.array([1.8, 0.5]), np.array([2e-3, 5e-4]))


def test_command_inverts_the_lag():
    torque, command = jnp.array([3.0, -8.0]), jnp.array([4.0, 1e3])
    rate = MOTOR.torque_rate(torque, command)
    # one rounding of the difference, one of the quotient
    assert_close(MOTOR.command(torque, rate), command, rtol=1e-15)
    assert_close(MOTOR.current(MOTOR.commanded_torque(command)), command, rtol=1e-15)
    ideal = Motor(np.ones(2))
    assert_close(ideal.command(torque, rate), torque, rtol=0)
    with pytest.raises(ValueError, match="without `lag`"):
        ideal.torque_rate(torque, command)
    with pytest.raises(ValueError, match="`torque_constant`"):
        ideal.current(torque)


def test_gradient():
    torque, command = jnp.array([3.0, -8.0]), jnp.array([4.0, 1e3])
    assert_gradient(lambda m, t, c: m.torque_rate(t, c), MOTOR, torque, command)


@pytest.mark.parametrize("name", ["inertia", "torque_constant", "lag"])
@pytest.mark.parametrize("value", [np.array([1.0, 0.0]), np.array([1.0, -1.0])])
def test_refuses_what_is_not_positive(name, value):
    values = {"inertia": np.ones(2)} | {name: value}
    with pytest.raises(ValueError, match=f"`{name}` must be positive"):
        Motor(**values)
    with pytest.raises(ValueError, match="one value per joint"):
        Motor(np.ones(2), lag=np.ones(3))


def test_step_response_of_the_vector():
    """A step of the current, by the classical Runge-Kutta formula."""
    (vector,) = load_vectors("2.2")
    given, desired = vector["inputs"], vector["outputs"]
    motor = Motor(np.ones(1), np.array([given["k_T"]]), np.array([given["T_m"]]))
    command = motor.commanded_torque(jnp.array([given["I"]]))
    steps = 2000  # of h / T = 8e-4: the error of a step is (h / T)^5 / 120
    h = given["t"] / steps

    def step(_, torque):
        k1 = motor.torque_rate(torque, command)
        k2 = motor.torque_rate(torque + 0.5 * h * k1, command)
        k3 = motor.torque_rate(torque + 0.5 * h * k2, command)
        k4 = motor.torque_rate(torque + h * k3, command)
        return torque + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    torque = jax.lax.fori_loop(0, steps, step, jnp.zeros(1))
    assert_close(torque, [desired["tau"]], rtol=vector["tol"])
    assert_close(command, [desired["steady"]], rtol=1e-15)


def test_referral_of_the_vector():
    (vector,) = load_vectors("2.3.1 referral")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    side = lambda value: value * jnp.ones(1)
    law = systems.friction(side(given["tau_v_m"]), given["tau_h_m"], given["s_m"])
    friction = law.to_output_side(side(given["i"]))
    drives = dataclasses.replace(
        systems.drive_train(1, ratio=given["i"], motor_inertia=given["J_m"]),
        motor_friction=friction,
    )
    omega = drives.to_output_angle(side(given["omega_m"]))
    torque = drives.to_output_torque(side(given["tau_m"]))
    actual = {
        "Theta": drives.reflected_inertia(),
        "tau_v": friction.viscous,
        "tau_h": friction.coulomb,
        "s": friction.steepness,
        "omega_out": omega,
        "tau_out": torque,
        "power": omega * torque,
        "friction_out": friction.torque(omega),
    }
    for name, value in actual.items():
        assert_close(value, [desired[name]], rtol=tol)
