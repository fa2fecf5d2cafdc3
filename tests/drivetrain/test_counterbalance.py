"""Counterbalances: geometry, energy, and the measured pressures of the KUKA KR300."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import pytest
from elastax.drivetrain import GasCounterbalance, SpringCounterbalance

from tests.helpers import assert_close, assert_gradient, load_vectors


def kr300():
    """[Weigand2021], for the maker's angle of axis 2."""
    return GasCounterbalance.from_gas(
        mass=0.159,
        gas_constant=296.8,
        temperature=328.0,
        compressibility=1.01,
        volume=0.96e-3,
        base_distance=0.8,
        lever=0.2,
        angle_offset=math.radians(95.0),
        reference_length=0.6,
        piston_diameter=0.055,
        rod_diameter=0.03,
    )


def spring():
    return SpringCounterbalance(0.72, 0.19, 0.35, 9e4, 0.53, 1.1e4, damping=300.0)


both = [spring(), kr300()]
each_element = pytest.mark.parametrize("element", both, ids=lambda e: type(e).__name__)
ANGLE = jnp.array([-1.4, -0.35, 0.2, 1.1])


def test_vector():
    (vector,) = load_vectors("2.5 (supplement, no equation in text)")
    inputs = vector["inputs"]
    element = SpringCounterbalance(
        base_distance=inputs["b"],
        lever=inputs["a"],
        angle_offset=inputs["phi0"],
        spring_rate=inputs["c"],
        reference_length=inputs["L0"],
        preload=inputs["F0"],
    )
    angle = jnp.array(inputs["phi"])
    rows = jnp.stack(
        [element.length(angle), element.force(angle), element.torque(angle)], axis=1
    )
    assert_close(rows, vector["outputs"]["rows"], rtol=vector["tol"])


@each_element
def test_length_is_the_distance_of_the_hinges(element):
    angle = ANGLE + element.angle_offset
    rocker = element.lever * jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    carrier = jnp.array([[element.base_distance], [0.0]])
    distance = jnp.linalg.norm(rocker - carrier, axis=0)
    assert_close(element.length(ANGLE), distance, rtol=1e-14)


@each_element
def test_torque_is_minus_the_slope_of_the_potential(element):
    slope = jax.vmap(jax.grad(element.potential))(ANGLE)
    assert_close(element.torque(ANGLE), -slope, rtol=1e-12)
    work = lambda angle: element.force(angle) * jax.grad(element.length)(angle)
    assert_close(element.torque(ANGLE), -jax.vmap(work)(ANGLE), rtol=1e-12)


@each_element
def test_pull_drives_back_to_the_dead_point(element):
    dead = -element.angle_offset
    # Rounding of the angle, times the stiffness there.
    assert_close(element.torque(dead), 0.0, rtol=0.0, atol=1e-11)
    gap = jnp.abs(element.lever - element.base_distance)
    assert_close(element.length(dead), gap, rtol=1e-14)
    offsets = jnp.array([0.1, 0.5, 1.5])
    torque = element.torque(dead + offsets)
    assert jnp.all(torque < 0)
    assert_close(element.torque(dead - offsets), -torque, rtol=1e-12)
    # Aligned on opposite sides of the axis: the longest, again without a torque.
    assert_close(
        element.length(dead + math.pi),
        element.lever + element.base_distance,
        rtol=1e-14,
    )


