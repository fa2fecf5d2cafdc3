"""Broken SID_FEM files: what is said, and that nothing else is ever raised."""

import re

import numpy as np
import pytest
from elastax.io import SidFile, load_sid, save_sid
from hypothesis import given, settings, strategies as st

from tests.io.sid_bodies import random_body


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    path = tmp_path_factory.mktemp("sid") / "good.SID_FEM"
    save_sid(path, random_body(2))
    return path.read_text().splitlines()


def load_lines(lines, tmp_path):
    (tmp_path / "bad.SID_FEM").write_text("\n".join(lines))
    return load_sid(tmp_path / "bad.SID_FEM")


def find(lines, block, key):
    """Index of the first line of a block that holds `key`."""
    start = next(k for k, line in enumerate(lines) if line.strip() == block)
    return next(k for k in range(start, len(lines)) if key in lines[k])


def replace(block, key, old, new):
    """Change of the first line of a block that holds `key`."""

    def change(lines):
        k = find(lines, block, key)
        changed = re.sub(old, new, lines[k])
        assert changed != lines[k]
        return [*lines[:k], changed, *lines[k + 1 :]], k + 1

    return change


def insert(block, key, text):
    """A line before the first of a block that holds `key`."""

    def change(lines):
        k = find(lines, block, key)
        return [*lines[:k], text, *lines[k:]], k + 1

    return change


def drop(block, key, after=0):
    """The first line of a block that holds `key` left out."""

    def change(lines):
        k = find(lines, block, key)
        return [*lines[:k], *lines[k + 1 :]], k + 1 + after

    return change


def drop_block(block):
    def change(lines):
        first, last = find(lines, block, block), find(lines, block, f"end {block}")
        rest = [*lines[:first], *lines[last + 1 :]]
        return rest, find(rest, "end modal", "end modal") + 1

    return change


def negative(block, key):
    """A diagonal element with the other sign, told at the block's first line."""

    def change(lines):
        changed, _ = replace(block, key, "= ", "=-")(lines)
        return changed, find(lines, block, block) + 1

    return change


def cut(block):
    def change(lines):
        k = find(lines, block, "structure")
        return lines[:k], k

    return change


@pytest.mark.parametrize(
    ("change", "where", "message"),
    [
        (drop("Me", "end Me"), "block `Me`", "is its `end` missing"),
        (drop("Cr", "ncol"), "block `Cr`", "must be `ncol = ...`, but is `nq"),
        (replace("Ct", "ncol", "3$", "4"), "block `Ct`", "`ncol` must be 3, but is 4"),
        (replace("J", "nrow", "6$", "5"), "block `J`", "`nrow` must be 6, but is 5"),
        (replace("Oe", " nq ", "2$", "3"), "block `Oe`", "must be 2 as `nelastq`"),
        (replace("Oe", "order", "1$", "3"), "block `Oe`", "`order` must be from 0 to"),
        (replace("Oe", "structure", "3$", "5"), "block `Oe`", "`structure` must be"),
        (replace("De", "nrow", "2$", "x"), "block `De`", "must be a whole number"),
        (replace("Cr", "m0( 1, 2)", r"1, 2\)", "3, 2)"), "block `Cr`", "out of range"),
        (replace("Cr", "m0( 1, 2)", r"1, 2\)", "0, 2)"), "block `Cr`", "out of range"),
        (replace("Cr", "m0( 1, 2)", "1, 2", "1, 1"), "block `Cr`", "is there already"),
        (replace("Cr", "m0( 1, 2)", "1, 2", "1"), "block `Cr`", "needs 2 indices"),
        (replace("Cr", "m0( 1, 2)", "D", "Q"), "block `Cr`", "is not a number"),
        (replace("Cr", "m0( 1, 2)", "D.*", "D+99"), "block `Cr`", "is not a number"),
        (replace("Cr", "m0( 1, 2)", "=.*", "=nan"), "block `Cr`", "is not a number"),
        (
            insert("Me", "m0(", "m1( 1, 1, 1) = 1.0D0"),
            "block `Me`",
            "needs `order = 1`",
        ),
        (insert("Cr", "m0(", "m7( 1, 1) = 1.0D0"), "block `Cr`", "must be a number"),
        (replace("refmod", "mass", "=.*", "= -2.0"), "`refmod`", "must be positive"),
        (replace("refmod", "mass", "=.*", "= heavy"), "`refmod`", "must be a number"),
        (replace("refmod", "nelastq", "2$", "0"), "`refmod`", "must be from 1"),
        (replace("refmod", "ielastq", "1", "7"), "`refmod`", "modes 1 to 2, not 7"),
        (negative("Me", "m0( 1, 1)"), "block `Me`", "positive definite"),
        (negative("Ke", "m0( 2, 2)"), "block `Ke`", "must not be negative"),
        (drop_block("Oe"), "the body", "the block `Oe` is missing"),
        (cut("Oe"), "block `Oe`", "truncated"),
        (drop("part", "part", after=0), "the part", "must be `part`"),
        (insert("part", "refmod", "  hello"), "`refmod`", "must be `refmod`"),
        (insert("frame", "new node", "  nothing"), "`frame`", "must be `new node"),
        (replace("frame", "rframe", "rframe", "rfarme"), "node 7", "must be `rframe"),
        (replace("frame", "phi", "phi", "fhi"), "node 7", "must be one of origin, phi"),
        (replace("end node", "new node", "12", "7"), "node 7", "is there already"),
        (insert("mdCM", "end mdCM", "end J"), "block `mdCM`", "must be `end mdCM`"),
    ],
)
def test_refusals(lines, tmp_path, change, where, message):
    changed, line = change(lines)
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        load_lines(changed, tmp_path)
    assert f"bad.SID_FEM, line {line}, {where}" in str(error.value)


