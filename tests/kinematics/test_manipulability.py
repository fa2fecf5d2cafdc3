"""Measures of the Jacobian: closed forms, singular poses, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    condition_number,
    directional_reach,
    inverse_condition_number,
    jacobian,
    manipulability,
    scaled_jacobian,
    velocity_ellipsoid,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, planar


Q = jnp.array([0.3, -1.1, 0.9, 0.4, 0.8, -0.6])


def tip(q, lengths=(0.5, 0.4)):
    return scaled_jacobian(planar(*lengths), q, rows=(0, 1))


def test_two_joint_arm():
    """w = l1 l2 |sin q2|; isotropic for l1 = sqrt(2) l2 at q2 = 135 degrees."""
    q = jnp.array([0.3, 0.8])
    assert_close(manipulability(tip(q)), jnp.abs(0.2 * jnp.sin(q[1])), rtol=1e-14)
    best = tip(jnp.array([0.3, 0.75 * np.pi]), (np.sqrt(0.5), 0.5))
    assert_close(inverse_condition_number(best), jnp.array(1.0), rtol=1e-14)
    assert_close(condition_number(best), jnp.array(1.0), rtol=1e-14)


def test_measure_is_the_root_of_the_determinant():
    matrix = scaled_jacobian(kuka(), Q, 0.4)
    expected = jnp.sqrt(jnp.linalg.det(matrix @ matrix.T))
    # the determinant squares the condition number, 20
    assert_close(manipulability(matrix), expected, rtol=1e-12)
    assert_close(condition_number(matrix), jnp.linalg.cond(matrix), rtol=1e-13)
    wide = tip(jnp.array([0.3, 0.8, -0.5]), (0.5, 0.4, 0.3))
    expected = jnp.sqrt(jnp.linalg.det(wide @ wide.T))
    assert_close(manipulability(wide), expected, rtol=1e-13)


def test_characteristic_length_scales_rotations():
    matrix, scaled = jacobian(kuka(), Q), scaled_jacobian(kuka(), Q, 0.25)
    assert_close(scaled[:3], matrix[:3], rtol=0.0)
    assert_close(scaled[3:], 0.25 * matrix[3:], rtol=1e-15)
    # the measure has the length cubed, of which the comparison of poses is free
    ratio = manipulability(scaled) / manipulability(matrix)
    assert_close(ratio, jnp.array(0.25**3), rtol=1e-13)


def test_ellipsoid_spans_the_velocities():
    matrix = tip(jnp.array([0.3, 0.8, -0.5]), (0.5, 0.4, 0.3))
    axes, lengths = velocity_ellipsoid(matrix)
    assert_close(axes.T @ axes, jnp.eye(2), rtol=0.0, atol=1e-15)
    again = axes @ jnp.diag(lengths**2) @ axes.T
    assert_close(again, matrix @ matrix.T, rtol=1e-13)
    for k in range(2):
        assert_close(directional_reach(matrix, axes[:, k]), lengths[k], rtol=1e-13)
    # a line of motion: the second axis has the length zero
    axes, lengths = velocity_ellipsoid(tip(jnp.array([0.3]), (0.5,)))
    assert_close(lengths, jnp.array([0.5, 0.0]), rtol=1e-15)
    assert_close(jnp.abs(axes[:, 0]), jnp.array([np.sin(0.3), np.cos(0.3)]), rtol=1e-14)


def test_reach_along_a_direction():
    """The largest speed along u with joint velocities of length one and no other."""
    matrix, u = tip(jnp.array([0.3, 0.8])), jnp.array([0.6, 0.8])
    expected = 1 / jnp.sqrt(u @ jnp.linalg.inv(matrix @ matrix.T) @ u)
    assert_close(directional_reach(matrix, 7 * u), expected, rtol=1e-13)
    stretched, outward = (
        tip(jnp.array([0.3, 0.0])),
        jnp.array([np.cos(0.3), np.sin(0.3)]),
    )
    blocked = jax.jit(jax.value_and_grad(directional_reach))(stretched, outward)
    assert_close(blocked, (0.0, np.zeros((2, 2))), rtol=0.0)


@pytest.mark.parametrize("folded", [0.0, np.pi])
def test_singular_poses(folded):
    """Zero measures with finite derivatives: up to rounding of the pose."""
    q = jnp.array([0.3, folded])
    assert_close(manipulability(tip(q)), jnp.array(0.0), rtol=0.0, atol=1e-16)
    slope = jax.jit(jax.jacfwd(lambda q: manipulability(tip(q))))(q)
    assert_close(jnp.abs(slope), jnp.array([0.0, 0.2]), rtol=1e-12, atol=1e-15)
    for measure in (manipulability, inverse_condition_number, condition_number):
        slope = jax.jit(jax.grad(measure))(tip(q))
        assert np.all(np.isfinite(slope))
    nothing = jnp.zeros((2, 2))
    assert condition_number(nothing) == jnp.inf
    for measure in (manipulability, inverse_condition_number, condition_number):
        assert np.all(np.isfinite(jax.jit(jax.grad(measure))(nothing)))


@pytest.mark.slow
def test_equal_singular_values_have_derivatives():
    for measure in (manipulability, inverse_condition_number, condition_number):
        assert np.all(np.isfinite(jax.jit(jax.grad(measure))(jnp.eye(3))))
    # of the determinant at the identity: the trace
    assert_close(jax.grad(manipulability)(jnp.eye(3)), jnp.eye(3), rtol=1e-14)


@pytest.mark.slow
def test_gradient_and_batches():
    chain = kuka()

    def measures(q, length):
        matrix = scaled_jacobian(chain, q, length)
        return (
            manipulability(matrix),
            condition_number(matrix),
            velocity_ellipsoid(matrix).lengths,
            directional_reach(matrix, jnp.arange(1.0, 7.0)),
        )

    assert_gradient(measures, Q, jnp.array(0.4))
    batch = jnp.stack([Q, -Q, 0.5 * Q])
    function = lambda q: manipulability(scaled_jacobian(chain, q))
    single = jax.jit(function)
    loop = jnp.stack([single(q) for q in batch])
    assert_close(jax.jit(jax.vmap(function))(batch), loop, rtol=1e-13)
