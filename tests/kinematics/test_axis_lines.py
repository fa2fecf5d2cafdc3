"""Axes of chains as lines."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    SerialChain,
    axis_lines,
    characteristic_length,
    forward_kinematics,
    jacobian,
    to_dh,
)

from tests.helpers import assert_close
from tests.kinematics.arms import fanuc, kuka, mixed, planar, puma
from tests.kinematics.geometries import disturbed, gantry, kr210, ur


@pytest.mark.parametrize(
    "chain", [kuka(), mixed(), kr210()], ids="kuka mixed kr".split()
)
def test_lines_give_the_jacobian(chain):
    lines, zero = axis_lines(chain), jnp.zeros(chain.number)
    assert_close(lines.tool, forward_kinematics(chain, zero), rtol=0.0, atol=1e-14)
    levers = np.cross(lines.directions, lines.tool[:3, 3] - lines.points)
    turns = np.array(lines.turns)[:, None]
    columns = np.where(turns, levers, lines.directions), turns * lines.directions
    expected = np.concatenate(columns, axis=1).T
    assert_close(jacobian(chain, zero), expected, rtol=0.0, atol=1e-14)


def test_characteristic_length():
    # tool in front of the last axis; the axes' distances are smaller
    assert characteristic_length(planar(1.0, 0.7, 0.2)) == pytest.approx(1.9, rel=1e-14)
    assert characteristic_length(fanuc()) == pytest.approx(
        1e3 * characteristic_length(fanuc(1e-3)), rel=1e-12
    )
    # one hinge through the tool: nothing to measure
    zero = np.zeros(1)
    assert characteristic_length(SerialChain.from_dh(zero, zero, zero, zero)) == 1.0
    assert characteristic_length(gantry()) == pytest.approx(np.hypot(0.05, 0.2))


@pytest.mark.slow
def test_far_origins_are_brought_near():
    chain = disturbed(ur(), 1e-5)
    far = to_dh(chain)
    assert np.max(np.abs(far.joints.d)) > 1e2
    points, near = axis_lines(far).points, axis_lines(chain)
    assert np.max(np.abs(points)) < 10.0
    off = np.cross(points - near.points, near.directions)
    # the axes' directions, to rounding, times the distance of the origins
    assert np.max(np.abs(off)) < 1e-10


def test_refusals():
    with pytest.raises(ValueError, match="traced"):
        jax.jit(lambda chain: axis_lines(chain).points)(puma())
    broken = SerialChain.from_dh(*np.full((4, 2), np.nan))
    with pytest.raises(ValueError, match="finite"):
        axis_lines(broken)
