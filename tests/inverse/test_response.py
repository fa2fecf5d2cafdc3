"""Response of spring and damper: order, stability, closed forms, vectors."""

import functools

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import Series, from_derivatives
from elastax.inverse import advance, response
from elastax.structure import CubicStiffness, LimitedStiffness, LinearStiffness

from tests import systems
from tests.helpers import assert_close, assert_gradient, load_vectors


SPRINGS = {
    "linear": LinearStiffness(jnp.array([40.0, 900.0])),
    "cubic": CubicStiffness(np.array([40.0, 900.0]), np.array([3.0, 8.0])),
    "limited": LimitedStiffness(
        np.array([40.0, 900.0]), np.array([3.0, 8.0]), np.array([90.0, 2e3]),
        np.array([0.3, 0.01]),
    ),
}  # fmt: skip
DAMPING = jnp.array([8.0, 60.0])


def forcing(t, order: int) -> Series:
    """Two smooth torques with their derivatives."""
    size, rate = jnp.array([30.0, -500.0]), jnp.array([5.0, 11.0])
    phases = rate[None] * t + 0.5 * jnp.pi * jnp.arange(order + 1.0)[:, None]
    powers = rate[None] ** jnp.arange(order + 1.0)[:, None]
    return from_derivatives(size[None] * powers * jnp.sin(phases))


def step_on(spring, damping, x, t, dt, order: int):
    """Response one sample after the time t."""
    before, after = forcing(t, order), forcing(t + dt, order)
    return advance(spring.torque, damping, x, before, after, dt)


@functools.partial(jax.jit, static_argnums=4)
def respond(spring, x, duration, steps, order: int):
    """Response after equal samples."""
    dt = duration / steps

    def step(k, x):
        return step_on(spring, DAMPING, x, k * dt, dt, order)

    return jax.lax.fori_loop(0, steps.astype(int), step, x)


@pytest.mark.slow
@pytest.mark.parametrize("name", SPRINGS)
def test_order_of_convergence(name):
    """Order 5 with two derivatives of the forcing, order 3 with one."""
    spring, start = SPRINGS[name], jnp.array([0.2, -0.1])

    def field(t, x, _):
        force = forcing(t, 0).coefficients[0]
        return (force - spring.torque(x)) / DAMPING

    exact = systems.run(
        lambda: dfx.diffeqsolve(
            dfx.ODETerm(field),
            dfx.Dopri8(),
            0.0,
            0.4,
            None,
            start,
            stepsize_controller=dfx.PIDController(rtol=1e-12, atol=1e-14),
        ).ys[-1]
    )
    for order, expected, steps in ((1, 3, (16, 32)), (2, 5, (8, 16))):
        errors = [
            np.abs(respond(spring, start, 0.4, jnp.array(float(n)), order) - exact)
            for n in steps
        ]
        assert np.all(errors[1] < 1e-4)
        assert np.all(np.log2(errors[0] / errors[1]) > expected - 0.5)


def test_stationary_value_is_exact():
    """Under a constant torque the rest position stays, and any start leads there."""
    spring = SPRINGS["cubic"]
    torque = jnp.array([70.0, -400.0])
    rest = spring.torsion(torque)
    constant = Series(jnp.stack([torque, 0.0 * torque, 0.0 * torque]))

    @jax.jit
    def step(x, damping, dt):
        return advance(spring.torque, damping, x, constant, constant, dt)

    dt = jnp.array(1e-3)
    assert_close(step(rest, DAMPING, dt), rest, rtol=1e-14)
    # L-stability: with hardly any damper a few samples forget the start
    for tiny in (1e-6, 1e-12, 1e-40):
        x = 0.9 * rest
        for _ in range(4):
            x = step(x, tiny * DAMPING, dt)
        assert_close(x, rest, rtol=1e-12)
    # and a sample of no length keeps it
    assert_close(step(0.9 * rest, DAMPING, 0.0 * dt), 0.9 * rest, rtol=1e-15)


def test_stability_function():
    """One sample of the linear response is the Pade approximant [2/3] of exp."""
    z = -np.array([1e-3, 0.3, 4.0, 1e3, 1e8])
    spring = LinearStiffness(-z)
    none = Series(jnp.zeros((3, 5)))
    one = jnp.ones((5,))
    x = jax.jit(advance, static_argnums=0)(
        lambda y: -z * y, one, one, none, none, jnp.array(1.0)
    )
    above = 1 + 2 / 5 * z + z**2 / 20
    below = 1 - 3 / 5 * z + 3 / 20 * z**2 - z**3 / 60
    assert_close(x, above / below, rtol=1e-9, atol=1e-15)
    assert np.all(np.abs(x) < 1)
    assert_close(spring.torque(one), -z, rtol=0)


def test_series_of_the_response():
    """d x' + k(x) = f holds with all its derivatives."""
    spring, x = SPRINGS["cubic"], jnp.array([0.3, -0.2])
    f = forcing(0.7, 2)
    series = jax.jit(lambda: response(spring.torque, DAMPING, x, f).derivatives())()
    x, xd, xdd, xddd = series
    stiffness = spring.stiffness(x)
    bend = 6.0 * spring.linear * spring.hardening * x
    f, fd, fdd = f.derivatives()
    assert_close(DAMPING * xd, f - spring.torque(x), rtol=1e-13)
    assert_close(DAMPING * xdd, fd - stiffness * xd, rtol=1e-13)
    assert_close(DAMPING * xddd, fdd - stiffness * xdd - bend * xd**2, rtol=1e-12)


@pytest.mark.slow
def test_gradient():
    def end(spring, damping, x):
        return step_on(spring, damping, x, 0.2, 0.03, 2)

    assert_gradient(end, SPRINGS["cubic"], DAMPING, jnp.array([0.2, -0.1]))


def test_step_response_of_the_vectors():
    (vector,) = load_vectors("Reiner 3.79")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    stiffness, damping = given["c_e"], jnp.array([given["d_e"]])
    assert_close(-stiffness / damping[0], desired["eig"], rtol=tol)
    torque = jnp.array([[given["tau_e"]], [0.0], [0.0]])
    count = 50

    def settle(time):
        def step(x, _):
            return (
                advance(
                    lambda y: stiffness * y,
                    damping,
                    x,
                    Series(torque),
                    Series(torque),
                    time / count,
                ),
                None,
            )

        return jax.lax.scan(step, jnp.zeros((1,)), None, length=count)[0]

    settle = jax.jit(settle)
    assert_close(settle(given["t"])[0], desired["phi_t"], rtol=tol)
    # 1e4 time constants later
    assert_close(settle(1.5)[0], desired["phi_inf"], rtol=tol)


def test_lyapunov_function_of_the_vectors():
    (vector,) = load_vectors("Reiner 3.80")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    spring = CubicStiffness(np.array([given["c0"]]), np.array([given["gamma"]]))
    x = jnp.array([given["phi"]])
    free = Series(jnp.zeros((1, 1)))
    motion = response(spring.torque, jnp.array([given["d"]]), x, free)
    rate = spring.torque(x) * motion.coefficients[1]
    assert_close(spring.potential(x), [desired["V"]], rtol=tol)
    assert_close(rate, [desired["Vdot"]], rtol=tol)
