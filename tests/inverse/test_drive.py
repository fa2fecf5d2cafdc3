"""Inverse drive trains against the vectors."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._taylor import from_derivatives
from elastax.inverse import FlexibleJointInverse, GearState, motor_motion
from elastax.structure import LimitedStiffness

from tests import systems
from tests.helpers import assert_close, load_vectors


def test_inverse_drive_train_of_the_vectors():
    (vector,) = load_vectors("Reiner 3.92-3.94")
    given, desired, tol = vector["inputs"], vector["outputs"], vector["tol"]
    one = np.ones(1)
    spring = LimitedStiffness(*(given[k] * one for k in ("c0", "gamma", "c_max", "s")))
    drives = dataclasses.replace(
        systems.drive_train(1, ratio=1.0, motor_inertia=given["Theta"]),
        stiffness=spring,
        damping=given["d"] * one,
        motor_friction=systems.friction(
            given["tau_v"] * one, given["tau_h"], given["s_reib"]
        ),
    )
    u = jnp.array(given["u"])
    q = from_derivatives(u[:3, None])
    load = from_derivatives(u[3:, None])
    torsion = u[:1] - given["x"]
    gear = GearState(torsion, drives.resting_memory(torsion))
    sample = jax.jit(motor_motion)(drives, q, load, gear, jnp.zeros((0,)))
    actual = [sample.theta, sample.thetad, sample.thetadd, sample.tau_m]
    # the inputs are rounded to 13 digits, which the acceleration sees through the
    # stiffness over the damping twice
    gain = float((drives.stiffness.stiffness(torsion) / drives.damping)[0])
    rounding = 1e-13 * gain**2
    bounds = np.array([0.0, 0.0, rounding, given["Theta"] * rounding])
    error = np.abs(np.concatenate(actual) - np.array(desired["y"]))
    assert np.all(error <= tol * np.abs(desired["y"]) + bounds), (error, bounds)
    spring = drives.stiffness.torque(torsion)
    assert_close(spring, [desired["tau_getr"]], rtol=tol)
    friction = drives.motor_friction.torque(sample.thetad)
    assert_close(friction, [desired["tau_reib"]], rtol=tol)
    # what the gear gives is what the load takes
    whole = drives.gear_torque(torsion, u[1] - sample.thetad)
    assert_close(whole, -u[3:4], rtol=1e-10)


def test_rigid_gears_are_refused():
    robot = systems.elastic_2r().rigid()
    reference = systems.smooth_reference([0.0, 0.0], [0.1, 0.1])
    with pytest.raises(ValueError, match="model with elastic gears"):
        FlexibleJointInverse().feedforward(robot, reference)
