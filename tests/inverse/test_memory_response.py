"""Gears with a memory: order, closed form of the relaxation, small systems."""

import dataclasses
import functools

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import Series, from_derivatives
from elastax.drivetrain import CubicStiffness, LinearStiffness, RelaxationBranch
from elastax.inverse._drive import advance_gear, resting_gear
from elastax.inverse._memory_response import gear_field, memory_response, solve_small

from tests import systems
from tests.helpers import assert_close


DRIVES = dataclasses.replace(
    systems.drive_train(2, damping=60.0),
    stiffness=CubicStiffness(np.array([4e3, 9e3]), np.array([3.0, 8.0])),
    branch=RelaxationBranch(
        np.array([3e3, 4e3]),
        LinearStiffness(np.array([2e3, 1e3])),
        np.array([90.0, 200.0]),
    ),
)


def load(t, order: int) -> Series:
    """Two smooth torques with their derivatives."""
    size, rate = jnp.array([300.0, -500.0]), jnp.array([5.0, 11.0])
    phases = rate[None] * t + 0.5 * jnp.pi * jnp.arange(order + 1.0)[:, None]
    powers = rate[None] ** jnp.arange(order + 1.0)[:, None]
    return from_derivatives(size[None] * powers * jnp.sin(phases))


@functools.partial(jax.jit, static_argnums=1)
def respond(steps, order: int):
    """Torsion and memory after 0.2 s in equal samples."""
    dt = 0.2 / steps

    def step(k, gear):
        before, after = load(k * dt, order), load((k + 1.0) * dt, order)
        return advance_gear(DRIVES, gear, before, after, dt)

    start = resting_gear(DRIVES, load(0.0, order))
    return jax.lax.fori_loop(0, steps.astype(int), step, start).augmented()


@functools.cache
def exact():
    """The same by an explicit method, tight tolerances."""
    field = gear_field(DRIVES, DRIVES.branch)
    start = resting_gear(DRIVES, load(0.0, 1)).augmented()
    solve = lambda: dfx.diffeqsolve(
        dfx.ODETerm(lambda t, x, _: field(x, -load(t, 0).coefficients[0])),
        dfx.Dopri8(),
        0.0,
        0.2,
        1e-4,
        start,
        stepsize_controller=dfx.PIDController(rtol=1e-12, atol=1e-15),
        max_steps=100_000,
    ).ys[0]
    return np.asarray(jax.jit(solve)())


@pytest.mark.slow
@pytest.mark.parametrize("order, expected", [(1, 3), (2, 5)])
def test_order_of_convergence(order, expected):
    errors = [
        np.max(np.abs(np.asarray(respond(jnp.array(n), order)) - exact()))
        for n in (20.0, 40.0)
    ]
    assert np.log2(errors[0] / errors[1]) > expected - 0.3


@pytest.mark.slow
def test_sample_of_a_millisecond():
    """The error of 0.2 s is a hundredth of the step of a 26-bit encoder."""
    error = np.asarray(respond(jnp.array(200.0), 1)) - exact()
    assert np.max(np.abs(error)) < 1e-2 * 2 * np.pi / 2**26


@pytest.mark.slow
def test_derivatives_of_the_response():
    """The series obeys its differential equation, term by term."""
    field = gear_field(DRIVES, DRIVES.branch)
    state, forcing = jnp.array([[0.02, -0.03], [0.005, -0.01]]), load(0.1, 2)
    series = jax.jit(lambda s, f: memory_response(field, s, f))(state, forcing)
    assert series.order == 3
    rate = series.rate()

    def along(t):
        a, f = series.coefficients, forcing.coefficients
        return field(a[0] + t * (a[1] + t * a[2]), f[0] + t * (f[1] + t * f[2]))

    slope = jax.jacfwd(along)
    zero = jnp.zeros(())
    assert_close(rate.coefficients[0], along(zero), rtol=1e-13)
    assert_close(rate.coefficients[1], slope(zero), rtol=1e-12)
    assert_close(rate.coefficients[2], 0.5 * jax.jacfwd(slope)(zero), rtol=1e-11)


@pytest.mark.slow
def test_rest_carries_the_load():
    torque = jnp.array([120.0, -4000.0])
    gear = jax.jit(lambda t: resting_gear(DRIVES, Series(t[None])))(torque)
    # sixty halvings and a step of Newton leave rounding
    assert_close(DRIVES.resting_torque(gear.torsion), -torque, rtol=1e-13)
    still = DRIVES.memory_rates(gear.torsion, 0.0 * torque, gear.memory)
    assert_close(still, np.zeros((1, 2)), rtol=0, atol=1e-10)
    slope = jax.jacfwd(lambda t: resting_gear(DRIVES, Series(t[None])).torsion)(torque)
    spring = jax.jacfwd(DRIVES.resting_torque)(gear.torsion)
    assert_close(-slope @ spring, np.eye(2), rtol=0, atol=1e-12)


def test_small_systems():
    key, other = jax.random.split(jax.random.key(0))
    matrix = jnp.eye(4)[:, :, None] + 0.2 * jax.random.uniform(key, (4, 4, 3))
    right = jax.random.normal(other, (4, 3))
    found = jnp.einsum("abn,bn->an", matrix, solve_small(matrix, right))
    assert_close(found, right, rtol=1e-13, atol=1e-14)
