"""SID files: five real ones, round trips in three dialects, layouts, refusals."""

import dataclasses
import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.io import (
    FEMBS,
    MATMOREMBS,
    PY_SID,
    SidData,
    identities,
    load_sid,
    save_sid,
)
from elastax.structure import (
    BeamSection,
    Material,
    ModeCounts,
    UniformBeam,
    modal_beam,
)

from tests.helpers import assert_close


BEAM = UniformBeam(
    Material(young=7e10, shear=2.6e10, density=2700.0),
    BeamSection.rectangular_tube(height=0.05, width=0.04, wall=0.003),
    0.8,
)
# in an oblique frame, so that no element of a tensor is zero
TURN = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
BODY = eqx.filter_jit(modal_beam)(BEAM, ModeCounts(2, 1, 1), damping_ratio=0.01).moved(
    TURN * np.linalg.det(TURN), [0.1, -0.2, 0.3]
)
DIALECTS = (FEMBS, PY_SID, MATMOREMBS)

# file, layout of Gr, layout of Ge, first moment and inertia, stiffening, frequencies
FILES = {
    "EMBS_balken1m.SID_FEM": (
        "layouts equivalent",
        "layouts equivalent",
        "mdCM",
        False,
        [8.360],
    ),
    "EMBS_beam.SID_FEM": (
        "mode-major",
        "axis-major",
        "mdCM",
        False,
        [51.626, 55.048, 110.392],
    ),
    "matflex_test_import_straight_beam.SID_FEM": (
        "axis-major",
        "axis-major",
        "mCM",
        False,
        [341.862, 341.862],
    ),
    # the file's labels are not the frequencies of its matrices
    "pymbs_example.sid_fem": (
        "axis-major",
        "axis-major",
        "mdCM",
        True,
        [8090.6, 14039.0, 360699.5],
    ),
    "pymbs_five_node_model.sid_fem": (
        "axis-major",
        "axis-major",
        "mdCM",
        True,
        [49.640, 63.453],
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_real_files(name, tmp_path, data_dir):
    Gr_layout, Ge_layout, first_moment, stiffened, hertz = FILES[name]
    data, report = load_sid(data_dir / "sid_examples" / name)
    assert (report.Gr_layout, report.Ge_layout) == (Gr_layout, Ge_layout)
    expected = "layouts equivalent" if data.modes == 1 else "row, mode, column"
    assert report.first_order == expected
    assert report.Oe_columns == "x^2 y^2 z^2, x y, y z, x z"
    assert report.block_names[0] == first_moment
    assert report.stiffening == stiffened
    for residual in report.identities.values():
        # the files have twelve digits
        assert residual is None or residual < 1e-11
    body = data.modal_body()
    # as many digits as the labels have
    frequencies = np.asarray(body.frequencies())[: len(hertz)]
    assert_close(frequencies, hertz, rtol=1e-5, atol=5e-4)
    assert_close(body.O_e0, data.Oe_0, rtol=1e-10, atol=1e-10 * abs(data.Oe_0).max())
    if not stiffened:
        # of one mode there is none; the file has what rounding left of M_e
        size = max(np.abs(data.Ge).max(), np.abs(data.Me).max())
        assert_close(body.G_e, data.Ge, rtol=1e-9, atol=1e-10 * size)
    for dialect in DIALECTS:
        save_sid(tmp_path / "again.SID_FEM", data, dialect=dialect)
        again, _ = load_sid(tmp_path / "again.SID_FEM")
        same(again, data)


def same(left: SidData, right: SidData):
    """Equal in every digit."""
    for field in dataclasses.fields(SidData):
        a, b = getattr(left, field.name), getattr(right, field.name)
        if field.name == "nodes":
            for one, other in zip(a, b, strict=True):
                for part in dataclasses.fields(one):
                    first, second = getattr(one, part.name), getattr(other, part.name)
                    np.testing.assert_array_equal(first, second, part.name)
        elif field.name not in ("header", "name"):
            np.testing.assert_array_equal(a, b, field.name)


def test_units_are_suspected(data_dir):
    data, report = load_sid(data_dir / "sid_examples" / "pymbs_example.sid_fem")
    assert any("millimetres are suspected" in note for note in report.notes)
    metres = data.scaled(1e-3)
    assert_close(metres.J_0, 1e-6 * data.J_0, rtol=1e-14)
    assert_close(
        metres.modal_body().frequencies(), data.modal_body().frequencies(), rtol=1e-9
    )


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda d: d.name)
def test_a_body_comes_back(dialect, tmp_path):
    path = tmp_path / "beam.SID_FEM"
    save_sid(path, BODY, dialect=dialect)
    data, report = load_sid(path)
    layout = {True: "axis-major", False: "mode-major"}
    assert report.Gr_layout == layout[dialect.Gr_axis_major]
    assert report.Ge_layout == "axis-major"
    assert report.stiffening
    assert report.block_names == (dialect.first_moment, dialect.inertia)
    assert "geometric stiffening" in report.table()
    body = data.modal_body(name="beam")
    assert body.mode_names == BODY.mode_names
    assert body.nodes.names == BODY.nodes.names
    for field in dataclasses.fields(BODY):
        value = getattr(BODY, field.name)
        if field.name == "nodes":
            pairs = [(body.nodes.phi, value.phi), (body.nodes.phi_1, value.phi_1)]
            pairs += [
                (body.nodes.psi, value.psi),
                (body.nodes.position, value.position),
            ]
        elif eqx.is_array(value):
            pairs = [(getattr(body, field.name), value)]
        else:
            continue
        for ours, expected in pairs:
            size = float(jnp.max(jnp.abs(expected)))
            # twelve digits of every element
            assert_close(ours, expected, rtol=1e-11, atol=1e-13 * size)


def test_identities_of_our_own_bodies():
    found = identities(SidData.of(BODY))
    for residual in found.values():
        assert residual is not None and residual < 1e-12
    data = SidData.of(BODY)
    wrong = dataclasses.replace(data, Ge=1.001 * data.Ge, Ct_0=data.Ct_0 + 1e-3)
    found = identities(wrong)
    assert found["Ge = 2 Cr.m1"] > 1e-4 and found["mdCM.m1 = Ct"] > 1e-4


def test_other_order_of_indices_is_found(tmp_path):
    path = tmp_path / "beam.SID_FEM"
    save_sid(path, BODY)
    text = path.read_text()
    swapped = re.sub(r"m1\(([^,]*),([^,]*),([^)]*)\)", r"m1(\1,\3,\2)", text)
    path.write_text(swapped)
    data, report = load_sid(path)
    assert report.first_order == "row, column, mode"
    assert_close(data.J_1, np.asarray(BODY.J_1), rtol=1e-11, atol=1e-11)
    assert report.identities["origin.m1 = phi"] < 1e-11


def test_other_order_of_the_products_is_found(tmp_path):
    data = SidData.of(BODY)
    swap = [0, 1, 2, 3, 5, 4]
    path = tmp_path / "beam.SID_FEM"
    other = dataclasses.replace(
        data, Oe_0=data.Oe_0[:, swap], Oe_1=data.Oe_1[:, :, swap]
    )
    save_sid(path, other)
    found, report = load_sid(path)
    assert report.Oe_columns == "x^2 y^2 z^2, x y, x z, y z"
    assert_close(found.Oe_0, data.Oe_0, rtol=1e-11, atol=1e-11)


def test_layouts_that_nothing_tells(tmp_path):
    data = SidData.of(BODY)
    path = tmp_path / "beam.SID_FEM"
    save_sid(path, dataclasses.replace(data, J_1=0.0 * data.J_1, Oe_0=0.0 * data.Oe_0))
    _, report = load_sid(path)
    assert report.Gr_layout == "undecided"
    wrong = dataclasses.replace(data, Gr=data.Gr + 1.0)
    save_sid(path, wrong)
    _, report = load_sid(path)
    assert "misses by" in report.Gr_layout


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("sid") / "beam.SID_FEM"
    save_sid(path, BODY)
    return path.read_text()


def edited(text, pattern, replacement, count=1):
    changed, number = re.subn(pattern, replacement, text, count=count)
    assert number > 0, pattern
    return changed


BROKEN = {
    "empty": (lambda t: "", "the file is empty"),
    "truncated": (lambda t: t[: len(t) // 2].rsplit("\n", 1)[0], "ends too early"),
    "first line": (lambda t: t.replace(":", " ", 1), "line 1: the first line must"),
    "count of nodes": (
        lambda t: edited(t, r"^ *2 ", "    7 "),
        "counts 7 nodes, but there are 2",
    ),
    "count of modes": (
        lambda t: edited(t, r"nelastq = +4", "nelastq = 5"),
        "`nelastq` is 5, but the first line counts 4",
    ),
    "missing end": (lambda t: edited(t, r" *end phi\n", ""), "of `phi`"),
    "wrong end": (lambda t: edited(t, r"end phi", "end psi"), "`end phi` is expected"),
    "number": (
        lambda t: edited(t, r"mass = +\S+", "mass = heavy"),
        "`heavy` is not a number",
    ),
    "element": (
        lambda t: edited(t, r"m0\( +1, +1\) = +\S+", "m0(  1,  1) = 1,5"),
        "`1,5` is not a number",
    ),
    "rows": (
        lambda t: edited(t, r"(Ct\n.*\n +nrow +=) +4", r"\1 3"),
        "block `Ct`: must be 4 x 3",
    ),
    "index": (
        lambda t: edited(t, r"(Cr\n(?:.*\n){6}.*)m0\( *\d+,", r"\1m0( 9,"),
        "block `Cr`: the element .9, 1. lies outside",
    ),
    "indices": (
        lambda t: edited(t, r"m0\( +1, +1\)", "m0(1)"),
        "needs 2 indices",
    ),
    "order": (
        lambda t: edited(t, r"order      =     1", "order      =     0"),
        "has the order 0, but an element",
    ),
    "block": (
        lambda t: edited(t, r"(?s) *Oe\n.*?end Oe\n", ""),
        "the block `Oe` is missing",
    ),
    "diagonal": (
        lambda t: edited(
            t, r"(Ke\n(?:.*\n){6})", r"\1               m0( 1, 2) = 1.0\n"
        ),
        "block `Ke`: a diagonal matrix has no element",
    ),
    "stiffness": (
        lambda t: edited(t, r"(Ke\n(?:.*\n){6}.*= +)", r"\1-"),
        "block `Ke`: must have no negative eigenvalues",
    ),
    "mass": (lambda t: edited(t, r"mass = +", "mass = -"), "mass must be positive"),
}


@pytest.mark.parametrize(("change", "message"), BROKEN.values(), ids=BROKEN)
def test_refusals(change, message, written, tmp_path):
    path = tmp_path / "broken.SID_FEM"
    path.write_text(change(written))
    with pytest.raises(ValueError, match=message):
        load_sid(path)


def test_a_missing_file():
    with pytest.raises(ValueError, match="cannot be read"):
        load_sid("nowhere.SID_FEM")
