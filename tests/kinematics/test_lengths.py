"""Lengths that are hardly in metres."""

import numpy as np
import pytest
from elastax.kinematics import SerialChain, length_doubts
from elastax.robots import kr210

from tests.kinematics.arms import fanuc, kuka, mixed, planar, puma


def spindle(length: float) -> SerialChain:
    """One joint with a tool."""
    tool = np.eye(4)
    tool[0, 3] = length
    return SerialChain.from_dh([0.0], [0.0], [0.0], [0.0], tool=tool)


@pytest.mark.parametrize("build", [kuka, puma, mixed, lambda: fanuc(1e-3)])
def test_metres_raise_no_doubt(build):
    assert length_doubts(build()) == ()
    assert length_doubts(kr210().chain) == ()


@pytest.mark.parametrize(
    ("chain", "words"),
    [
        # the table of the text as it is printed
        (fanuc(), ("3107 m", "may be in millimetres")),
        (planar(0.6, 500.0, 0.4), ("500", "0.4", "may be mixed")),
        (planar(15.0, 20.0, 18.0), ("53 m", "millimetres")),
        (planar(1e-2, 2e-2), ("0.03 m only",)),
        (spindle(400.0), ("400 m", "millimetres")),
    ],
)
def test_doubts(chain, words):
    (text,) = length_doubts(chain)
    for word in words:
        assert word in text


def test_points_are_no_lengths():
    """Joints in one place: nothing can be said."""
    assert length_doubts(planar(0.0, 0.0)) == ()
