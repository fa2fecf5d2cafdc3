"""Finite-element models: beams, Craig-Bampton, modal bodies against analytic ones."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.io
from elastax.io import load_matrices
from elastax.structure import (
    BeamSection,
    FiniteElementModel,
    Material,
    ModeCounts,
    UniformBeam,
    beam_frame,
    beam_line,
    craig_bampton,
    eigenmodes,
    free_body,
    modal_beam,
    modal_body,
)

from tests.helpers import assert_close


BEAM = UniformBeam(
    Material(young=7e10, shear=2.6e10, density=2700.0),
    BeamSection.rectangular_tube(height=0.05, width=0.03, wall=0.003),
    0.8,
)
MODEL = beam_line(BEAM, 20, rotary_inertia=False)


def squares(model, modes):
    return np.diag(modes.T @ (model.stiffness @ modes))


def test_frequencies_of_a_cantilever():
    beta = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    mass = float(BEAM.mass()) / 0.8
    for rigidity in np.asarray(BEAM.rigidity())[1:]:
        exact = (beta / 0.8) ** 2 * np.sqrt(rigidity / mass)
        found = np.sqrt(squares(MODEL, eigenmodes(MODEL, 12, ["base"])))
        nearest = np.array([found[np.argmin(abs(found - f))] for f in exact])
        # cubic elements are too stiff by (beta h)^4 / 1440
        error = (beta / 20.0) ** 4 / 1440.0
        assert np.all(nearest >= exact * (1.0 - 1e-10))
        assert np.all(nearest / exact - 1.0 < 2.0 * error + 1e-9)


def test_free_model_leaves_rigid_motions_out():
    modes = eigenmodes(MODEL, 4)
    found = np.sqrt(squares(MODEL, modes))
    mass = float(BEAM.mass()) / 0.8
    lower = float(np.min(np.asarray(BEAM.rigidity())[1:]))
    exact = (4.730040744862704 / 0.8) ** 2 * np.sqrt(lower / mass)
    assert_close(found[0], exact, rtol=1e-5)
    momentum = MODEL.rigid_motions().T @ (MODEL.mass @ modes)
    assert_close(momentum, np.zeros((6, 4)), rtol=0.0, atol=1e-8)


def test_static_compliance_of_the_tip_is_exact():
    tip = MODEL.of_node(MODEL.index("tip"))
    free = np.arange(6, MODEL.mass.shape[0])
    compliance = np.linalg.inv(MODEL.stiffness.toarray()[np.ix_(free, free)])
    here = np.ix_(tip - 6, tip - 6)
    exact = np.asarray(BEAM.tip_compliance())
    # y with the rotation about z; z with that about -y
    assert_close(compliance[here][1, 1], exact[1, 0, 0], rtol=1e-8)
    assert_close(compliance[here][1, 5], exact[1, 0, 1], rtol=1e-8)
    assert_close(compliance[here][2, 2], exact[0, 0, 0], rtol=1e-8)
    assert_close(compliance[here][2, 4], -exact[0, 0, 1], rtol=1e-8)


@pytest.mark.slow
def test_body_against_the_analytic_beam():
    model = beam_line(BEAM, 40)
    body = modal_body(model, eigenmodes(model, 4, ["base"]), "base", nodes=["tip"])
    analytic = modal_beam(BEAM, ModeCounts(2, 2)).in_eigenmodes()
    assert_close(body.mass, analytic.mass, rtol=1e-12)
    assert_close(body.first_moment, analytic.first_moment, rtol=1e-10, atol=1e-12)
    assert_close(body.J_0, analytic.J_0, rtol=1e-8, atol=1e-10)
    assert_close(body.frequencies(), analytic.frequencies(), rtol=1e-5)
    # of either sign; nodal masses err by the square of the elements' size over the wave
    # length, 4.7^2/1600/4 for the second mode
    sign = np.sign(np.sum(np.asarray(body.C_t0) * np.asarray(analytic.C_t0), axis=1))
    one = lambda x: np.einsum("k,k...->k...", sign, np.asarray(x))
    two = lambda x: np.einsum("k,l,kl...->kl...", sign, sign, np.asarray(x))
    for name, turn in (("C_t0", one), ("C_r0", one), ("J_1", one), ("C_r1", two)):
        expected = np.asarray(getattr(analytic, name))
        size = max(np.abs(expected).max(), 1e-6)
        assert_close(turn(getattr(body, name)), expected, rtol=0.0, atol=3.5e-3 * size)
    # geometric stiffening by axial forces, analytically by the shortening
    for name in ("C_t1", "J_2"):
        expected = np.asarray(getattr(analytic, name))
        size = np.abs(expected).max()
        assert_close(two(getattr(body, name)), expected, rtol=0.0, atol=3e-3 * size)
    rise = np.asarray(body.nodes.phi)[-1] * sign[None]
    assert_close(rise, np.asarray(analytic.nodes.phi)[-1], rtol=0.0, atol=1e-3)


def test_stiffening_keeps_a_turning_beam_together():
    model = beam_line(BEAM, 12)
    modes = eigenmodes(model, 2, ["base"])
    stiff = modal_body(model, modes, "base")
    soft = modal_body(dataclasses.replace(model, geometric=None), modes, "base")
    omega = jnp.array([0.0, 0.0, 3.0 * float(np.sqrt(stiff.K_e[0, 0]))])
    pull = lambda b: float(free_body(b, omega, jnp.eye(2)[0], jnp.zeros(2))[1][6])
    assert pull(soft) < 0 < pull(stiff) or pull(soft) < pull(stiff)
    assert pull(stiff) > float(stiff.K_e[0, 0])


def test_craig_bampton_is_exact_in_statics_and_converges():
    modes = craig_bampton(MODEL, "base", ["tip"], 0)
    body = modal_body(MODEL, modes, "base", nodes=["tip"])
    phi = np.asarray(body.nodes.phi)[-1]
    compliance = np.einsum("ak,bk,k->ab", phi, phi, 1.0 / np.diag(np.asarray(body.K_e)))
    exact = np.asarray(BEAM.tip_compliance())
    assert_close(compliance[1, 1], exact[1, 0, 0], rtol=1e-7)
    assert_close(compliance[2, 2], exact[0, 0, 0], rtol=1e-7)
    full = np.sqrt(squares(MODEL, eigenmodes(MODEL, 4, ["base"]))) / (2 * np.pi)
    errors = []
    for number in (0, 4, 12):
        reduced = modal_body(
            MODEL, craig_bampton(MODEL, "base", ["tip"], number), "base"
        )
        errors.append(np.max(np.asarray(reduced.frequencies())[:4] / full - 1.0))
    assert errors[0] > errors[1] > errors[2] > -1e-9
    assert errors[2] < 1e-3


def test_frame_of_two_directions_and_lumped_mass():
    positions = [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.3, 0.0]]
    model = beam_frame(
        positions,
        [(0, 1), (1, 2)],
        BEAM.section,
        BEAM.material,
        lumped=[(2, 1.5, 0.01 * np.eye(3))],
    )
    body = modal_body(model, eigenmodes(model, 3, ["1"]), "1", nodes=["3"])
    per_length = float(BEAM.mass()) / 0.8
    assert_close(body.mass, 0.7 * per_length + 1.5, rtol=1e-12)
    first = per_length * (0.4 * 0.2 + 0.3 * 0.4) + 1.5 * 0.4
    assert_close(body.first_moment[0], first, rtol=1e-10)
    assert body.nodes.names == ("1", "3")
    assert_close(body.nodes.phi[0], np.zeros((3, 3)), rtol=0.0, atol=1e-15)


def test_matrices_from_files(tmp_path):
    for name in ("mass", "stiffness"):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", getattr(MODEL, name), precision=17)
    rows = zip(MODEL.labels, MODEL.positions)
    lines = ["# label, x, y, z [m]"]
    lines += [f"{label}, {x:.17g}, {y:.17g}, {z:.17g}" for label, (x, y, z) in rows]
    (tmp_path / "nodes.txt").write_text("\n".join(lines))
    files = [tmp_path / name for name in ("mass.mtx", "stiffness.mtx", "nodes.txt")]
    model = load_matrices(*files)
    assert model.labels == MODEL.labels
    modes = eigenmodes(model, 3, ["base"])
    again = eigenmodes(MODEL, 3, ["base"])
    assert_close(squares(model, modes), squares(MODEL, again), rtol=1e-9)
    (tmp_path / "nodes.txt").write_text("base, 0, 0\n")
    with pytest.raises(ValueError, match="line 1: a label and x, y, z"):
        load_matrices(*files)
    (tmp_path / "mass.mtx").write_text("nothing")
    with pytest.raises(ValueError, match="no Matrix Market file"):
        load_matrices(*files)


def model_with(**changes):
    fields = {
        "positions": MODEL.positions,
        "mass": MODEL.mass,
        "stiffness": MODEL.stiffness,
    }
    return FiniteElementModel(**(fields | changes))


SKEWED = MODEL.mass.toarray()
SKEWED[0, 5] += 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: model_with(positions=1e3 * MODEL.positions),
            "mm against m",
        ),
        (lambda: model_with(mass=SKEWED), "`mass` must be symmetric"),
        (lambda: model_with(mass=-MODEL.mass), "the mass must be positive"),
        (lambda: model_with(mass=MODEL.mass[:7, :7]), "3 or 6 freedoms for each of 21"),
        (
            lambda: model_with(stiffness=MODEL.stiffness + 1e9 * np.diag(np.ones(126))),
            "takes force",
        ),
        (lambda: eigenmodes(MODEL, 2, ["nowhere"]), "there is no node `nowhere`"),
        (lambda: eigenmodes(MODEL, 500, ["base"]), "only 120 freedoms are free"),
        (
            lambda: beam_frame([[0.0] * 3] * 2, [(0, 1)], BEAM.section, BEAM.material),
            "has no length",
        ),
        (
            lambda: beam_frame(
                [[0.0] * 3, [0.0, 0.0, 1.0]], [(0, 1)], BEAM.section, BEAM.material
            ),
            "runs along `upright`",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