def test_published_pressures():
    # Measured values of the program, with its own model beside them.
    angle = jnp.radians(-jnp.arange(120.0, 30.0, -10.0))
    measured = 1e5 * jnp.array([170.0, 167, 164, 162, 164, 170, 180, 190, 200])
    element = kr300()
    error = element.gas_pressure(angle) - measured
    # The tolerances are what the documentation of `from_gas` states.
    assert jnp.max(jnp.abs(error)) < 3.3e5
    assert jnp.sqrt(jnp.mean(error**2)) < 1.75e5
    # Closed form of the program at two poses: delta = 0 and 90 degrees.
    area = math.pi * (0.055**2 - 0.03**2) / 4
    energy = 1.01 * 296.8 * 328.0 * 0.159
    stroke = math.sqrt(0.8**2 + 0.2**2) - 0.6
    pressure = energy / (0.96e-3 - stroke * area)
    pose = jnp.radians(jnp.array(-5.0))
    assert_close(element.gas_pressure(pose), pressure, rtol=1e-13)
    assert_close(element.force(pose), pressure * area, rtol=1e-13)
    arm = 0.8 * 0.2 / (stroke + 0.6)
    assert_close(element.torque(pose), -pressure * area * arm, rtol=1e-13)
    assert_close(element.gas_pressure(jnp.radians(-95.0)), energy / 0.96e-3, rtol=1e-13)


def test_gas_turns_into_a_spring_for_small_strokes():
    # p A = p0 A (1 + A s / V0 + ...): rate p0 A^2 / V0, the error is its square.
    gas = dataclasses.replace(kr300(), volume=jnp.array(10.0))
    area = gas.area()
    element = SpringCounterbalance(
        gas.base_distance,
        gas.lever,
        gas.angle_offset,
        gas.pressure * area**2 / gas.volume,
        gas.reference_length,
        gas.pressure * area,
    )
    share = (0.4 * area / gas.volume) ** 2
    assert_close(gas.torque(ANGLE), element.torque(ANGLE), rtol=float(share))


@each_element
def test_damping_dissipates(element):
    damped = dataclasses.replace(element, damping=jnp.array(300.0))
    speed = jnp.array([-2.0, -1.0, 0.5, 1.0])
    power = damped.damping_torque(ANGLE, speed) * speed
    rate = jax.vmap(jax.grad(damped.length))(ANGLE) * speed
    assert_close(power, -300.0 * rate**2, rtol=1e-12)


@pytest.mark.slow
@each_element
def test_gradient(element):
    laws = lambda e, x: (e.torque(x), e.potential(x), e.force(x))
    assert_gradient(laws, element, ANGLE, order=2)


@each_element
def test_extremes_are_finite(element):
    angles = jnp.array([0.0, 1e-300, 1e8, -1e8, math.pi]) - element.angle_offset

    def everything(angle):
        parameters = jax.grad(lambda e: e.torque(angle))(element)
        slope = jax.grad(element.torque)
        second = jax.jacfwd(slope)(angle), jax.grad(jax.jacfwd(element.torque))(angle)
        return element.torque(angle), element.potential(angle), second, parameters

    for leaf in jax.tree.leaves(jax.jit(jax.vmap(everything))(angles)):
        assert jnp.all(jnp.isfinite(leaf))


@each_element
def test_jit_vmap_and_loop_agree(element):
    loop = jnp.stack([element.torque(angle) for angle in ANGLE])
    assert_close(jax.jit(jax.vmap(element.torque))(ANGLE), loop, rtol=1e-13)
    assert_close(element.torque(ANGLE), loop, rtol=1e-13)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lever": 0.72}, "`lever` must differ from `base_distance`"),
        ({"lever": -0.1}, "`lever` must be positive"),
        ({"base_distance": 0.0}, "`base_distance` must be positive"),
        ({"reference_length": 0.0}, "`reference_length` must be positive"),
        ({"spring_rate": 0.0}, "`spring_rate` must be positive"),
        ({"damping": -1.0}, "`damping` must not be negative"),
        ({"preload": jnp.ones(2)}, "must have the shape"),
    ],
)
def test_spring_refusals(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(spring(), **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lever": 0.8}, "`lever` must differ from `base_distance`"),
        ({"pressure": 0.0}, "`pressure` must be positive"),
        ({"volume": 6e-4}, "`volume` must be above the oil"),
        ({"volume": -1.0}, "`volume` must be positive"),
        ({"rod_diameter": 0.055}, "`rod_diameter` must not be negative and be below"),
    ],
)
def test_gas_refusals(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(kr300(), **changes)