def structured(structure, *records):
    """Change of the block `Me` to these numbers."""

    def change(lines):
        first, last = find(lines, "Me", "structure"), find(lines, "Me", "end Me")
        body = [f"structure = {structure}", *records]
        return [*lines[:first], *body, *lines[last:]], first

    return change


@pytest.mark.parametrize(
    ("change", "offset", "message"),
    [
        (structured(1, "m0( 2, 1) = 1.0D0"), 2, "structure 1 is a diagonal matrix"),
        (structured(0, "m0( 2, 1) = 1.0D0"), 2, "structure 0 is a zero matrix"),
        (structured(4, "m0( 1, 1) = 2.0D0"), 2, "structure 4 is a unit matrix"),
        (structured(0), -5, "must be positive definite"),
        (
            structured(3, "m0( 1, 1)=2", "m0( 2, 2)=2", "m0( 2, 1)=1.0", "m0(1,2)=1.1"),
            5,
            "must be symmetric, but m0(1, 2) = 1.1",
        ),
        (structured(3, "m0( 1, 1)=2", "m0( 2, 2)=2", "m0( 2, 1)=1"), 4, "symmetric"),
    ],
)
def test_refusals_of_structures(lines, tmp_path, change, offset, message):
    changed, line = change(lines)
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        load_lines(changed, tmp_path)
    assert f"line {line + offset}, block `Me`" in str(error.value)


@pytest.mark.parametrize(
    "change",
    [
        structured(1, "m0( 1, 1) = 2.0D0", "m0( 2, 2)=3.0"),
        structured(2, "m0( 1, 1)=2.0", "m0( 2, 2)=3", "m0( 1, 2) =.5D+0"),
        structured(2, "m0( 1, 1)=2.0", "m0( 2, 2)=3", "m0( 2, 1) =5.e-01"),
        structured(3, "m0(1,1)=2", "m0(2,2)=3", "m0(1,2)=0.5", "m0(2,1)=5.0-1"),
        structured(4),
        structured(4, "m0(1,1) = 1.0", "m0(2,2) = 1.0"),
    ],
)
def test_structures(lines, tmp_path, change):
    file = load_lines(change(lines)[0], tmp_path)
    matrix = file.blocks["Me"].m0
    assert np.array_equal(matrix, matrix.T)
    assert matrix[0, 0] in (1.0, 2.0)
    assert matrix[0, 1] in (0.0, 0.5)
    assert file.blocks["Me"].structure == int(change(lines)[0][change(lines)[1]][-1])


def test_header_against_the_rest(lines, tmp_path):
    changed = [lines[0].replace("   2    :", "   3    :"), *lines[1:]]
    with pytest.raises(ValueError, match="line 1, the header: counts 3 modes"):
        load_lines(changed, tmp_path)
    changed = [lines[0].replace("    2   2", "    5   2"), *lines[1:]]
    report = load_lines(changed, tmp_path).report
    assert "counts 5 nodes, but there are 2" in report.warnings[0]
    with pytest.raises(ValueError, match="is this a SID_FEM file"):
        load_lines(["<robot>", *lines], tmp_path)
    with pytest.raises(ValueError, match="truncated"):
        load_lines([""], tmp_path)
    with pytest.raises(ValueError, match="after `end part`: nothing may follow"):
        load_lines([*lines, *lines[1:]], tmp_path)


def test_blanks_and_windows_lines_do_not_matter(lines, tmp_path):
    spaced = [line for pair in zip(lines, [""] * len(lines)) for line in pair]
    spaced = [line.strip() + " \r" for line in spaced]
    one, other = load_lines(lines, tmp_path), load_lines(spaced, tmp_path)
    for name in one.blocks:
        assert np.array_equal(one.blocks[name].m1, other.blocks[name].m1)


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_mutated_files_are_read_or_refused_with_a_line(lines, tmp_path_factory, data):
    check_mutation(lines, tmp_path_factory.mktemp("mutated") / "bad.SID_FEM", data)


@pytest.mark.slow
@settings(max_examples=250, deadline=None)
@given(data=st.data())
def test_many_mutated_files(lines, tmp_path_factory, data):
    check_mutation(lines, tmp_path_factory.mktemp("mutated") / "bad.SID_FEM", data)


def check_mutation(lines, path, data):
    """A line that is lost, moved, there twice or changed, or a file cut off."""
    pick = lambda top: data.draw(st.integers(0, top))
    changed = list(lines)
    kind = data.draw(st.sampled_from(["drop", "swap", "cut", "text", "repeat"]))
    k = pick(len(lines) - 1)
    if kind == "drop":
        del changed[k]
    elif kind == "swap":
        other = pick(len(lines) - 1)
        changed[k], changed[other] = changed[other], changed[k]
    elif kind == "cut":
        changed = changed[:k]
    elif kind == "repeat":
        changed.insert(k, changed[k])
    else:
        at = pick(len(changed[k]))
        letters = "0123456789-+.,()=DEabmn \x00\x0c"
        text = data.draw(st.text(st.sampled_from(letters), max_size=3))
        changed[k] = changed[k][:at] + text + changed[k][at + pick(3) :]
    path.write_text("\n".join(changed))
    try:
        file = load_sid(path)
    except ValueError as error:
        assert re.search(r"line \d+, ", str(error))
    else:
        assert isinstance(file, SidFile)
        assert str(file.report)
