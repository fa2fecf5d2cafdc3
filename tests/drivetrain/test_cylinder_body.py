"""Mass and lateral offset of a counterbalance's cylinder."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import CylinderBody, GasCounterbalance, SpringCounterbalance

from tests.helpers import assert_close, assert_gradient


BODY = CylinderBody(mass=38.0, mass_position=0.43, lateral_offset=-0.12)
SPRING = SpringCounterbalance(0.72, 0.19, 0.35, 9e4, 0.53, 1.1e4, body=BODY)
GAS = GasCounterbalance(0.8, 0.2, 1.66, 0.6, 1.6e7, 9.6e-4, 0.055, 0.03, body=BODY)
each_element = pytest.mark.parametrize("element", [SPRING, GAS], ids=["spring", "gas"])
ANGLE = jnp.array([-1.4, -0.35, 0.2, 1.1])
DOWN = jnp.array([-4.1, -8.9])


def point(element, angle, share):
    """On the cylinder, from its length and inclination to the carrier's x axis."""
    a, b = element.lever, element.base_distance
    psi = angle + element.angle_offset
    length = jnp.sqrt(a**2 + b**2 - 2 * a * b * jnp.cos(psi))
    slope = jnp.arctan2(a * jnp.sin(psi), a * jnp.cos(psi) - b)
    start = jnp.stack([b, jnp.zeros(())])
    return start + share * length * jnp.stack([jnp.cos(slope), jnp.sin(slope)])


@each_element
def test_mass_obeys_lagrange(element):
    def lagrangian(angle, speed):
        place = lambda phi: point(element, phi, BODY.mass_position)
        r, v = jax.jvp(place, (angle,), (speed,))
        return 0.5 * BODY.mass * v @ v + BODY.mass * DOWN @ r

    def needed(angle, speed, acceleration):
        momentum = jax.grad(lagrangian, 1)
        _, rate = jax.jvp(momentum, (angle, speed), (speed, acceleration))
        return rate - jax.grad(lagrangian)(angle, speed)

    speed, acceleration = jnp.array([2.0, -3.0, 0.0, 5.0]), jnp.array([7.0, 1, -4, 0])

    @jax.jit
    def both(angle, speed, acceleration):
        inertia, slope = jax.jvp(element.inertia, (angle,), (jnp.ones(()),))
        ours = inertia * acceleration + 0.5 * slope * speed**2
        ours = ours - element.gravity_torque(angle, DOWN)
        return ours, needed(angle, speed, acceleration)

    ours, theirs = jax.vmap(both)(ANGLE, speed, acceleration)
    # A few roundings of terms of 30 N m.
    assert_close(ours, theirs, rtol=0.0, atol=1e-12)
    assert jnp.min(jnp.abs(theirs)) > 1.0


@each_element
def test_pull_beside_the_plane_of_motion(element):
    offset = BODY.lateral_offset * np.array([0.0, 0.0, 1.0])
    for angle in ANGLE:
        rocker = np.append(point(element, angle, 1.0), 0.0)
        along = np.array([element.base_distance, 0.0, 0.0]) - rocker
        pull = element.force(angle) * along / np.linalg.norm(along)
        moment = np.cross(rocker + offset, pull)
        psi = angle + element.angle_offset
        a, b = element.lever, element.base_distance
        direction = np.array([a * np.sin(psi), b - a * np.cos(psi)])
        direction = direction / element.length(angle)
        # Rounding of forces of 30 kN at a metre.
        ours = element.lateral_moment(angle) * direction
        assert_close(moment[:2], ours, rtol=0.0, atol=1e-10)
        assert_close(moment[2], element.torque(angle), rtol=0.0, atol=1e-10)
        assert abs(element.lateral_moment(angle)) > 1e3


@each_element
def test_limits(element):
    at = lambda **changes: dataclasses.replace(
        element, body=dataclasses.replace(BODY, **changes)
    )
    # at the rocker's hinge all of the mass turns with the rocker, at the carrier's none
    whole = BODY.mass * element.lever**2 * jnp.ones(4)
    assert_close(at(mass_position=1.0).inertia(ANGLE), whole, rtol=1e-14)
    held, hinge = at(mass_position=0.0), jnp.zeros(4)
    assert_close(held.inertia(ANGLE), hinge, rtol=0.0)
    assert_close(held.gravity_torque(ANGLE, DOWN), hinge, rtol=0.0)
    # without a body, or with one of zeros, as before
    for bare in (
        dataclasses.replace(element, body=None),
        dataclasses.replace(element, body=CylinderBody()),
    ):
        assert_close(bare.inertia(ANGLE), hinge, rtol=0.0)
        assert_close(bare.gravity_torque(ANGLE, DOWN), hinge, rtol=0.0)
        assert_close(bare.lateral_moment(ANGLE), hinge, rtol=0.0)
        assert_close(bare.torque(ANGLE), element.torque(ANGLE), rtol=0.0)
    assert len(jax.tree.leaves(element)) == len(jax.tree.leaves(held))
    extremes = jnp.array([0.0, 1e-300, 1e8, -1e8])
    for values in (
        element.inertia(extremes),
        element.gravity_torque(extremes, DOWN),
        element.lateral_moment(extremes),
    ):
        assert jnp.all(jnp.isfinite(values))


def laws(element, angle, down):
    return (
        element.inertia(angle),
        element.gravity_torque(angle, down),
        element.lateral_moment(angle),
    )


@pytest.mark.slow
@each_element
def test_gradient(element):
    assert_gradient(laws, element, ANGLE, DOWN, order=2)


def test_jit_vmap_and_loop_agree():
    loop = [laws(SPRING, angle, DOWN) for angle in ANGLE]
    mapped = jax.jit(jax.vmap(laws, (None, 0, None)))(SPRING, ANGLE, DOWN)
    stacked = jax.tree.map(lambda *rows: jnp.stack(rows), *loop)
    assert_close(mapped, stacked, rtol=1e-13)
    assert_close(laws(SPRING, ANGLE, DOWN), stacked, rtol=1e-13)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": -1.0}, "`mass` must not be negative"),
        ({"mass_position": 1.1}, "`mass_position` must be between 0 and 1"),
        ({"mass_position": -0.1}, "`mass_position` must be between 0 and 1"),
        ({"lateral_offset": jnp.ones(2)}, "must have the shape"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(BODY, **changes)
