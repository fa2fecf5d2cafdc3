"""Beams: sections, hinges that replace them, statics of the tip."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from elastax.structure import (
    HINGE_POSITION,
    TIP_FORCE,
    TIP_MOMENT,
    UNIFORM_LOAD,
    BeamSection,
    Material,
    UniformBeam,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


STEEL = Material(young=2.1e11, shear=8.1e10, density=7850.0)


def beam_of(height=0.25, width=0.15, wall=0.008, length=1.25):
    section = BeamSection.rectangular_tube(height, width, wall)
    return UniformBeam(STEEL, section, length)


def test_rectangular_tube_by_integration():
    height, width, wall = 0.25, 0.15, 0.008
    section = BeamSection.rectangular_tube(height, width, wall)

    def depth(z):
        """Width of material at the height z."""
        return width if abs(z) > height / 2 - wall else 2 * wall

    edges = [-height / 2 + wall, height / 2 - wall]
    integral = lambda f: scipy.integrate.quad(
        f, -height / 2, height / 2, points=edges, epsrel=1e-13
    )[0]
    assert_close(section.area, integral(depth), rtol=1e-12)
    second = integral(lambda z: z**2 * depth(z))
    assert_close(section.second_moment_y, second, rtol=1e-12)
    turned = BeamSection.rectangular_tube(width, height, wall)
    assert_close(section.second_moment_z, turned.second_moment_y, rtol=1e-14)
    assert_close(section.torsion_constant, turned.torsion_constant, rtol=1e-14)


def test_square_tube_of_thin_wall():
    # Limits of thin walls: A = 4 b t, I = 2 b^3 t / 3, I_t = b^3 t.
    side, wall = 0.2, 1e-6
    section = BeamSection.rectangular_tube(side, side, wall)
    assert_close(section.area, 4 * side * wall, rtol=2 * wall / side)
    assert_close(section.second_moment_y, 2 * side**3 * wall / 3, rtol=4 * wall / side)
    assert_close(section.torsion_constant, side**3 * wall, rtol=4 * wall / side)


def test_circular_tube():
    solid = BeamSection.circular_tube(0.1, 0.05)
    assert_close(solid.second_moment_y, np.pi * 0.1**4 / 64, rtol=1e-14)
    assert_close(solid.torsion_constant, np.pi * 0.1**4 / 32, rtol=1e-14)
    # Bredt's formula for the ring agrees to the square of wall over diameter.
    tube = BeamSection.circular_tube(0.1, 1e-3)
    middle = 0.099
    bredt = 4 * (np.pi * middle**2 / 4) ** 2 * 1e-3 / (np.pi * middle)
    assert_close(tube.torsion_constant, bredt, rtol=1.1 * (1e-3 / middle) ** 2)


def chain_compliance(positions, stiffness, length):
    """Tip compliance of rigid segments on hinges: force and moment, small angles."""
    arms = np.stack([length - np.asarray(positions), np.ones(len(positions))])
    return arms @ np.diag(1.0 / np.asarray(stiffness)) @ arms.T


def test_two_hinges_vector_and_exact_tip():
    (vector,) = load_vectors("2.4.3 (supplement, not in text)")
    inputs, outputs = vector["inputs"], vector["outputs"]
    flexural, torsional, length = inputs["EI"], inputs["GI_t"], inputs["l"]
    section = BeamSection(
        1e-2, flexural / 2.1e11, flexural / 2.1e11, torsional / 8.1e10
    )
    beam = UniformBeam(STEEL, section, length)
    torsion, *bending = beam.hinge_stiffness()
    assert_close(torsion, outputs["c_torsion"], rtol=vector["tol"])
    assert_close(bending[0], outputs["c_hinge"], rtol=vector["tol"])
    positions = [HINGE_POSITION * length, (1.0 - HINGE_POSITION) * length]
    chain = chain_compliance(positions, bending, length)
    load = np.diag([inputs["F"], inputs["M"]])
    exact = np.reshape(outputs["exact"], (2, 2))
    assert_close((chain @ load).T, exact, rtol=vector["tol"])
    assert_close((np.asarray(beam.tip_compliance()[0]) @ load).T, exact, rtol=1e-12)
    assert_close(outputs["tip_defl_F"], (chain @ load)[0, 0], rtol=vector["tol"])


@pytest.mark.parametrize(
    ("load", "deflection", "slope"),
    [
        # Unit EI and length: clamped beam under a tip force, a tip moment, a uniform
        # load of unit resultant, with the moment that each exerts at the clamp.
        (TIP_FORCE, 1 / 3, 1 / 2),
        (TIP_MOMENT, 1 / 2, 1.0),
        (UNIFORM_LOAD, 1 / 8, 1 / 6),
    ],
)
def test_clamp_hinge_meets_deflection_and_slope(load, deflection, slope):
    moment = {TIP_FORCE: 1.0, TIP_MOMENT: 2.0, UNIFORM_LOAD: 0.5}[load]
    section = BeamSection(1.0, 1.0, 1.0, 1.0)
    beam = UniformBeam(Material(1.0, 1.0, 1.0), section, 1.0)
    _, hinge, _ = beam.clamp_stiffness(load)
    angle = moment / hinge
    assert_close(angle, deflection, rtol=1e-15)
    assert_close(angle * (1.0 + load.slope_factor), slope, rtol=1e-15)


def test_stiffness_grows_with_the_section():
    beam = beam_of()
    rigidity = beam.rigidity()
    assert rigidity[1] > rigidity[2]
    assert_close(
        beam.clamp_stiffness() * 1.25, rigidity * jnp.array([1.0, 3, 3]), rtol=1e-15
    )
    assert_close(beam.mass(), 7850.0 * beam.section.area * 1.25, rtol=1e-15)
    compliance = beam.tip_compliance()
    assert compliance.shape == (2, 2, 2)
    assert_close(compliance[0, 0, 0], 1.25**3 / (3 * rigidity[1]), rtol=1e-15)
    assert_close(compliance[1, 1, 1], 1.25 / rigidity[2], rtol=1e-15)


@pytest.mark.slow
def test_gradient_jit_and_vmap():
    def stiffness(height, width, wall, length):
        beam = beam_of(height, width, wall, length)
        return beam.clamp_stiffness(), beam.hinge_stiffness(), beam.tip_compliance()

    sizes = (jnp.array(0.25), jnp.array(0.15), jnp.array(0.008), jnp.array(1.25))
    assert_gradient(stiffness, *sizes, order=2)
    many = tuple(size * jnp.linspace(1.0, 2.0, 3) for size in sizes)
    batched = jax.jit(jax.vmap(stiffness))(*many)
    loop = [stiffness(*(size[k] for size in many)) for k in range(3)]
    assert_close(
        batched, jax.tree.map(lambda *leaf: jnp.stack(leaf), *loop), rtol=1e-13
    )


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Material(0.0, 1.0, 1.0), "`young` must be positive"),
        (lambda: Material(1.0, -1.0, 1.0), "`shear` must be positive"),
        (lambda: Material(1.0, 1.0, 0.0), "`density` must be positive"),
        (lambda: BeamSection(1.0, 0.0, 1.0, 1.0), "`second_moment_y` must be positive"),
        (lambda: BeamSection.rectangular_tube(0.2, 0.1, 0.05), "`wall` must be"),
        (lambda: BeamSection.rectangular_tube(0.2, 0.1, 0.0), "`wall` must be"),
        (lambda: BeamSection.circular_tube(0.1, 0.051), "`wall` must be"),
        (lambda: beam_of(length=0.0), "`length` must be positive"),
        (lambda: Material(jnp.ones(2), 1.0, 1.0), "must have the shape"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(ValueError, match=message):
        build()
