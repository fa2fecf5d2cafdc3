"""Five SID_FEM files of three generators: layouts, identities, bodies, round trips."""

import numpy as np
import pytest
from elastax.io import (
    FEMBEAM,
    FEMBS,
    MATMOREMBS,
    PY_SID,
    ROW_COLUMN_MODE,
    ROW_MODE_COLUMN,
    load_sid,
    save_sid,
)

from tests.helpers import assert_close


BEAM = "EMBS_beam.SID_FEM"
ONE_MODE = "EMBS_balken1m.SID_FEM"
FREE_BEAM = "matflex_test_import_straight_beam.SID_FEM"
PLANE = "pymbs_example.sid_fem"
FIVE_NODES = "pymbs_five_node_model.sid_fem"
FILES = (BEAM, ONE_MODE, FREE_BEAM, PLANE, FIVE_NODES)
DIALECTS = (FEMBS, PY_SID, MATMOREMBS, FEMBEAM)

each_file = pytest.mark.parametrize("name", FILES)


@pytest.fixture
def load(data_dir):
    """Reader of one of the files, or a skip where they are absent."""
    folder = data_dir / "sid_examples"
    if not folder.is_dir():
        pytest.skip(f"there is no `sid_examples` in {data_dir}")
    return lambda name: load_sid(folder / name)


@each_file
def test_identities_hold_to_the_printed_digits(load, name):
    report = load(name).report
    # twelve digits are printed: half a unit of the last, on both sides, twice
    assert report.largest_residual < 1e-11
    assert len(report.identities) == 7
    assert any(identity.compared for identity in report.identities)


@pytest.mark.parametrize(
    ("name", "modes", "nodes", "blocks", "G_r", "G_e", "O_e"),
    [
        (BEAM, 11, 6, ("mdCM", "J"), "mode-major", "axis-major", "xy, yz, xz"),
        (
            ONE_MODE,
            1,
            3,
            ("mdCM", "J"),
            "layouts equivalent (one mode)",
            "layouts equivalent (one mode)",
            "xy, yz, xz",
        ),
        (FREE_BEAM, 8, 2, ("mCM", "mmi"), "axis-major", "axis-major", "xy, yz, xz"),
        (
            PLANE,
            3,
            3,
            ("mdCM", "J"),
            "axis-major",
            "axis-major",
            "undecidable: xz and yz of J.m1 are the same",
        ),
        (FIVE_NODES, 2, 5, ("mdCM", "J"), "axis-major", "axis-major", "xy, yz, xz"),
    ],
)
def test_layouts(load, name, modes, nodes, blocks, G_r, G_e, O_e):
    report = load(name).report
    assert (report.modes, report.nodes) == (modes, nodes)
    assert report.block_names == blocks
    assert report.indices.order == ROW_MODE_COLUMN
    assert report.indices.decided
    assert (report.G_r.verdict, report.G_e.verdict) == (G_r, G_e)
    assert report.O_e.verdict == O_e
    text = str(report)
    for part in (G_r, O_e, blocks[0], "J.m1 = sym(Gr)"):
        assert part in text


def test_storage_of_symmetric_matrices(load):
    stored = {name: load(name).report.storage for name in FILES}
    assert stored[BEAM]["Ke"] == "both triangles"
    assert stored[BEAM]["Me"] == "diagonal"
    assert stored[FREE_BEAM]["Ke"] == "lower triangle"
    assert stored[PLANE]["Ke"] == "both triangles"
    assert stored[FIVE_NODES]["Ke"] == "diagonal"


@pytest.mark.parametrize(
    ("name", "claim", "blocks"),
    [
        (BEAM, "not mentioned", ()),
        (ONE_MODE, "denied", ()),
        (FREE_BEAM, "denied", ()),
        (PLANE, "claimed", ("Cr.m1",)),
        (FIVE_NODES, "claimed", ("Cr.m1",)),
    ],
)
def test_geometric_stiffening(load, name, claim, blocks):
    report = load(name).report
    assert report.stiffening.startswith(claim)
    assert report.stiffening_blocks == blocks


