"""Losses of the teeth: vectors of (2.11), inverses, power, limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import (
    ConstantEfficiency,
    CoulombViscousFriction,
    DirectionalEfficiency,
    FallingEfficiency,
    LoadFriction,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


FALLING = FallingEfficiency(0.9, 0.1, 0.2, 200.0, 1e-2)
MESHES = {
    "efficiency": DirectionalEfficiency(
        ConstantEfficiency(0.9), ConstantEfficiency(0.8), 50.0
    ),
    "falling with friction": DirectionalEfficiency(
        FALLING,
        FALLING,
        3.0,
        CoulombViscousFriction(4.0, 5.0, 40.0),
        CoulombViscousFriction(5.0, 6.0, 40.0),
    ),
    "load friction": LoadFriction(0.1, 0.15, 0.2, 60.0, 5.0),
}
each_mesh = pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)


def of_vector(given) -> DirectionalEfficiency:
    friction = CoulombViscousFriction(
        given["tau_v"], given["tau_h"], given["s_friction"]
    )
    ends = (ConstantEfficiency(given["eta1"]), ConstantEfficiency(given["eta2"]))
    return DirectionalEfficiency(*ends, given["s"], friction, friction)


def test_vector_forward():
    """Rows tau_A, omega_A, xi, tau_loss, tau_B; tau_B = -i (tau_A - tau_loss)."""
    (vector,) = load_vectors("2.11")
    given, tol = vector["inputs"], vector["tol"]
    mesh = of_vector(given)
    drive, speed, share, loss, tau_b = jnp.array(vector["outputs"]["rows"]).T
    load = mesh.load_torque(drive, speed)
    bounds = {"rtol": tol, "atol": tol}
    assert_close(mesh.share_driving(drive, speed), share, **bounds)
    assert_close(drive - load, loss, **bounds)
    assert_close(-given["i"] * load, tau_b, **bounds)


def test_vector_inverse():
    (vector,) = load_vectors("2.11 inverse")
    given = vector["inputs"]
    load, speed = -jnp.array(given["tau_B"]), jnp.array(given["omega_A"])
    drive = of_vector(given).drive_torque(load, speed)
    assert_close(drive, vector["outputs"]["tau_A"], rtol=vector["tol"])


@pytest.mark.slow
@each_mesh
def test_inverses(mesh):
    """Both ways over twenty decades of load and fifteen of speed."""
    size = jnp.concatenate([-jnp.logspace(-12, 8, 41), jnp.logspace(-12, 8, 41)])
    rates = jnp.concatenate([-jnp.logspace(-12, 3, 16), jnp.logspace(-12, 3, 16)])
    load, speed = (x.ravel() for x in jnp.meshgrid(size, rates))

    @jax.jit
    def both(load, speed):
        drive = mesh.drive_torque(load, speed)
        there = mesh.load_torque(drive, speed)
        out = mesh.load_torque(load, speed)
        return drive, there, out, mesh.drive_torque(out, speed)

    drive, there, out, back = map(np.asarray, both(load, speed))
    # friction adds to the load: rounding is that of the larger of both
    scale = np.maximum(np.abs(load), np.abs(drive))
    assert np.all(np.abs(there - load) <= 1e-12 * scale)
    scale = np.maximum(np.abs(load), np.abs(out))
    assert np.all(np.abs(back - load) <= 1e-12 * scale)


@each_mesh
def test_driving_takes_more_and_driven_less(mesh):
    load, speed = jnp.array([300.0, -300.0, 300.0, -300.0]), jnp.array([2, 2, -2, -2.0])
    lost = (mesh.drive_torque(load, speed) - load) * speed
    assert np.all(np.asarray(lost) > 0)


def test_efficiencies_in_the_limit():
    """A steep law is (2.10): load over eta_1, or eta_2 times the load."""
    mesh = DirectionalEfficiency(ConstantEfficiency(0.9), ConstantEfficiency(0.8), 1e12)
    load, speed = jnp.array([300.0, -300.0]), jnp.array([2.0, 2.0])
    assert_close(mesh.drive_torque(load, speed), [300 / 0.9, -300 * 0.8], rtol=1e-9)


@pytest.mark.slow
@each_mesh
def test_gradient(mesh):
    load, speed = jnp.array([30.0, -12.0, 8.0]), jnp.array([0.4, 0.3, -0.7])
    assert_gradient(lambda m, t, w: m.drive_torque(t, w), mesh, load, speed)
    assert_gradient(lambda m, t, w: m.load_torque(t, w), mesh, load, speed, order=2)


@pytest.mark.slow
@each_mesh
def test_derivatives_are_finite(mesh):
    x, one = jnp.array([0.0, 1e-300, -1e-300, 1e8, -1e8]), jnp.ones(())

    @jax.jit
    @jax.vmap
    def derivatives(x):
        laws = (
            lambda x: mesh.drive_torque(x, one),
            lambda x: mesh.drive_torque(one, x),
            lambda x: mesh.load_torque(x, one),
            lambda x: mesh.load_torque(one, x),
        )
        return [(f(x), jax.grad(f)(x), jax.grad(jax.grad(f))(x)) for f in laws]

    assert np.all(np.isfinite(np.asarray(jax.tree.leaves(derivatives(x)))))


def test_falling_efficiency():
    assert_close(FALLING.value(jnp.array([0.0])), [0.9], rtol=1e-12)
    # beyond the rounding and above the floor: the text's line, its rounding 1e-2 rad/s
    assert_close(FALLING.value(jnp.array([2.0, -2.0])), [0.7, 0.7], rtol=0, atol=1e-3)
    assert_close(FALLING.value(jnp.array([1e8])), [0.2], rtol=1e-12)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: ConstantEfficiency(0.0), "`level` must be above zero and up to one"),
        (lambda: ConstantEfficiency(1.1), "`level` must be above zero and up to one"),
        (lambda: FallingEfficiency(0.9, -1.0, 0.2, 1e2, 1e-2), "`decline` must not"),
        (lambda: FallingEfficiency(0.9, 0.1, 0.95, 1e2, 1e-2), "`floor` must be below"),
        (lambda: FallingEfficiency(0.99, 0.1, 0.9, 1.0, 1e-2), "must not exceed 1"),
        (lambda: LoadFriction(0.6, 0.5, 1.0, 1.0, 1.0), "must stay below 1"),
        (lambda: LoadFriction(-0.1, 0.5, 1.0, 1.0, 1.0), "`coulomb` must not be"),
        (
            lambda: DirectionalEfficiency(
                ConstantEfficiency(1.0), ConstantEfficiency(1.0), 0.0
            ),
            "`steepness` must be positive",
        ),
    ],
)
def test_refusals(build, words):
    with pytest.raises(ValueError, match=words):
        build()
