"""Exact backlash: the vector, limits of the damper, energy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import Backlash, LinearStiffness

from tests.helpers import assert_close, load_vectors


def test_vector():
    (vector,) = load_vectors("2.12")
    given = vector["inputs"]
    gear = Backlash(LinearStiffness(given["c"]), given["b"], given["phi0"])
    torsion, rate = jnp.array(given["phi_rel"]), jnp.array(given["dphi_rel"])
    torque = jax.jit(lambda *x: gear.torque(*x))(torsion, rate, jnp.array(given["d"]))
    bounds = {"rtol": vector["tol"], "atol": vector["tol"]}
    assert_close(torque, vector["outputs"]["nonsticking"], **bounds)


def test_never_pulls_and_starts_from_zero():
    gear = Backlash(LinearStiffness(8e4), 0.01, 0.001)
    torsion, rate = jnp.meshgrid(jnp.linspace(-0.03, 0.03, 61), jnp.linspace(-9, 9, 19))
    torque = gear.torque(torsion, rate, jnp.array(40.0))
    side = jnp.sign(torsion - 0.001)
    assert np.all(np.asarray(side * torque) >= 0)
    touching = gear.torque(jnp.array([0.006 + 1e-9]), jnp.array([5.0]), jnp.array(40.0))
    assert np.abs(float(touching[0])) <= 2 * 8e4 * 1.1e-9


def test_potential_and_rest():
    gear = Backlash(LinearStiffness(8e4), 0.01, 0.001)
    torque = jnp.array([30.0, -5.0])
    torsion = gear.torsion(torque)
    still = gear.torque(torsion, jnp.zeros(2), jnp.array(40.0))
    assert_close(still, torque, rtol=1e-12)
    slope = jax.grad(lambda x: gear.potential(x))(torsion[0])
    assert_close(slope, torque[0], rtol=1e-12)
    assert float(gear.potential(jnp.array(0.004))) == 0.0


def test_refusals():
    with pytest.raises(ValueError, match="`width` must not be negative"):
        Backlash(LinearStiffness(1.0), -1e-3, 0.0)
