"""Geometric Jacobians against autodiff, closed forms and published numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import from_derivatives
from elastax.kinematics import (
    forward_kinematics,
    jacobian,
    jacobian_derivatives,
    tool_levers,
    tool_motion,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, kuka, mixed, planar


each_chain = pytest.mark.parametrize(
    "chain", [mixed(), kuka(), fanuc(1e-3)], ids=["mixed", "kuka", "fanuc"]
)


def coordinates(chain, rows=()):
    rng = np.random.default_rng(2)
    return jnp.asarray(rng.uniform(-1.5, 1.5, (*rows, chain.number)))


@pytest.mark.slow
@each_chain
def test_geometric_is_autodiff(chain):
    q = coordinates(chain)
    rates = jax.jit(jax.jacfwd(lambda q: forward_kinematics(chain, q)))(q)
    rotation = forward_kinematics(chain, q)[:3, :3]
    spin = jnp.einsum("ijk,lj->ilk", rates[:3, :3], rotation)
    turning = jnp.stack([spin[2, 1], spin[0, 2], spin[1, 0]])
    expected = jnp.concatenate([rates[:3, 3], turning])
    assert_close(jacobian(chain, q), expected, rtol=1e-12, atol=1e-13)


@pytest.mark.slow
@each_chain
def test_levers_are_columns_of_the_jacobian(chain):
    """Without link frames, of coordinates and of their series."""
    motion, joints = coordinates(chain, (4,)), (3, 0)
    position, columns = jax.jit(lambda q: tool_levers(chain, q, joints))(motion[0])
    assert_close(position, forward_kinematics(chain, motion[0])[:3, 3], rtol=1e-13)
    expected = jacobian(chain, motion[0])[:3, np.array(joints)]
    assert_close(columns, expected, rtol=1e-12, atol=1e-13)
    series = jax.jit(lambda m: tool_levers(chain, from_derivatives(m), joints))(motion)
    columns = series[1].derivatives()
    expected = jacobian_derivatives(chain, motion)[:, :3, np.array(joints)]
    scale = float(jnp.max(jnp.abs(expected)))
    assert_close(columns, expected, rtol=1e-12, atol=1e-13 * scale)


@pytest.mark.slow
@each_chain
def test_derivatives_are_nested_jvps(chain):
    motion = coordinates(chain, (4,))
    factors = jnp.array([1.0, 1, 2, 6])[:, None]

    def along(t):
        powers = t ** jnp.arange(4.0)
        return jacobian(chain, powers @ (motion / factors))

    @jax.jit
    def nested(t):
        values, f = [], along
        for _ in range(4):
            values.append(f(t))
            f = lambda t, f=f: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack(values)

    # powers of t have finite derivatives at zero only for whole exponents
    expected = nested(jnp.array(1e-30))
    scale = float(jnp.max(jnp.abs(expected)))
    actual = jax.jit(jacobian_derivatives)(chain, motion)
    assert_close(actual, expected, rtol=1e-11, atol=1e-12 * scale)


def test_published_derivatives():
    case = load_vectors("003 (3-109)-(3-113),(3-131)-(3-133)")[0]
    inputs, expected, tol = case["inputs"], case["outputs"], case["tol"]
    chain = planar(inputs["l1"], inputs["l2"])
    motion = jnp.array([inputs[k] for k in ("x", "xd", "xdd", "xddd")])
    matrices = jax.jit(jacobian_derivatives)(chain, motion)[:, :2]
    for matrix, name in zip(matrices[:3], ("J", "Jd", "Jdd"), strict=True):
        assert_close(matrix, expected[name], rtol=tol)
    velocity, acceleration = jax.jit(tool_motion)(chain, *motion[:3])
    assert_close(velocity[:2], expected["yd"], rtol=tol)
    assert_close(acceleration[:2], expected["ydd"], rtol=tol)
    jerk = matrices[0] @ motion[3] + 2 * matrices[1] @ motion[2]
    assert_close(jerk + matrices[2] @ motion[1], expected["yddd"], rtol=tol)


def test_published_two_joint_arm():
    case = load_vectors("004 J^-1")[0]
    chain = planar(case["inputs"]["l1"], case["inputs"]["l2"])
    matrix = jacobian(chain, jnp.array(case["inputs"]["theta"]))[:2]
    assert_close(matrix, case["outputs"]["J"], rtol=case["tol"])
    assert_close(jnp.linalg.inv(matrix), case["outputs"]["Jinv"], rtol=case["tol"])


def test_motion_is_the_derivative_of_the_pose():
    chain = mixed()
    q, qd, qdd = coordinates(chain, (3,))
    position = lambda t: forward_kinematics(chain, q + t * qd + t**2 / 2 * qdd)[:3, 3]
    rate = jax.jacfwd(position)
    velocity, acceleration = jax.jit(tool_motion)(chain, q, qd, qdd)
    zero = jnp.array(0.0)
    expected = jax.jit(lambda t: jax.jvp(rate, (t,), (jnp.ones_like(t),)))(zero)
    assert_close((velocity[:3], acceleration[:3]), expected, rtol=1e-12)


@pytest.mark.slow
def test_gradient_and_batches():
    chain = mixed()
    batch = coordinates(chain, (3,))
    assert_gradient(jacobian, chain, batch[0])
    loop = jnp.stack([jax.jit(jacobian)(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(jacobian, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=1e-13, atol=1e-14)
