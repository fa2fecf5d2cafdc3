"""Controller flags: examples, round trips over random poses, turns and limits."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    FanucConfiguration,
    KukaConfiguration,
    fanuc_configuration,
    fanuc_joint_angles,
    forward_kinematics,
    kuka_configuration,
    kuka_joint_angles,
)
from elastax.robots import fanuc, kr210

from tests.helpers import assert_close


@pytest.fixture(scope="module")
def kuka():
    return kr210().arm()


@pytest.fixture(scope="module")
def fanuc_arm():
    return fanuc()


@eqx.filter_jit
def kuka_there_and_back(arm, q):
    """Flags of joint angles, and the angles that flags and pose select."""

    def one(q):
        flags = kuka_configuration(arm, q)
        return flags, *kuka_joint_angles(arm, forward_kinematics(arm.chain, q), flags)

    return jax.vmap(one)(q)


@eqx.filter_jit
def fanuc_there_and_back(arm, q):
    def one(q):
        flags = fanuc_configuration(arm, q)
        return flags, *fanuc_joint_angles(arm, forward_kinematics(arm.chain, q), flags)

    return jax.vmap(one)(q)


def within_limits(arm, count, seed):
    uniform = np.random.default_rng(seed).uniform(0.0, 1.0, (count, 6))
    lower, upper = np.asarray(arm.lower)[None], np.asarray(arm.upper)[None]
    return jnp.asarray(lower + (upper - lower) * uniform)


@pytest.mark.parametrize(
    ("degrees", "status", "turn"),
    [
        # wrist in front, forearm below the line, hand down; A2 negative
        ([0, -90, 90, 0, 45, 0], 2, 2),
        # negative A2 and A5: 2 + 16
        ([91, -45, 37, 1, -1, 0], 6, 18),
        # negative A1, A4, A6: 1 + 8 + 32
        ([-10, 10, 20, -30, 40, -50], 2, 41),
        # forearm folded up from the stretched arm
        ([5, -10, -60, 5, 30, 5], 0, 6),
        # leaning back: the wrist is behind axis 1
        ([5, -130, -20, 5, 30, 5], 1, 6),
    ],
)
def test_kuka_flags(kuka, degrees, status, turn):
    q = kuka.from_maker(jnp.deg2rad(jnp.array(degrees, float)))
    flags = kuka_configuration(kuka, q)
    assert (int(flags.status), int(flags.turn)) == (status, turn)


def test_kuka_elbow_changes_at_the_stretched_forearm(kuka):
    """Not at A3 = 0: the wrist lies 41 mm beside the line through axis 3 there."""
    middle = np.arctan2(0.041, 1.2)
    for side in (1e-6, -1e-6):
        angle = -middle + side
        q = kuka.from_maker(jnp.array([0.0, 0.1, angle, 0.0, 0.5, 0.0]))
        assert int(kuka_configuration(kuka, q).status) == (2 if side > 0 else 0)


@pytest.mark.slow
def test_kuka_round_trip(kuka):
    q = within_limits(kuka, 2000, 0)
    flags, back, reached = kuka_there_and_back(kuka, q)
    assert np.all(reached)
    # rounding over the smallest distance from a singular pose in the batch
    assert_close(back, q, rtol=0.0, atol=1e-8)
    assert set(np.unique(flags.status)) == set(range(8))
    assert len(np.unique(flags.turn)) == 64


@pytest.mark.slow
def test_fanuc_round_trip(fanuc_arm):
    q = within_limits(fanuc_arm, 2000, 1)
    # the range of axis 3 overlaps itself by two degrees
    q = q.at[:, 2].min(np.deg2rad(227.0))
    flags, back, reached = fanuc_there_and_back(fanuc_arm, q)
    assert np.all(reached)
    assert_close(back, q, rtol=0.0, atol=1e-8)
    assert {-1, 0, 1} == set(np.unique(flags.turns[:, 1:]))
    combinations = np.stack([flags.flip, flags.up, flags.front], axis=1)
    assert len(np.unique(combinations, axis=0)) == 8


@pytest.mark.parametrize(
    ("degrees", "text"),
    [
        ([0, 0, 0, 0, -90, 0], "N U T, 0, 0, 0"),
        ([0, 0, 0, 0, 90, 0], "F U T, 0, 0, 0"),
        ([10, 0, 0, 200, -90, -190], "N U T, 0, 1, -1"),
        ([0, -60, 130, 0, -30, 0], "N D T, 0, 0, 0"),
        ([0, 50, 40, 0, -30, 0], "N U B, 0, 0, 0"),
        ([0, 50, 100, 0, -30, 0], "N D B, 0, 0, 0"),
    ],
)
def test_fanuc_text(fanuc_arm, degrees, text):
    q = fanuc_arm.from_maker(jnp.deg2rad(jnp.array(degrees, float)))
    assert fanuc_configuration(fanuc_arm, q).text() == text


@pytest.mark.slow
def test_turn_selects_between_angles_a_turn_apart(kuka):
    q = kuka.from_maker(jnp.deg2rad(jnp.array([20.0, -60, 80, 150, 30, -170])))
    pose = forward_kinematics(kuka.chain, q)
    flags = kuka_configuration(kuka, q)
    assert int(flags.turn) == 0b100010
    # the signs of the axes 4 and 6 exchanged
    other = KukaConfiguration(flags.status, 0b001010)
    angles, reached = kuka_joint_angles(kuka, pose, other)
    assert bool(reached)
    change = kuka.to_maker(angles) - kuka.to_maker(q)
    assert_close(change / (2 * np.pi), [0, 0, 0, -1, 0, 1], rtol=0.0, atol=1e-12)


def test_an_axis_at_zero_is_not_carried_around(kuka):
    q = kuka.from_maker(jnp.deg2rad(jnp.array([0.0, -60, 80, 0, 30, 0])))
    pose = forward_kinematics(kuka.chain, q)
    for turn in (0b000010, 0b101011):
        angles, reached = kuka_joint_angles(kuka, pose, KukaConfiguration(2, turn))
        assert bool(reached)
        assert_close(angles, q, rtol=0.0, atol=1e-12)


def test_flags_that_nothing_satisfies_are_masked(kuka, fanuc_arm):
    q = kuka.from_maker(jnp.deg2rad(jnp.array([20.0, -60, 80, 15, 30, -17])))
    pose = forward_kinematics(kuka.chain, q)
    status = kuka_configuration(kuka, q).status
    # A2 is at -60 degrees; as a positive angle it would be 300
    angles, reached = kuka_joint_angles(kuka, pose, KukaConfiguration(status, 0))
    assert not bool(reached) and np.all(np.isfinite(angles))
    far = pose.at[0, 3].set(20.0)
    angles, reached = kuka_joint_angles(kuka, far, KukaConfiguration(status, 34))
    assert not bool(reached) and np.all(np.isfinite(angles))
    flags = FanucConfiguration(False, True, True, jnp.array([0, 0, 4]))
    pose = forward_kinematics(fanuc_arm.chain, fanuc_arm.from_maker(jnp.full(6, 0.1)))
    angles, reached = fanuc_joint_angles(fanuc_arm, pose, flags)
    assert not bool(reached) and np.all(np.isfinite(angles))


def test_aligned_wrist_with_previous_angles(kuka):
    q = kuka.from_maker(jnp.deg2rad(jnp.array([20.0, -60, 80, 15, 0, 40])))
    flags = kuka_configuration(kuka, q)
    pose = forward_kinematics(kuka.chain, q)
    angles, reached = kuka_joint_angles(kuka, pose, flags, q)
    assert bool(reached)
    assert_close(angles, q, rtol=0.0, atol=1e-10)


def test_limits_are_those_of_the_arm(kuka):
    q = kuka.from_maker(jnp.deg2rad(jnp.array([20.0, -60, 80, 15, 30, -17])))
    flags, pose = kuka_configuration(kuka, q), forward_kinematics(kuka.chain, q)
    narrow = dataclasses.replace(kuka, upper=jnp.full(6, q[2] - 0.01) + 0 * kuka.upper)
    assert not bool(kuka_joint_angles(narrow, pose, flags)[1])
