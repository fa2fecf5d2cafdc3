"""Different spring laws on the axes of one robot."""

import jax
import jax.numpy as jnp
import pytest
from elastax.structure import (
    AxisStiffness,
    CubicStiffness,
    LimitedStiffness,
    LinearStiffness,
)

from tests.helpers import assert_close, assert_gradient


main = LimitedStiffness(
    jnp.array([2e5, 3e5]),
    jnp.array([4e4, 1e4]),
    jnp.array([5e5, 6e5]),
    jnp.full(2, 2e-4),
)
cubic, linear = CubicStiffness(1e5, 2e4), LinearStiffness(3e4)
spring = AxisStiffness((main, cubic, linear), ((3, 0), (1,), (2,)))
TORSION = jnp.array([1e-3, -4e-3, 2e-3, 9e-3])
METHODS = ("torque", "torsion", "stiffness", "secant", "potential")


@pytest.mark.parametrize("method", METHODS)
def test_every_law_acts_on_its_own_axes(method):
    argument = spring.torque(TORSION) if method == "torsion" else TORSION
    outer = getattr(main, method)(argument[jnp.array([3, 0])])
    inner = [getattr(cubic, method)(argument[1]), getattr(linear, method)(argument[2])]
    expected = jnp.array([outer[1], *inner, outer[0]])
    assert_close(getattr(spring, method)(argument), expected, rtol=1e-15)


def test_torsion_inverts_torque():
    batch = TORSION[None] * jnp.array([1e-12, 1.0, 1e6])[:, None]
    round_trip = jax.jit(jax.vmap(lambda x: spring.torsion(spring.torque(x))))
    assert_close(round_trip(batch), batch, rtol=1e-14)


@pytest.mark.slow
def test_gradients():
    assert_gradient(lambda s, x: s.torque(x), spring, TORSION, order=2)
    assert_gradient(lambda s, x: s.torsion(x), spring, spring.torque(TORSION), order=2)
    assert_gradient(lambda s, x: s.potential(x), spring, TORSION)


def test_scaled():
    assert_close(
        spring.scaled(1.3).torque(TORSION), 1.3 * spring.torque(TORSION), rtol=1e-14
    )
    factor = jnp.array([0.5, 0.7, 1.0, 2.0])
    soft = AxisStiffness((linear, linear), ((3, 0), (1, 2)))
    scaled = soft.scaled(factor).torque(TORSION)
    assert_close(scaled, factor * soft.torque(TORSION), rtol=1e-14)


@pytest.mark.parametrize("axes", [((0,), (1,)), ((0,), (1,), (1,)), ((0,), (1,), (3,))])
def test_axes_that_do_not_cover_the_robot_once_are_refused(axes):
    with pytest.raises(ValueError, match="`axes` must"):
        AxisStiffness((linear, linear, linear), axes)
