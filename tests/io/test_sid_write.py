"""Bodies through SID_FEM files, layouts that cannot be told, second order."""

import dataclasses

import numpy as np
import pytest
from elastax.io import (
    FEMBEAM,
    FEMBS,
    MATMOREMBS,
    PY_SID,
    load_sid,
    save_sid,
    sid_from_body,
)

from tests.helpers import assert_close
from tests.io.sid_bodies import random_body


FIELDS = (
    "mass",
    "first_moment",
    "J_0",
    "J_1",
    "J_2",
    "C_t0",
    "C_t1",
    "C_r0",
    "C_r1",
    "M_e",
    "K_e",
    "D_e",
)
each_dialect = pytest.mark.parametrize(
    "dialect", (FEMBS, PY_SID, MATMOREMBS, FEMBEAM), ids=lambda d: d.name
)


@each_dialect
@pytest.mark.parametrize("curved", [True, False])
@pytest.mark.parametrize("modes", [1, 2, 3])
def test_body_comes_back(tmp_path, dialect, curved, modes):
    body = random_body(modes, curved)
    save_sid(tmp_path / "body.SID_FEM", body, dialect=dialect)
    file = load_sid(tmp_path / "body.SID_FEM")
    again = file.modal_body()
    for name in FIELDS:
        # twelve digits are printed: half a unit of the last is below 5e-12
        assert_close(getattr(again, name), getattr(body, name), rtol=1e-11, atol=0.0)
    for name in ("position", "phi", "psi", "phi_1"):
        assert_close(getattr(again.nodes, name), getattr(body.nodes, name), rtol=1e-11)
    assert again.nodes.names == body.nodes.names
    assert again.mode_names == body.mode_names
    assert again.name == body.name
    report = file.report
    # sums of two numbers of twelve digits, against the largest element
    assert report.largest_residual < 1e-11
    assert report.warnings == ()
    if modes > 1:
        assert report.G_r.layout == dialect.G_r
        assert report.G_e.layout == dialect.G_e
        assert file.indices.order == dialect.indices
    stiff = ("Ct.m1", "Cr.m1", "phi.m1") if curved else ()
    assert report.stiffening_blocks == stiff
    size = np.abs(np.asarray(body.G_r)).max()
    assert_close(again.G_r, file.G_r, rtol=0.0, atol=1e-11 * size)
    assert_close(again.G_e, file.G_e, rtol=0.0, atol=1e-11 * size)


def test_text_of_fembs(tmp_path):
    save_sid(tmp_path / "a", random_body(), comment="made by hand, Geo_Stiff= yes")
    lines = (tmp_path / "a").read_text().splitlines()
    assert lines[0] == (
        "    2   3    :No. nodes, No. modes:made by hand, Geo_Stiff= yes"
    )
    assert lines[1:3] == [" part", f"{'      new modal':<48}=six points"]
    assert f"{' ' * 26 + 'm1( 3, 2, 1)':<48}=" in "\n".join(lines)
    assert "           mdCM" in lines
    assert all("E" not in line for line in lines if " m0(" in line)
    claim = load_sid(tmp_path / "a").report.stiffening
    assert claim == "claimed, shows in Ct.m1, Cr.m1, phi.m1"
    # the upper triangle is left to the reader
    stiffness = lines[lines.index("           Ke") :]
    assert not any("m0( 1, 2)" in line for line in stiffness[:14])


def test_nodes_with_other_names_are_numbered(tmp_path):
    save_sid(tmp_path / "a", random_body(names=("hub", "tip")))
    assert load_sid(tmp_path / "a").modal_body().nodes.names == ("1", "2")


def without_slopes(body):
    """A body whose inertia and coupling tell nothing about the layouts."""
    return dataclasses.replace(
        body, J_1=0.0 * body.J_1, J_2=0.0 * body.J_2, C_r1=0.0 * body.C_r1
    )


def test_layout_that_cannot_be_told(tmp_path):
    body = without_slopes(random_body(3, False))
    save_sid(tmp_path / "a", body, dialect=PY_SID)
    file = load_sid(tmp_path / "a")
    assert file.report.G_r.verdict == "undecidable: J.m1 is zero"
    assert file.report.G_e.verdict == "layouts equivalent (all of it fits both)"
    assert any("columns of `Gr`" in line for line in file.report.warnings)
    with pytest.raises(ValueError, match="name the generator's layout"):
        _ = file.G_r
    with pytest.raises(ValueError, match="undecidable: J.m1 is zero"):
        save_sid(tmp_path / "b", file)
    # the body needs none of it
    assert_close(file.modal_body().C_r0, body.C_r0, rtol=1e-11)
    named = load_sid(tmp_path / "a", dialect=PY_SID)
    assert_close(named.G_r, body.G_r, rtol=1e-11)


def test_modal_terms_that_cannot_be_told(tmp_path):
    file = sid_from_body(random_body(3, False))
    slopes = dataclasses.replace(file.blocks["Cr"], m1=0.0 * file.blocks["Cr"].m1)
    file = dataclasses.replace(file, blocks=file.blocks | {"Cr": slopes}, dialect=None)
    assert file.report.G_e.verdict == "undecidable: Cr.m1 is zero"
    assert any("`Ge = 2 Cr.m1` does not hold" in x for x in file.report.warnings)
    noise = np.random.default_rng(2).standard_normal(file.blocks["Ge"].m0.shape)
    blocks = sid_from_body(random_body()).blocks
    blocks["Ge"] = dataclasses.replace(blocks["Ge"], m0=noise)
    file = dataclasses.replace(file, blocks=blocks)
    assert file.report.G_e.verdict == "undecidable: no layout fits"