def test_frequencies(load):
    # the labels of the file give three decimals
    assert_close(load(FIVE_NODES).frequencies(), [49.640, 63.453], rtol=0.0, atol=5e-4)
    assert load(FIVE_NODES).mode_labels[0] == "Eigen Mode    7 :       49.640 Hz"
    body = load(FIVE_NODES).modal_body()
    assert_close(body.frequencies(), [49.640, 63.453], rtol=0.0, atol=5e-4)
    assert_close(load(ONE_MODE).frequencies(), [8.360], rtol=0.0, atol=5e-4)
    labels = [51.626, 55.048, 110.392, 242.901, 520.409, 534.774]
    assert_close(load(BEAM).frequencies()[:6], labels, rtol=0.0, atol=6e-4)
    # notes of its origin: a double frequency of 341.862 Hz
    assert_close(load(FREE_BEAM).frequencies()[:2], [341.862] * 2, rtol=0.0, atol=5e-4)


def test_doubts(load):
    texts = {name: "\n".join(load(name).report.warnings) for name in FILES}
    assert "millimetres" in texts[PLANE]
    assert sum("millimetres" in text for text in texts.values()) == 1
    # the plane model has no inertia about x and y
    assert "negative principal moment" in texts[PLANE]
    assert "mass matrix" in texts[FIVE_NODES]
    assert "Ge is twice Cr.m1" in texts[FIVE_NODES]
    assert "Ge is twice Cr.m1" not in texts[BEAM]
    assert "Oe.m1 is not symmetric" in texts[BEAM]
    assert texts[FREE_BEAM] == ""


@each_file
def test_body_agrees_with_the_redundant_blocks(load, name):
    file = load(name)
    body = file.modal_body(name="part")
    assert body.name == "part"
    assert body.nodes.names == tuple(node.label for node in file.nodes)

    def agree(ours, theirs):
        size = np.abs(theirs).max()
        # the identities hold to the printed digits
        assert_close(ours, theirs, rtol=0.0, atol=1e-11 * size)

    half = lambda x: 0.5 * (np.asarray(x) + np.swapaxes(x, 1, 2))
    agree(half(body.G_r), half(file.G_r))
    agree(body.O_e0, file.O_e0)
    agree(body.O_e1, 0.5 * (file.O_e1 + np.swapaxes(file.O_e1, 0, 1)))
    # with stiffening, and for a single mode, `Ge` has a symmetric part
    agree(body.G_e, 0.5 * (file.G_e - np.swapaxes(file.G_e, 0, 1)))
    if name in (BEAM, FREE_BEAM):
        agree(body.G_e, file.G_e)
    for k, node in enumerate(file.nodes):
        assert_close(body.nodes.position[k], node.blocks["origin"].m0[:, 0], rtol=0.0)
        assert_close(body.nodes.phi[k], node.blocks["phi"].m0, rtol=0.0)
        assert_close(body.nodes.psi[k], node.blocks["psi"].m0, rtol=0.0)


def test_rotation_terms_agree_up_to_rotary_inertia(load):
    # 1 % of the largest element, from the rotary inertia of a slender beam
    file = load(FREE_BEAM)
    body, size = file.modal_body(), np.abs(file.G_r).max()
    assert_close(body.G_r, file.G_r, rtol=0.0, atol=0.02 * size)


def test_body_of_five_nodes_by_hand(load):
    # numbers copied from the file
    body = load(FIVE_NODES).modal_body()
    assert_close(body.mass, 7.78470518692e2, rtol=0.0)
    assert_close(body.first_moment, [2.41505687484e3, 0.0, 0.0], rtol=0.0)
    xy, xz, yz = -1.3316e3, -4.85084, -0.815742
    inertia = [[268.021, xy, xz], [xy, 10684.7, yz], [xz, yz, 10924.4]]
    assert_close(body.J_0, inertia, rtol=0.0)
    assert_close(body.C_r1[0, 1, 0], 9.02252673434e-1, rtol=0.0)
    assert_close(body.C_r1[1, 0, 2], 9.28689731100e-3, rtol=0.0)
    # half of -2 times the column of the product of speeds
    assert_close(body.J_2[0, 1, 1, 2], -1.49649493812, rtol=1e-15)
    assert_close(body.J_2[1, 1, 0, 0], 2 * 0.868652314140, rtol=1e-15)
    assert_close(body.K_e[1, 1], 1.58952010726e5, rtol=0.0)
    assert body.nodes.names == ("2519", "2523", "2520", "2521", "2522")


