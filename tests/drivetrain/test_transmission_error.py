"""Transmission error: the vector, its inverse, power, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import TransmissionError

from tests.helpers import assert_close, assert_gradient, load_vectors


ERROR = TransmissionError(
    jnp.array([[1e-3, 0.05], [2e-4, 0.01]]),
    jnp.array([[2.0, 3.0], [5.0, 11.0]]),
    jnp.array([[0.4, 1.0], [-1.1, 2.0]]),
    jnp.array([0.07, -0.4]),
)


def test_vector():
    (vector,) = load_vectors("2.6")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    column = lambda name: np.array(given[name], float)[:, None]
    ratio = np.array([given["i0"]])
    error = TransmissionError.from_ratio(
        ratio, column("i_hat"), column("i_check"), column("i_bar"), [given["phi_i0"]]
    )
    angle = jnp.array([given["phi_B"]])
    i = ratio * error.ratio(angle)
    assert_close(i, [desired["i"]], rtol=tol)
    assert_close(ratio * error.motor_angle(angle), [desired["phi_A"]], rtol=tol)
    assert_close(-given["tau_B"] / i, [desired["tau_A"]], rtol=tol)


def test_inverse():
    """Six steps reach rounding also where the ratio varies by a third."""
    theta = jnp.linspace(-7.0, 7.0, 200)[:, None] * jnp.ones(2)[None]
    angle = jax.jit(jax.vmap(ERROR.output_angle))(theta)
    back = jax.vmap(ERROR.motor_angle)(angle)
    assert_close(back, theta, rtol=0, atol=2e-15 * 8)  # of angles up to 7.4 rad


def test_ratio_is_the_slope():
    angle = jnp.array([0.83, -2.0])
    slope = jax.jvp(ERROR.motor_angle, (angle,), (jnp.ones(2),))[1]
    assert_close(ERROR.ratio(angle), slope, rtol=1e-13)
    inverse = jax.jvp(ERROR.output_angle, (angle,), (jnp.ones(2),))[1]
    assert_close(inverse, 1.0 / ERROR.ratio(ERROR.output_angle(angle)), rtol=1e-13)


@pytest.mark.slow
def test_gradient():
    angle = jnp.array([0.83, -2.0])
    law = lambda a, p: TransmissionError(a, ERROR.orders, p, ERROR.start)
    args = (ERROR.amplitudes, ERROR.phases, angle)
    assert_gradient(lambda a, p, x: law(a, p).motor_angle(x), *args, order=2)
    assert_gradient(lambda a, p, x: law(a, p).output_angle(x), *args)


@pytest.mark.slow
def test_derivatives_are_finite():
    law = lambda x: ERROR.output_angle(x * jnp.ones(2))[0]
    x = jnp.array([0.0, 1e-300, 1e8])
    both = lambda x: (law(x), jax.grad(law)(x), jax.grad(jax.grad(law))(x))
    values = jax.jit(jax.vmap(both))(x)
    assert np.all(np.isfinite(np.asarray(values)))


@pytest.mark.parametrize(
    ("amplitude", "order", "words"),
    [
        (0.01, 2.5, "`orders` must be whole"),
        (0.01, -1.0, "`orders` must be whole"),
        (0.3, 2.0, "vary by less than 0.5"),
    ],
)
def test_refusals(amplitude, order, words):
    with pytest.raises(ValueError, match=words):
        TransmissionError([[amplitude]], [[order]], [[0.0]], [0.0])