def test_columns_of_the_squares_are_found():
    file = sid_from_body(random_body())
    swap = [0, 1, 2, 3, 5, 4]
    block = file.blocks["Oe"]
    block = dataclasses.replace(block, m0=block.m0[:, swap], m1=block.m1[:, :, swap])
    other = dataclasses.replace(file, blocks=file.blocks | {"Oe": block})
    assert other.report.O_e.verdict == "xy, xz, yz"
    assert other.report.largest_residual < 1e-11
    assert_close(other.modal_body().J_2, file.modal_body().J_2, rtol=0.0)


def test_indices_that_their_ranges_do_not_tell(tmp_path):
    # slopes of 3 x 3 blocks of three modes alone: the identities decide
    body = random_body(3, False)
    file = sid_from_body(body)
    nodes = []
    for node in file.nodes:
        origin = dataclasses.replace(
            node.blocks["origin"], order=0, m1=0.0 * node.blocks["origin"].m1
        )
        nodes.append(dataclasses.replace(node, blocks=node.blocks | {"origin": origin}))
    flat = {
        name: dataclasses.replace(file.blocks[name], m1=0.0 * file.blocks[name].m1)
        for name in ("mdCM", "J", "Oe")
    }
    flat["mdCM"] = dataclasses.replace(flat["mdCM"], order=0)
    flat["Oe"] = dataclasses.replace(flat["Oe"], m0=0.0 * flat["Oe"].m0)
    G_r = dataclasses.replace(file.blocks["Gr"], m0=0.0 * file.blocks["Gr"].m0)
    file = dataclasses.replace(
        file, nodes=tuple(nodes), blocks=file.blocks | flat | {"Gr": G_r}
    )
    for dialect in (FEMBS, FEMBEAM):
        save_sid(tmp_path / "a", file, dialect=dialect)
        again = load_sid(tmp_path / "a")
        assert again.indices.order == dialect.indices
        assert again.indices.verdict == "by the identities"
        assert_close(again.modal_body().C_r1, body.C_r1, rtol=1e-11)


def test_second_order_numbers_are_kept(tmp_path):
    file = sid_from_body(random_body(2))
    numbers = np.zeros((6, 3, 1))
    numbers[4, 2, 0], numbers[0, 1, 0] = 1.25, -3.5
    inertia = dataclasses.replace(file.blocks["J"], order=2, mn=numbers)
    file = dataclasses.replace(file, blocks=file.blocks | {"J": inertia})
    for dialect in (FEMBS, FEMBEAM):
        save_sid(tmp_path / "a", file, dialect=dialect)
        again = load_sid(tmp_path / "a")
        assert again.blocks["J"].order == 2
        assert np.array_equal(again.blocks["J"].mn, numbers)
        assert again.report.warnings == (
            "`J` has second-order numbers `mn`, which are not used",
        )


def test_prestress_is_refused_by_the_body_alone():
    file = sid_from_body(random_body())
    stress = dataclasses.replace(file.blocks["ksigma"], m0=np.ones((3, 1)))
    file = dataclasses.replace(file, blocks=file.blocks | {"ksigma": stress})
    assert "ksigma is not zero: a modal body has no prestress" in file.report.warnings
    with pytest.raises(ValueError, match="`ksigma` holds a prestress"):
        file.modal_body()


def changed_block(file, name, **changes):
    block = dataclasses.replace(file.blocks[name], **changes)
    return dataclasses.replace(file, blocks=file.blocks | {name: block})


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        (lambda f: dataclasses.replace(f, mass=1e9), "denser than any metal"),
        (lambda f: f.scaled(length=1e3), "lengths look like millimetres"),
        (lambda f: f.scaled(length=1e3, mass=1e-3), "lengths look like millimetres"),
        (
            lambda f: changed_block(f, "De", m0=-f.blocks["De"].m0),
            "De has the negative eigenvalue",
        ),
        (
            lambda f: changed_block(f, "Cr", m0=10.0 * f.blocks["Cr"].m0),
            "Gr and Cr.m0 differ by",
        ),
        (
            lambda f: changed_block(f, "J", m0=0.1 * f.blocks["J"].m0),
            "negative principal moment",
        ),
        (
            lambda f: changed_block(f, "Me", m0=0.01 * f.blocks["Me"].m0),
            "the mass matrix of the undeformed body is not positive definite",
        ),
        (
            lambda f: changed_block(f, "Ke", m1=np.ones((3, 3, 3))),
            "`Ke` changes with the modes, which is not used",
        ),
        (
            lambda f: changed_block(f, "mdCM", m1=2.0 * f.blocks["mdCM"].m1),
            "`mdCM.m1 = Ct.m0^T` does not hold: residual 5.0e-01",
        ),
    ],
)
def test_doubts_about_the_content(change, doubt):
    file = sid_from_body(random_body())
    assert file.report.warnings == ()
    assert any(doubt in line for line in change(file).report.warnings)
    assert doubt in str(change(file).report)