def same_content(one, other):
    assert one.mass == other.mass
    assert one.mode_labels == other.mode_labels
    assert [n.label for n in one.nodes] == [n.label for n in other.nodes]
    pairs = [(one.blocks, other.blocks)]
    pairs += [(a.blocks, b.blocks) for a, b in zip(one.nodes, other.nodes)]
    for left, right in pairs:
        assert set(left) == set(right)
        for name in set(left) - {"Gr", "Ge"}:
            assert left[name].order == right[name].order, name
            for key in ("m0", "m1", "mn"):
                a, b = getattr(left[name], key), getattr(right[name], key)
                assert np.array_equal(a, b), (name, key)
    assert np.array_equal(one.G_r, other.G_r)
    assert np.array_equal(one.G_e, other.G_e)


@pytest.mark.parametrize(
    ("name", "dialect"),
    [
        pytest.param(
            name,
            dialect,
            # eight thousand numbers, three times
            marks=[pytest.mark.slow] if name == BEAM and dialect != PY_SID else [],
            id=f"{name}-{dialect.name}",
        )
        for name in FILES
        for dialect in DIALECTS
    ],
)
def test_round_trip_keeps_every_digit(load, tmp_path, name, dialect):
    file = load(name)
    save_sid(tmp_path / "again.SID_FEM", file, dialect=dialect)
    again = load_sid(tmp_path / "again.SID_FEM")
    # upper triangles that differed by rounding take the lower one's digits
    if name == BEAM and dialect is not PY_SID:
        save_sid(tmp_path / "third.SID_FEM", again, dialect=PY_SID)
        file, again = again, load_sid(tmp_path / "third.SID_FEM")
    same_content(file, again)
    assert again.comment == file.comment
    assert again.report.block_names[0] in (dialect.first_moment, "mdCM")
    if file.modes > 1 and name != BEAM:
        assert again.report.G_r.layout == dialect.G_r
        assert again.report.G_e.layout == dialect.G_e
        assert again.indices.order == dialect.indices
    assert again.report.largest_residual < 1e-11


def test_other_units(load):
    file = load(PLANE)
    metres = file.scaled(length=1e-3)
    assert "millimetres" not in "\n".join(metres.report.warnings)
    # all modal matrices scale alike, so that frequencies and identities stay
    assert_close(metres.frequencies(), file.frequencies(), rtol=1e-12)
    assert metres.report.largest_residual < 1e-11
    assert_close(metres.blocks["mdCM"].m0[0, 0], 98.125e-3, rtol=1e-14)
    assert_close(metres.blocks["J"].m0[2, 0], 32711.6e-6, rtol=1e-4)
    body, small = file.modal_body(), metres.modal_body()
    assert_close(small.nodes.position, 1e-3 * body.nodes.position, rtol=1e-14)
    assert_close(small.nodes.psi, body.nodes.psi, rtol=0.0)
    assert_close(small.C_t0, 1e-3 * body.C_t0, rtol=1e-14)
    assert_close(small.C_r0, 1e-6 * body.C_r0, rtol=1e-14)
    tonnes = file.scaled(length=1e-3, mass=1e3)
    assert_close(tonnes.mass, 392.5, rtol=1e-14)
    with pytest.raises(ValueError, match="`length` must be positive"):
        file.scaled(length=0.0)


def test_fembeam_indices_are_found(load, tmp_path):
    save_sid(tmp_path / "a", load(FREE_BEAM), dialect=FEMBEAM)
    assert load_sid(tmp_path / "a").indices.order == ROW_COLUMN_MODE
