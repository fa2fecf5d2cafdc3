"""KUKA KR16-2: kinematics of the maker, plausible dynamics."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import locked_frequencies
from elastax.kinematics import SerialChain, forward_kinematics
from elastax.robots import kr16, kr210

from tests.helpers import assert_close


@pytest.fixture(scope="module")
def robot():
    return kr16()


def test_kinematics_is_that_of_the_maker(robot):
    """The joint frames of kuka_experimental, kr16_2, in its own convention."""
    position = [[0, 0, 0.675], [0.26, 0, 0], [0.68, 0, 0]]
    position += [[0.67, 0, -0.035], [0, 0, 0], [0, 0, 0]]
    axis = [[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    tool = np.eye(4)
    tool[:3, 3] = [0.158 + 0.12, 0, 0]
    chain = SerialChain.from_rpy(
        np.array(position, float), np.zeros((6, 3)), np.array(axis, float), tool=tool
    )
    angles = jnp.array([0.3, -0.7, 0.9, 1.1, -0.4, 2.0])
    reach = eqx.filter_jit(lambda chain, q: forward_kinematics(chain, q))
    ours = reach(robot.rigid().chain, robot.from_maker(angles))
    theirs = reach(chain, angles)
    assert_close(ours[:3, 3], theirs[:3, 3], rtol=0, atol=1e-14)
    # z of our flange points outwards, as their x does
    assert_close(ours[:3, 2], theirs[:3, 0], rtol=0, atol=1e-14)


@pytest.mark.slow
def test_first_eigenfrequencies(robot):
    find = eqx.filter_jit(locked_frequencies)
    large = kr210()
    for name, pose in robot.poses.items():
        frequencies = find(robot, robot.from_maker(pose))
        assert np.all(np.isfinite(frequencies)), name
        # smaller and less loaded: stiffer than the large arm
        ratio = frequencies[0] / find(large, large.from_maker(large.poses[name]))[0]
        assert 1.3 < ratio < 2.0, name
        assert 7.0 < frequencies[0] < 15.0, name


def test_record(robot):
    assert robot.axes == 6 and robot.elastic == 8
    assert_close(robot.payload.mass, [16.0], rtol=0)
    moving = float(robot.bodies.mass.sum())
    assert 180.0 < moving < 235.0
    limits = np.rad2deg(robot.limits.velocity)
    assert_close(limits, [156.0, 156.0, 156.0, 330.0, 330.0, 615.0], rtol=1e-14)
    for name, pose in robot.poses.items():
        inside = (pose >= robot.limits.lower) & (pose <= robot.limits.upper)
        assert np.all(inside), name
    assert any("similarity" in line for line in robot.assumptions)
