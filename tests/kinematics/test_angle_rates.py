"""Rates of angles and quaternions against derivatives of the rotations."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import from_derivatives
from elastax.kinematics import (
    analytic_jacobian,
    angle_motion,
    angular_velocity,
    forward_kinematics,
    jacobian,
    quaternion_rate_matrix,
    quaternion_rates,
    rotation_from_quaternion,
    rotation_from_rpy,
    rotation_from_zxz,
    rpy_from_rotation,
    rpy_rate_matrix,
    rpy_rates,
    zxz_rate_matrix,
    zxz_rates,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import kuka, mixed


KINDS = {
    "rpy": (rotation_from_rpy, rpy_rate_matrix, rpy_rates),
    "zxz": (rotation_from_zxz, zxz_rate_matrix, zxz_rates),
}
each_kind = pytest.mark.parametrize("kind", KINDS)
SINGULAR = {"rpy": np.pi / 2, "zxz": 0.0}


def motion_of_angles():
    return jnp.asarray(np.random.default_rng(5).uniform(-1, 1, (5, 3)))


def motion_of_quaternion():
    """A quaternion of length one at all times, with its derivatives."""
    start, spin = jnp.array([0.5, -0.5, 0.1, 0.7]), motion_of_angles()[:4]
    return angle_motion(quaternion_rates, start / jnp.linalg.norm(start), spin)


def spins_by_autodiff(build, motion):
    """Angular velocity and derivatives of vee(R' R^T) by nested `jvp`."""
    factors = jnp.array([1.0, 1, 2, 6, 24])[:, None]
    path = lambda t: build((t ** jnp.arange(5.0)) @ (motion / factors))

    def spin(t):
        rotation, rate = jax.jvp(path, (t,), (jnp.ones_like(t),))
        turn = rate @ rotation.T
        return jnp.stack([turn[2, 1], turn[0, 2], turn[1, 0]])

    @jax.jit
    def nested(t):
        values, f = [], spin
        for _ in range(4):
            values.append(f(t))
            f = lambda t, f=f: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack(values)

    # powers of t have finite derivatives at zero only for whole exponents
    return nested(jnp.array(1e-30))


def test_published_rate_matrix():
    case = load_vectors("003 (3-114)-(3-118)")[0]
    inputs, outputs, tol = case["inputs"], case["outputs"], case["tol"]
    rpy, rate = jnp.array(inputs["Theta"]), jnp.array(inputs["dTheta"])
    matrix = rpy_rate_matrix(rpy)
    assert_close(matrix, outputs["E"], rtol=tol, atol=1e-12)
    assert_close(matrix @ rate, outputs["omega_base"], rtol=tol)
    assert_close(jnp.linalg.det(matrix), outputs["det"], rtol=tol)
    assert_close(rpy_rates(rpy, jnp.array(outputs["omega_base"])), rate, rtol=tol)


@pytest.mark.slow
@each_kind
def test_angular_velocity_to_third_order(kind):
    build, matrix, _ = KINDS[kind]
    motion = motion_of_angles()
    found = jax.jit(functools.partial(angular_velocity, matrix))(motion)
    assert_close(found, spins_by_autodiff(build, motion), rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_angular_velocity_of_quaternions():
    motion = motion_of_quaternion()
    found = jax.jit(functools.partial(angular_velocity, quaternion_rate_matrix))(motion)
    assert_close(found, motion_of_angles()[:4], rtol=1e-12, atol=1e-13)
    expected = spins_by_autodiff(rotation_from_quaternion, motion)
    assert_close(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
@each_kind
def test_motion_of_angles_inverts_the_angular_velocity(kind):
    _, matrix, rates = KINDS[kind]
    motion = motion_of_angles()

    @jax.jit
    def there_and_back(motion):
        spin = angular_velocity(matrix, motion)
        return angle_motion(functools.partial(rates, throw=False), motion[0], spin)

    assert_close(there_and_back(motion), motion, rtol=1e-12, atol=1e-12)


@each_kind
def test_rates_invert_the_matrix(kind):
    _, matrix, rates = KINDS[kind]
    angles = motion_of_angles()[0]
    assert_close(rates(angles, matrix(angles)), jnp.eye(3), rtol=0.0, atol=1e-15)
    determinant = {"rpy": jnp.cos(angles[1]), "zxz": -jnp.sin(angles[1])}[kind]
    assert_close(jnp.linalg.det(matrix(angles)), determinant, rtol=1e-14)


@each_kind
def test_singular_angles(kind):
    """An error, or the part of the motion that the angles can follow."""
    _, matrix, rates = KINDS[kind]
    angles, spin = jnp.array([0.4, SINGULAR[kind], 1.1]), jnp.array([0.3, -0.2, 0.5])
    with pytest.raises(eqx.EquinoxRuntimeError, match="not determined"):
        eqx.filter_jit(rates)(angles, spin)
    followed = functools.partial(rates, throw=False)
    rate = jax.jit(followed)(angles, spin)
    kept = {"rpy": 2, "zxz": 0}[kind]
    assert_close(rate[kept], jnp.array(0.0), rtol=0.0, atol=1e-15)
    # what is lost is along one direction, perpendicular to all axes of turns
    lost = spin - matrix(angles) @ rate
    assert_close(matrix(angles).T @ lost, jnp.zeros(3), rtol=0.0, atol=1e-15)
    for derivative in (jax.jacfwd, jax.jacrev):
        slopes = jax.jit(derivative(followed, (0, 1)))(angles, spin)
        assert all(np.all(np.isfinite(x)) for x in slopes)
    with pytest.raises(eqx.EquinoxRuntimeError, match="not determined"):
        series = from_derivatives(jnp.stack([angles, spin]))
        eqx.filter_jit(rates)(series, series)


def test_motion_needs_a_derivative():
    with pytest.raises(ValueError, match="at least one time derivative"):
        angular_velocity(rpy_rate_matrix, jnp.zeros((1, 3)))


@pytest.mark.slow
@pytest.mark.parametrize("chain", [mixed(), kuka()], ids=["mixed", "kuka"])
def test_analytic_jacobian_is_autodiff_of_the_angles(chain):
    q = jnp.asarray(np.random.default_rng(2).uniform(-1, 1, chain.number))

    def pose(q):
        found = forward_kinematics(chain, q)
        return jnp.concatenate([found[:3, 3], rpy_from_rotation(found[:3, :3])])

    expected = jax.jit(jax.jacfwd(pose))(q)
    found = jax.jit(functools.partial(analytic_jacobian, throw=False))(chain, q)
    scale = float(jnp.max(jnp.abs(expected)))
    assert_close(found, expected, rtol=1e-12, atol=1e-13 * scale)


def test_analytic_jacobian_in_gimbal_lock():
    """The arm stretched forward with its hand axis along x: the pitch is 90 degrees."""
    chain, q = kuka(), jnp.zeros(6)
    with pytest.raises(eqx.EquinoxRuntimeError, match="not determined"):
        eqx.filter_jit(analytic_jacobian)(chain, q)
    found = jax.jit(functools.partial(analytic_jacobian, throw=False))(chain, q)
    assert_close(found[:3], jacobian(chain, q)[:3], rtol=0.0)
    assert np.all(np.isfinite(found))


@pytest.mark.slow
def test_gradient_and_batches():
    chain = mixed()
    batch = jnp.asarray(np.random.default_rng(2).uniform(-1, 1, (3, chain.number)))
    function = functools.partial(analytic_jacobian, throw=False)
    assert_gradient(lambda q: function(chain, q), batch[0])
    single = jax.jit(function)
    loop = jnp.stack([single(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(function, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=1e-13, atol=1e-13)
    start, spin = motion_of_angles()[0], motion_of_angles()[1:3]
    there = functools.partial(angle_motion, functools.partial(rpy_rates, throw=False))
    back = functools.partial(angular_velocity, zxz_rate_matrix)
    assert_gradient(lambda s, w: back(there(s, w)), start, spin)
