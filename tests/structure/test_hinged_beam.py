"""Segments and hinges that stand for a beam: vectors, statics, conversions, limits."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.structure import (
    TIP_FORCE,
    TIP_MOMENT,
    UNIFORM_LOAD,
    BeamSection,
    BeamSegments,
    ClampHinges,
    GaussHinges,
    Material,
    SlenderBody,
    UniformBeam,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


BEAM = UniformBeam(
    Material(young=169e9, shear=66e9, density=7100.0),
    BeamSection.rectangular_tube(height=0.18, width=0.30, wall=0.012),
    1.15,
)


def split(label, per_axis):
    (vector,) = load_vectors(label)
    x, expected = vector["inputs"], vector["outputs"]
    body = SlenderBody(
        x["m"], x["l"], x["l_s"], [x["Theta_xx"], x["Theta_yy"], x["Theta_zz"]]
    )
    return BeamSegments.of(body, per_axis=per_axis), body, expected, vector["tol"]


@pytest.mark.parametrize(
    ("label", "per_axis"),
    [
        ("2.23/2.24 (corrected, common r_er)", False),
        ("2.23/2.24 (corrected, separate r_y,r_z)", True),
    ],
)
def test_segments_vector(label, per_axis):
    segments, body, expected, tol = split(label, per_axis)
    assert_close(segments.lengths, expected["lengths"], rtol=tol)
    assert_close(segments.masses, expected["masses"], rtol=tol)
    assert_close(segments.inertias, expected["Theta_seg"], rtol=tol)
    radii = [expected["r_er_y"], expected["r_er_z"]]
    assert_close(segments.radii, radii, rtol=tol)
    whole = segments.whole()
    assert_close(whole.mass, expected["mass_total"], rtol=tol)
    assert_close(whole.centre, expected["com"], rtol=tol)
    assert_close(whole.inertia[0], expected["I_x"], rtol=tol)
    clamp = whole.inertia[1:] + whole.mass * whole.centre**2
    assert_close(clamp, [expected["I_clamp_y"], expected["I_clamp_z"]], rtol=tol)
    moments = body.inertia[1:] if per_axis else jnp.mean(body.inertia[1:])[None]
    assert_close(whole.inertia[1:], moments * np.ones(2), rtol=1e-12)


def test_hinges_vector():
    (vector,) = load_vectors("2.4.3 (supplement, not in text)")
    x, expected, tol = vector["inputs"], vector["outputs"], vector["tol"]
    stiffness = np.array([x["GI_t"], 2.0 * x["EI"], 2.0 * x["EI"]]) / x["l"]
    hinges = GaussHinges(stiffness, x["l"])
    assert_close(hinges.stiffness[1], expected["c_hinge"], rtol=tol)
    assert_close(hinges.stiffness[0], expected["c_torsion"], rtol=tol)
    (a, b), (c, d) = np.asarray(hinges.tip_compliance())[0]
    loads = x["F"] * a, x["F"] * c, x["M"] * b, x["M"] * d
    assert_close(np.array(loads), expected["exact"], rtol=tol)
    assert_close(hinges.rigidity(), [x["GI_t"], x["EI"], x["EI"]], rtol=1e-14)


def test_five_hinges_have_the_compliance_of_the_beam():
    assert_close(
        GaussHinges.of(BEAM).tip_compliance(), BEAM.tip_compliance(), rtol=1e-13
    )


def test_three_hinges_are_exact_for_their_load():
    exact = BEAM.tip_compliance()
    ours = ClampHinges.of(BEAM, TIP_FORCE).tip_compliance()
    # a tip force, deflection and slope; by symmetry the deflection under a moment
    assert_close(ours[:, :, 0], exact[:, :, 0], rtol=1e-13)
    assert_close(ours[:, 0, 1], exact[:, 0, 1], rtol=1e-13)
    # the slope under a tip moment is a quarter low
    assert_close(ours[:, 1, 1], 0.75 * exact[:, 1, 1], rtol=1e-13)
    moment = ClampHinges.of(BEAM, TIP_MOMENT).tip_compliance()
    assert_close(moment[:, :, 1], exact[:, :, 1], rtol=1e-13)


def test_one_detail_from_the_other():
    for load in (TIP_FORCE, TIP_MOMENT, UNIFORM_LOAD):
        three = ClampHinges.of(BEAM, load)
        assert_close(three.rigidity(), BEAM.rigidity(), rtol=1e-14)
        five = three.gauss_hinges()
        assert_close(five, GaussHinges.of(BEAM), rtol=1e-14)
        assert_close(five.clamp_hinges(load), three, rtol=1e-14)


def test_gradient():
    def law(m, l, centre, inertia):
        body = SlenderBody(m, l, centre, inertia)
        segments = BeamSegments.of(body, per_axis=True)
        return segments.masses, segments.inertias

    inertia = jnp.array([1.9, 16.4, 17.6])
    assert_gradient(law, *map(jnp.array, (95.0, 1.25, 0.58)), inertia)


BODY = (95.0, 1.25, 0.58, [1.9, 16.4, 17.6])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SlenderBody(-1.0, *BODY[1:]), "`mass` must be positive"),
        (lambda: SlenderBody(*BODY[:3], [1.0, 0.0, 1.0]), "`inertia` must be positive"),
        (
            lambda: BeamSegments.of(SlenderBody(95.0, 1.25, 0.9, BODY[3])),
            "within l/6 of the middle",
        ),
        (
            lambda: BeamSegments.of(SlenderBody(*BODY[:3], [1.9, 1.0, 1.0])),
            "must not be below that of a thin rod",
        ),
        (lambda: GaussHinges([1.0, 0.0, 1.0], 1.0), "`stiffness` must be positive"),
        (lambda: ClampHinges([1.0, 1.0, 1.0], -1.0), "`length` must be positive"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ValueError, match=message):
        make()
