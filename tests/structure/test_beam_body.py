"""Modal bodies of beams: mass, statics, rotating beams, convergence, refusals."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.structure import (
    BeamSection,
    ClampedFree,
    FreeFree,
    Material,
    ModeCounts,
    SupportedFree,
    TipMass,
    UniformBeam,
    bending_modes,
    free_body,
    modal_beam,
)

from tests.helpers import assert_close, assert_gradient


BEAM = UniformBeam(
    Material(young=2.1e11, shear=8.1e10, density=7850.0),
    BeamSection.rectangular_tube(height=0.10, width=0.06, wall=0.005),
    1.3,
)
BODY = modal_beam(BEAM, ModeCounts(3, 3, 1, 2), nodes=(0.5,))
L, MASS = 1.3, float(BEAM.mass())


def test_mass_and_modes():
    assert BODY.mode_names[:4] == ("xy 1", "xy 2", "xy 3", "xz 1")
    assert_close(BODY.mass, MASS, rtol=1e-14)
    assert_close(BODY.first_moment, [0.5 * MASS * L, 0.0, 0.0], rtol=1e-14)
    section = BEAM.section
    discs = 7850.0 * L * np.array([section.second_moment_y, section.second_moment_z])
    rod = MASS * L**2 / 3.0
    expected = np.diag([discs.sum(), rod + discs[0], rod + discs[1]])
    assert_close(BODY.J_0, expected, rtol=1e-13, atol=1e-13)
    assert_close(BODY.M_e, np.eye(9), rtol=0.0, atol=1e-12)
    hertz = np.sort(np.sqrt(np.diag(np.asarray(BODY.K_e)))) / (2 * np.pi)
    assert_close(BODY.frequencies(), hertz, rtol=1e-12)
    first = 1.875104068711961**2 * np.sqrt(
        float(BEAM.rigidity()[1]) / (MASS / L) / L**4
    )
    slender = modal_beam(BEAM, ModeCounts(0, 1), rotary_inertia=False)
    assert_close(slender.frequencies()[0], first / (2 * np.pi), rtol=1e-12)


def test_tip_is_where_the_text_looks():
    nodes = BODY.nodes
    assert nodes.names == ("base", "0.5 l", "tip")
    assert_close(nodes.position[:, 0], [0.0, 0.5 * L, L], rtol=1e-15)
    assert_close(nodes.phi[0], np.zeros((3, 9)), rtol=0.0, atol=1e-14)
    assert_close(nodes.psi[0, 1:], np.zeros((2, 9)), rtol=0.0, atol=1e-12)
    # bending in the x-z plane turns about -y
    eta = jnp.zeros(9).at[3].set(1.0)
    rise, turn = nodes.phi[2, 2] @ eta, nodes.psi[2, 1] @ eta
    assert rise > 0 > turn


@pytest.mark.slow
def test_modal_statics_approach_the_exact_tip():
    # compliance by modes, sum of phi phi / w^2: to 3 % with one, 3e-4 with ten
    exact = np.asarray(BEAM.tip_compliance())[0]
    errors = []
    for number in (1, 3, 10):
        body = modal_beam(BEAM, ModeCounts(0, number), rotary_inertia=False)
        phi = np.asarray(body.nodes.phi)[-1, 2]
        deflection = np.sum(phi**2 / np.diag(np.asarray(body.K_e)))
        errors.append(1.0 - deflection / exact[0, 0])
    assert 0.02 < errors[0] < 0.04
    assert 0.0 < errors[2] < errors[1] < errors[0]
    assert errors[2] < 1e-4


@pytest.mark.slow
def test_shortening_keeps_the_length():
    # a circle of small curvature: v' = x / R, shortening L^3 / (6 R^2)
    phi_1 = np.asarray(BODY.nodes.phi_1)[:, 0]
    assert np.all(np.diag(phi_1[2])[:6] < 0)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    section, material = BEAM.section, BEAM.material
    modes = bending_modes(
        material.young * section.second_moment_z,
        MASS / L,
        L,
        3,
        rotary_inertia=material.density * section.second_moment_z,
    )
    for k, end in ((1, 0.5 * L), (2, L)):
        x = 0.5 * end * (nodes + 1.0)
        slope = np.asarray(modes.slope(jnp.asarray(x)))
        integral = (slope * 0.5 * end * weights) @ slope.T
        assert_close(phi_1[k, :3, :3], -integral, rtol=1e-10, atol=1e-12)


def rotating_frequency(speed, axis, modes):
    """First bending frequency of a beam that turns about `axis` through its base."""
    body = modal_beam(BEAM, ModeCounts(*modes), rotary_inertia=False)
    omega = jnp.zeros(3).at[axis].set(speed)

    def forces(eta):
        return free_body(body, omega, eta, jnp.zeros_like(eta))[1][6:]

    stiffness = jax.jacfwd(forces)(jnp.zeros(body.modes))
    return np.sqrt(np.linalg.eigvals(np.asarray(stiffness)).real.min())


@pytest.mark.slow
def test_rotating_beam_against_the_southwell_rise():
    # w^2 = w0^2 + K W^2: 1.193 across the plane of rotation, 0.193 in it, with the
    # shape of the beam at rest; the text of any book on helicopters
    w0 = rotating_frequency(0.0, 1, (0, 1))
    speed = 0.1 * w0
    across = rotating_frequency(speed, 2, (0, 1))
    inside = rotating_frequency(speed, 1, (0, 1))
    assert_close((across**2 - w0**2) / speed**2, 1.193, rtol=5e-4)
    assert_close((inside**2 - w0**2) / speed**2, 0.193, rtol=3e-3)
    # more modes lower it: Rayleigh's quotient of a shape that may adapt
    many = rotating_frequency(3.0 * w0, 2, (0, 6))
    single = rotating_frequency(3.0 * w0, 2, (0, 1))
    few = rotating_frequency(3.0 * w0, 2, (0, 3))
    assert many <= few < single
    # three shapes take nine tenths of what one lacks
    assert few - many < 0.1 * (single - many)


def test_without_the_shortening_rotation_softens():
    body = modal_beam(BEAM, ModeCounts(0, 1), rotary_inertia=False)
    soft = dataclasses.replace(body, C_t1=0.0 * body.C_t1, J_2=_without_curvature(body))
    omega = jnp.array([0.0, 1.0, 0.0])
    pull = lambda b: float(free_body(b, omega, jnp.ones(1), jnp.zeros(1))[1][6])
    stiffness = float(body.K_e[0, 0])
    # -1 instead of + 0.193 of the squared speed
    assert_close(pull(soft) - stiffness, -1.0, rtol=1e-8)
    assert_close(pull(body) - stiffness, 0.193, rtol=3e-3)


def _without_curvature(body):
    """Second derivative of the inertia of the linear displacement alone."""
    axes = np.array([1.0, 1.0, 0.0])  # mass moves along z: about x and y
    return 2.0 * np.asarray(body.M_e)[..., None, None] * np.diag(axes)


@pytest.mark.slow
def test_tip_mass_belongs_or_only_shapes():
    counts = ModeCounts(2, 2)
    tip = TipMass(5.0, [0.1, 0.2, 0.3])
    inside = modal_beam(BEAM, counts, tip=tip)
    assert_close(inside.mass, MASS + 5.0, rtol=1e-14)
    assert_close(inside.M_e, np.eye(4), rtol=0.0, atol=1e-12)
    beside = modal_beam(BEAM, counts, tip=dataclasses.replace(tip, belongs=False))
    assert_close(beside.mass, MASS, rtol=1e-14)
    assert_close(beside.K_e, inside.K_e, rtol=1e-13)
    end = np.asarray(inside.nodes.phi)[-1, 1]
    turn = np.asarray(inside.nodes.psi)[-1, 2]
    added = 5.0 * np.outer(end, end) + 0.3 * np.outer(turn, turn)
    difference = np.asarray(inside.M_e - beside.M_e)[:2, :2]
    assert_close(difference, added[:2, :2], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    ("support", "moving"), [(SupportedFree(), "psi"), (FreeFree(), "phi")]
)
def test_other_supports_move_the_base(support, moving):
    body = modal_beam(BEAM, ModeCounts(2), support=support)
    base = np.asarray(getattr(body.nodes, moving))[0]
    assert np.max(np.abs(base)) > 0.1
    if isinstance(support, FreeFree):
        # no momentum in elastic modes of a free beam
        assert_close(body.C_t0, np.zeros((2, 3)), rtol=0.0, atol=1e-10)
        spin = np.asarray(body.C_r0)
        assert_close(spin, np.zeros((2, 3)), rtol=0.0, atol=1e-10)


def test_damping_ratio():
    body = modal_beam(BEAM, ModeCounts(1, 1), damping_ratio=0.01)
    w = np.sqrt(np.diag(np.asarray(body.K_e)))
    assert_close(np.diag(np.asarray(body.D_e)), 0.02 * w, rtol=1e-13)
    assert isinstance(ClampedFree().rigid_modes, int)


@pytest.mark.slow
def test_gradient():
    def law(young, length, mass):
        beam = eqx.tree_at(
            lambda b: (b.material.young, b.length), BEAM, (young, length)
        )
        tip = TipMass(mass, jnp.array([0.1, 0.2, 0.3]))
        body = modal_beam(beam, ModeCounts(1, 1, 1), tip=tip)
        return body.K_e, body.C_r0, body.J_2, body.nodes.phi

    assert_gradient(law, *map(jnp.array, (2.1e11, 1.3, 5.0)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModeCounts(), "a beam needs at least one mode"),
        (lambda: ModeCounts(-1, 2), "a beam needs at least one mode"),
        (lambda: TipMass(-1.0, [0.0, 0.0, 0.0]), "`mass` must not be negative"),
        (
            lambda: modal_beam(BEAM, ModeCounts(1), nodes=(1.5,)),
            "must lie within",
        ),
        (
            lambda: modal_beam(BEAM, ModeCounts(1), damping_ratio=-0.1),
            "`damping_ratio` must not be negative",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
