"""Tangents of the accelerations: closed form against autodiff and differences."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax._kernel import written_out
from elastax.dynamics import body_accelerations, multibody
from elastax.dynamics._linearised import force_tangents
from elastax.dynamics._screws import forces_by_screws

from tests import systems
from tests.helpers import assert_close, assert_gradient


ROBOTS = {
    "slides and hinges": lambda: systems.random_robot(5, 4, 3, counterbalance=True),
    "two links": lambda: systems.elastic_2r(),
}
each_robot = pytest.mark.parametrize("name", ROBOTS)


def inputs(robot, seed: int = 4):
    """State, and changes of it, of a robot in quick motion."""
    rng = np.random.default_rng(seed)
    n, m = robot.axes, robot.elastic
    draw = lambda: [jnp.asarray(rng.standard_normal(k)) for k in (n, m, n, m)]
    return draw(), draw(), jnp.asarray(10.0 * rng.standard_normal(n + m))


@pytest.mark.slow
@each_robot
def test_closed_form_is_autodiff(name):
    robot = ROBOTS[name]()
    state, changes, a = inputs(robot)
    n = robot.axes

    @jax.jit
    def both(state, changes, a):
        forces = lambda *x: forces_by_screws(robot, *x, a[:n], a[n:])
        expected = jax.jvp(forces, tuple(state), tuple(changes))[1]
        tangent = force_tangents(robot, *state, a)
        angles, speeds = jnp.concatenate(changes[:2]), jnp.concatenate(changes[2:])
        return tangent(angles, speeds), expected

    actual, expected = both(state, changes, a)
    scale = float(jnp.max(jnp.abs(expected)))
    # rounding of sums of some thousand terms; measured 2e-15
    assert_close(actual, expected, rtol=0, atol=1e-12 * scale)


def _symmetric(robot):
    """Cotangents of a robot's changes: inertia stays symmetric, its geometry as it is.

    The two routes read different elements of an inertia tensor.
    """
    even = lambda b: dataclasses.replace(
        b, inertia=0.5 * (b.inertia + jnp.swapaxes(b.inertia, 1, 2))
    )
    still = jax.tree.map(jnp.zeros_like, robot.chain)
    bodies, payload = even(robot.bodies), even(robot.payload)
    return dataclasses.replace(robot, chain=still, bodies=bodies, payload=payload)


@pytest.mark.slow
@each_robot
def test_tangents_against_the_factorised_matrix(name):
    """Forward and reverse, against autodiff through mass matrix and Cholesky."""
    robot = ROBOTS[name]()
    state, changes, force = inputs(robot)

    def plain(robot, q, eta, qd, etad, force):
        mass, bias = multibody(robot, q, eta, qd, etad)
        return jnp.linalg.solve(mass, force - bias)

    def derivatives(function):
        primals = robot, *state, force
        moved = jax.tree.map(lambda x: 0.1 * x, robot)
        # rotations that stop being rotations are no change of a robot
        still = jax.tree.map(jnp.zeros_like, robot.chain)
        tangents = dataclasses.replace(moved, chain=still), *changes, 0.3 * force
        value, pushed = jax.jvp(function, primals, tangents)
        pulled = jax.vjp(function, *primals)[1](jnp.ones_like(value))
        return value, pushed, (_symmetric(pulled[0]), *pulled[1:])

    with written_out():
        desired = systems.run(lambda: derivatives(plain))
    actual = systems.run(lambda: derivatives(body_accelerations))
    for one, other in zip(jax.tree.leaves(actual), jax.tree.leaves(desired)):
        scale = float(np.max(np.abs(other), initial=0.0))
        # rounding times the condition of the mass matrix
        assert_close(one, other, rtol=0, atol=1e-10 * scale)


@pytest.mark.slow
def test_gradient():
    robot = systems.elastic_2r()
    state, _, force = inputs(robot)

    def accelerations(mass, q, eta, qd, etad, force, rotors):
        bodies = dataclasses.replace(robot.bodies, mass=mass)
        moved = dataclasses.replace(robot, bodies=bodies)
        return body_accelerations(moved, q, eta, qd, etad, force, rotors)

    rotors = jnp.array([3.0, 2.0])
    assert_gradient(accelerations, robot.bodies.mass, *state, force, rotors)


def test_many_tangents_are_single_ones():
    """`jacfwd`, whose loop holds only what its tangents change, against `jvp`."""
    robot = systems.random_robot(6, 3, 2, counterbalance=False)
    state, changes, force = inputs(robot)
    function = functools.partial(body_accelerations, robot)
    point = (*state, force)
    columns = systems.run(lambda: jax.jacfwd(function, range(5))(*point))
    direction = (*changes, force)
    expected = systems.run(lambda: jax.jvp(function, point, direction)[1])
    total = sum(np.asarray(c) @ np.asarray(d) for c, d in zip(columns, direction))
    # rounding times the condition of the mass matrix
    assert_close(total, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())
