"""Public functions that are kernels, against themselves as they are written."""

import jax
import jax.numpy as jnp
import pytest
from elastax._kernel import written_out
from elastax.dynamics import (
    equations_of_motion,
    forward_dynamics,
    inverse_dynamics,
    multibody,
)
from elastax.inverse import ASIM, PositionCorrection
from elastax.kinematics import forward_kinematics, jacobian
from elastax.robots import kr210

from tests.systems import elastic_2r, random_robot, random_state

from .comparing import assert_same


slow = pytest.mark.slow
small = lambda: random_robot(3, axes=2, elastic=2, counterbalance=True)


def angles(robot, q):
    return jnp.tile(q, robot.chain.number)[: robot.chain.number]


STATE = {
    "forward_dynamics": lambda r, *s: forward_dynamics(r, *s[:6], s[8]),
    "inverse_dynamics": lambda r, q, eta, _, qd, etad, __, qdd, etadd, ___: (
        inverse_dynamics(r, q, qd, qdd, eta, etad, etadd)
    ),
    "multibody": lambda r, q, eta, _, qd, etad, *__: multibody(r, q, eta, qd, etad),
    "equations_of_motion": lambda r, *s: equations_of_motion(r, *s[:6]),
    "forward_kinematics": lambda r, q, *_: forward_kinematics(r.chain, angles(r, q)),
    "jacobian": lambda r, q, *_: jacobian(r.chain, angles(r, q)),
}


def scaled(tree):
    """Leaves over their magnitude: a tolerance relative to the whole."""
    largest = lambda leaf: jnp.max(jnp.abs(leaf), initial=1e-300)
    return jax.tree.map(lambda leaf: leaf / largest(leaf), tree)


def assert_equal_to_written(function, *args):
    result = jax.jit(lambda *args: scaled(function(*args)))(*args)
    with written_out():
        expected = jax.jit(lambda *args: scaled(function(*args)))(*args)
    assert_same(result, expected, rtol=1e-9, atol=1e-9)


def derivatives(function, robot, first, direction):
    """Of a function of a robot and a list of arrays."""
    value, pull = jax.vjp(lambda r, s: jax.tree.leaves(function(r, *s)), robot, first)
    weights = [jnp.cos(jnp.arange(v.size * 1.0)).reshape(v.shape) for v in value]
    gradient = jax.tree.leaves(pull(weights))
    along = lambda *s: function(robot, *s)
    return {
        "jvp": jax.jvp(along, tuple(first), tuple(direction)),
        "vjp": [g for g in gradient if g.dtype == first[0].dtype],
    }


# every function on a small robot with a counterbalance or on the one of the main job:
# what is written takes long to compile
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (small, "forward_kinematics"),
        (small, "jacobian"),
        pytest.param(small, "multibody", marks=slow),
        pytest.param(small, "equations_of_motion", marks=slow),
        pytest.param(kr210, "inverse_dynamics", marks=slow),
        pytest.param(kr210, "forward_dynamics", marks=slow),
        pytest.param(kr210, "forward_kinematics", marks=slow),
        pytest.param(kr210, "jacobian", marks=slow),
    ],
)
def test_equal_to_what_is_written(make, name):
    robot = make()
    function = STATE[name]

    def all_of(robot, states):
        first, second = [s[0] for s in states], [s[1] for s in states]
        batch = jax.vmap(lambda *state: function(robot, *state))(*states)
        return batch, derivatives(function, robot, first, second)

    assert_equal_to_written(all_of, robot, list(random_state(robot, 0, 4)))


@slow
@pytest.mark.parametrize("make", [elastic_2r, kr210], ids=["2r", "kr210"])
def test_step_of_asim(make):
    """A batch of two steps; the derivative of one along the reference, and in it."""
    robot = make()
    axes = (0, 1) if robot.axes < 3 else (0, 1, 2)
    inverse = ASIM(correction=PositionCorrection(axes=axes))
    scale = 0.3 * 10.0 ** jnp.arange(inverse.order(robot) + 1.0)[None, :, None]
    samples = scale * jax.random.normal(
        jax.random.key(0), (3, inverse.order(robot) + 1, robot.axes)
    )

    def function(robot, sample, following):
        state = inverse.init(robot, sample, 1e-3)
        _, state = inverse.step(robot, state, sample)
        return inverse.step(robot, state, following)[0]

    def one_step(robot, sample, following):
        state = inverse.init(robot, sample, 1e-3)
        return inverse.step(robot, state, following)[0]

    def all_of(robot, samples):
        if robot.axes > 3:  # the written derivatives take minutes to compile
            return jax.vmap(lambda s: function(robot, s, s))(samples)
        first, second = samples[0], samples[1]
        both = [first, first + 1e-3 * second]
        return derivatives(one_step, robot, both, [second, first])

    assert_equal_to_written(all_of, robot, samples)
