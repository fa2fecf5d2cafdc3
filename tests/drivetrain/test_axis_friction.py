"""Different friction laws on the axes of one robot."""

import jax
import jax.numpy as jnp
import pytest
from elastax.drivetrain import AxisFriction, CoulombViscousFriction, StribeckFriction

from tests.helpers import assert_close


main = CoulombViscousFriction(
    jnp.array([12.5, 9.0]), jnp.array([38.0, 20.0]), jnp.array([45.0, 60.0])
)
wrist = StribeckFriction(12.5, 3.0, 90.0, 8.0, 0.02)
law = AxisFriction((main, wrist), ((3, 0), (1, 2)))
SPEED = jnp.array([0.3, -0.01, 0.02, -2.0])


def test_every_law_acts_on_its_own_axes():
    outer, inner = main.torque(SPEED[jnp.array([3, 0])]), wrist.torque(SPEED[1:3])
    expected = jnp.array([outer[1], inner[0], inner[1], outer[0]])
    assert_close(law.torque(SPEED), expected, rtol=1e-15)
    batch = jnp.stack([SPEED, -SPEED])
    both = jax.jit(jax.vmap(law.torque))(batch)
    assert_close(both, jnp.stack([expected, -expected]), rtol=1e-14)


def test_axes_in_order_need_no_permutation():
    straight = AxisFriction((main, wrist), ((0, 1), (2, 3)))
    expected = jnp.concatenate([main.torque(SPEED[:2]), wrist.torque(SPEED[2:])])
    assert_close(straight.torque(SPEED), expected, rtol=1e-15)


def test_referral_and_scale_per_axis():
    ratio = jnp.array([100.0, -50.0, 80.0, 120.0])
    torque = law.to_output_side(ratio).torque(SPEED)
    assert_close(torque, ratio * law.torque(ratio * SPEED), rtol=1e-14)
    assert_close(law.scaled(0.7).torque(SPEED), 0.7 * law.torque(SPEED), rtol=1e-14)
    factor = jnp.array([0.5, 0.7, 0.7, 2.0])
    of_one = AxisFriction((main, main), ((3, 0), (1, 2)))
    scaled = of_one.scaled(factor).torque(SPEED)
    assert_close(scaled, factor * of_one.torque(SPEED), rtol=1e-14)


def test_monotone_per_axis():
    falling = StribeckFriction(1.0, 3.0, 90.0, 8.0, 0.02)
    mixed = AxisFriction((main, falling), ((3, 0), (1, 2)))
    assert mixed.is_monotone().tolist() == [True, False, False, True]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: AxisFriction((main,), ((0, 1), (2, 3))), "a group for each of the 1"),
        (lambda: AxisFriction((main, wrist), ((0, 1), (1, 2))), "every axis from 0"),
        (lambda: AxisFriction((main, wrist), ((0, 1), (3,))), "every axis from 0"),
        (lambda: AxisFriction((main, wrist), ((0, 1), ())), "every axis from 0"),
        (lambda: law.torque(SPEED[:3]), "hold for 4 axes, but the argument has 3"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
