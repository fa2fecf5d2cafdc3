"""Limits of reach against closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    JointKind,
    SerialChain,
    extent,
    forward_kinematics,
    random_joints,
    reach_limits,
    reachable_points,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import kuka, mixed, planar


reach = eqx.filter_jit(reach_limits)
WIDE = jnp.full(2, np.pi)


def wrist_arm():
    """The KUKA-like arm up to its wrist centre."""
    chain = kuka(wrist_height=0.0)
    return SerialChain(chain.joints, chain.base, jnp.eye(4), chain.kinds)


def test_planar_arm():
    found = reach(planar(0.5, 0.4), -WIDE, WIDE)
    # an extreme is flat: half the digits of the angles are enough for all of the length
    assert_close(found.largest, jnp.array(0.9), rtol=1e-14)
    assert_close(found.least, jnp.array(0.1), rtol=1e-12)
    assert_close(jnp.abs(found.q_least[1]), jnp.array(np.pi), rtol=1e-7)


def test_limits_are_met():
    """q2 from 30 to 120 degrees: the law of cosines at both ends."""
    low, high = jnp.array([-1.0, np.pi / 6]), jnp.array([1.0, 2 * np.pi / 3])
    found = reach(planar(0.5, 0.4), low, high)
    expected = jnp.sqrt(0.41 + 0.4 * jnp.cos(jnp.array([2 * np.pi / 3, np.pi / 6])))
    assert_close(jnp.stack([found.least, found.largest]), expected, rtol=1e-14)
    shifted = reach(planar(0.5, 0.4), low + 2 * np.pi, high + 2 * np.pi)
    assert_close(shifted.largest, expected[1], rtol=1e-13)


@pytest.mark.slow
def test_reach_of_a_wrist_centre():
    """From axis 2 the two links, from the base the offsets as well."""
    chain, wide = wrist_arm(), jnp.full(6, np.pi)
    shoulder = jnp.array([0.26, 0.0, 0.675])
    low, high = -wide.at[0].set(1e-3), wide.at[0].set(1e-3)
    found = reach(chain, low, high, centre=shoulder)
    # axis 1 turns the shoulder by 1e-3 rad, to second order
    assert_close(found.largest, jnp.array(1.35), rtol=1e-6)
    assert_close(found.least, jnp.array(0.01), rtol=1e-3)
    far = reach(chain, -wide, wide)
    expected = np.hypot(0.26, 0.675) + 1.35
    assert_close(far.largest, jnp.array(expected), rtol=1e-10)


@pytest.mark.slow
def test_no_sample_is_beyond():
    for chain in (kuka(), mixed()):
        wide = jnp.full(chain.number, 1.5)
        found = reach(chain, -wide, wide)
        q = random_joints(-wide, wide, 20000, key=jax.random.key(5))
        distance = jnp.linalg.norm(jax.jit(reachable_points)(chain, q), axis=1)
        assert float(distance.max()) <= float(found.largest)
        assert float(distance.min()) >= float(found.least)
        ends = [forward_kinematics(chain, x) for x in (found.q_least, found.q_largest)]
        for pose, length in zip(ends, (found.least, found.largest), strict=True):
            assert_close(jnp.linalg.norm(pose[:3, 3]), length, rtol=1e-13, atol=1e-15)


@pytest.mark.slow
def test_extent_along_a_direction():
    found = eqx.filter_jit(extent)(
        planar(0.5, 0.4), -WIDE, WIDE, jnp.array([3.0, 4, 0])
    )
    assert_close(
        jnp.stack([found.least, found.largest]), jnp.array([-0.9, 0.9]), rtol=1e-14
    )
    # of the KUKA-like arm upright, hand up: shoulder, both links and the tool
    wide = jnp.full(6, np.pi)
    up = jnp.array([0.0, 0.0, 1.0])
    high = eqx.filter_jit(extent)(kuka(wrist_height=0.0), -wide, wide, up)
    expected = jnp.array([0.675 - 1.465, 0.675 + 1.465])
    assert_close(jnp.stack([high.least, high.largest]), expected, rtol=1e-10)


def test_sliding_joints():
    """A gantry: the corners of the box, and its inside."""
    slides = (JointKind.PRISMATIC,) * 3
    chain = SerialChain.from_frames(
        np.tile(np.eye(3), (3, 1, 1)), np.zeros((3, 3)), np.eye(3), kinds=slides
    )
    low, high = jnp.array([-1.0, 0.5, -2.0]), jnp.array([2.0, 1.0, 1.0])
    found = reach(chain, low, high)
    assert_close(found.largest, jnp.array(3.0), rtol=1e-15)
    assert_close(found.q_largest, jnp.array([2.0, 1.0, -2.0]), rtol=1e-15)
    assert_close(found.least, jnp.array(0.5), rtol=1e-15)
    assert_close(found.q_least, jnp.array([0.0, 0.5, 0.0]), rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_gradient():
    """By the lengths, and by the limit that is met; zero where nothing is gained."""

    def both(a, b, upper):
        zero = jnp.zeros(2)
        chain = SerialChain.from_dh(zero, zero, jnp.stack([a, b]), zero)
        found = reach_limits(chain, -upper, upper, rounds=20)
        return found.least, found.largest

    args = jnp.array(0.5), jnp.array(0.4), jnp.array([1.0, 2.0])
    assert_gradient(both, *args)
    slopes = jax.jit(jax.grad(lambda *x: both(*x)[1], (0, 1, 2)))(*args)
    assert_close(slopes, (1.0, 1.0, np.zeros(2)), rtol=1e-12, atol=1e-12)
    touching = jax.jit(jax.grad(lambda *x: both(*x)[0], (0, 1)))
    found = touching(jnp.array(0.5), jnp.array(0.5), jnp.array([1.0, np.pi]))
    assert np.all(np.isfinite(found))


@pytest.mark.slow
def test_batches():
    chain = planar(0.5, 0.4)
    limits = jnp.array([[1.0, 2.0], [0.5, 0.7]])
    function = lambda h: reach_limits(chain, -h, h, rounds=20)
    mapped = jax.jit(jax.vmap(function))(limits)
    loop = [jax.jit(function)(h) for h in limits]
    assert_close(mapped.least, jnp.stack([f.least for f in loop]), rtol=1e-12)
    assert_close(mapped.largest, jnp.stack([f.largest for f in loop]), rtol=1e-12)
