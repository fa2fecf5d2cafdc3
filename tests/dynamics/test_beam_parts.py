"""Beams of hinges as parts: statics and eigenfrequencies of a cantilever."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import (
    Axis,
    Body,
    FlexibleLink,
    clamped_beam_parts,
    equations_of_motion,
    segmented_beam_parts,
)
from elastax.kinematics import forward_kinematics
from elastax.structure import (
    BeamSection,
    BeamSegments,
    ClampHinges,
    GaussHinges,
    Material,
    ModeCounts,
    SlenderBody,
    UniformBeam,
    modal_beam,
)

from tests.helpers import assert_close
from tests.systems import assembled, drive_train


BEAM = UniformBeam(
    Material(young=7e10, shear=2.6e10, density=2700.0),
    BeamSection.circular_tube(diameter=0.06, wall=0.003),
    0.9,
)
LENGTH, MASS = 0.9, float(BEAM.mass())
SECTION = float(BEAM.section.second_moment_y) * 2700.0 * LENGTH
MOMENTS = np.array([2.0 * SECTION, *[MASS * LENGTH**2 / 12.0 + SECTION] * 2])
BENDING = float(BEAM.rigidity()[1])


def cantilever(parts):
    """The beam on an axis that stands still."""
    return assembled(
        "cantilever",
        [Axis("A1"), Body("hub", 1.0, (0.0, 0.0, 0.0), np.eye(3)), *parts],
        drive_train(1),
        gravity=(0.0, 0.0, 0.0),
        counterbalanced_axis=0,
    )


def segmented():
    body = SlenderBody(MASS, LENGTH, 0.5 * LENGTH, MOMENTS)
    segments = BeamSegments.of(body, per_axis=True)
    return cantilever(
        segmented_beam_parts("beam", segments, GaussHinges.of(BEAM), np.ones(3))
    )


def hinged():
    body = Body("beam", MASS, (0.5 * LENGTH, 0.0, 0.0), np.diag(MOMENTS))
    hinges = ClampHinges.of(BEAM)
    return cantilever(clamped_beam_parts("beam", body, hinges, np.ones(3)))


def modal(number):
    body = modal_beam(BEAM, ModeCounts(number, number), damping_ratio=0.01)
    return cantilever([FlexibleLink("beam", body, "tip")])


def structure(robot):
    """Mass and stiffness of the elastic coordinates."""
    zero, rest = jnp.zeros(1), jnp.zeros(robot.elastic)
    mass = equations_of_motion(robot, zero, rest, zero, zero, rest, zero).M_ee
    return np.asarray(mass), np.diag(
        np.asarray(robot.structure_stiffness.stiffness(rest))
    )


def bending_frequencies(robot):
    """Over that of the first mode of the exact cantilever, without torsion."""
    mass, stiffness = structure(robot)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    exact = 1.875104068711961**4 * BENDING / (MASS / LENGTH) / LENGTH**4
    return np.sqrt(squares / exact)


def test_coordinates():
    assert segmented().elastic_names == (
        "beam y 1",
        "beam z 1",
        "beam x",
        "beam y 2",
        "beam z 2",
    )
    assert hinged().elastic_names == ("beam x", "beam y", "beam z")


@pytest.mark.parametrize("make", [segmented, hinged], ids=["five", "three"])
def test_tip_compliance(make):
    robot = make()

    def tip(eta):
        pose = forward_kinematics(
            robot.chain, robot.joint_coordinates(jnp.zeros(1), eta)
        )
        return jnp.stack([pose[2, 3], pose[0, 2], pose[1, 3], pose[1, 0]])

    levers = np.asarray(jax.jacfwd(tip)(jnp.zeros(robot.elastic)))
    _, stiffness = structure(robot)
    compliance = levers @ np.linalg.inv(stiffness) @ levers.T
    exact = np.asarray(BEAM.tip_compliance())
    # pose[0, 2] is minus the slope of z, hence the magnitudes
    whole = np.abs(compliance[:2, :2]), np.abs(compliance[2:, 2:])
    assert np.all(compliance[2:, 2:] > 0)
    for found, expected in zip(whole, exact, strict=True):
        if make is segmented:
            assert_close(found, expected, rtol=1e-10)
        else:  # exact under a force; the slope under a moment is a quarter low
            assert_close(found[:, 0], expected[:, 0], rtol=1e-10)
            assert_close(found[1, 1], 0.75 * expected[1, 1], rtol=1e-10)


def test_eigenfrequencies_of_a_lumped_cantilever():
    five, three = bending_frequencies(segmented()), bending_frequencies(hinged())
    # the first mode, in both planes: segments make it 1.1 % low; a body on one hinge,
    # sqrt(9 / 12.36), 15 %
    assert_close(five[:2], np.full(2, 0.9886), rtol=5e-4)
    assert_close(three[:2], [np.sqrt(9.0 / 12.3624)] * 2, rtol=2e-3)
    # the second of the exact beam is 6.267 times the first: what two hinges have
    # there, in both planes, is 58 % high
    assert_close(five[2:4], np.full(2, 1.582 * 6.2669), rtol=1e-3)


@pytest.mark.slow
def test_modes_converge_from_above():
    # behind a tip mass the clamped modes of the bare beam are a Ritz series
    load = Body("load", 2.0 * MASS, (0.0, 0.0, 0.0), 1e-3 * np.eye(3))
    first = []
    for number in (1, 2, 4):
        robot = modal(number)
        body = robot.modal_links[0].body
        loaded = cantilever([FlexibleLink("beam", body, "tip"), load])
        first.append(bending_frequencies(loaded)[0])
    root = 1.076195  # of 1 + cos cosh + 2 b (cos sinh - sin cosh), tip mass 2
    exact = (root / 1.875104068711961) ** 2
    errors = np.array(first) / exact - 1.0
    assert np.all(np.diff(errors) < 0)
    assert errors[0] < 0.02 and abs(errors[2]) < 2e-3
