"""Rows and their targets, and what fails a run."""

import json
import math

import numpy as np
import pytest
from benchmarks._report import markdown
from benchmarks._rows import KEYS, Check, failures, label, relative_difference, row


def test_row_has_the_keys():
    entry = row("speed", 2.0, "us", peer="other", peer_value=4.0, variant="scan")
    assert tuple(entry)[: len(KEYS)] == KEYS
    assert entry["ratio"] == 0.5 and entry["variant"] == "scan"
    assert entry["holds"] is None and entry["target"] is None
    assert json.loads(json.dumps(entry)) == entry


def test_row_holds_if_all_checks_do():
    checks = Check("ratio", 0.5, 1), Check("max_difference", 1e-9, 7)
    good = row("a", 1.0, "us", peer_value=2.0, max_difference=0.0, checks=checks)
    assert good["holds"] and not failures([good])
    assert good["target"] == "at most ratio 0.5, at most difference 1e-09"
    bad = row("a", 1.01, "us", peer_value=2.0, max_difference=0.0, checks=checks)
    assert not bad["holds"] and len(failures([bad])) == 1


@pytest.mark.parametrize(("line", "failed"), [(2, False), (4, True)])
def test_some_lines_may_be_missed_by_a_factor_of_two(line, failed):
    entry = row("a", 1.9, "ms", checks=(Check("value", 1.0, line),))
    assert not entry["holds"]
    assert bool(failures([entry])) is failed
    entry = row("a", 2.1, "ms", checks=(Check("value", 1.0, line),))
    assert failures([entry])


@pytest.mark.parametrize("measured", [None, math.nan, math.inf])
def test_what_was_not_measured_does_not_hold(measured):
    check = Check("max_difference", 1e-9, 7)
    entry = row("a", 1.0, "us", max_difference=measured, checks=(check,))
    assert not entry["holds"] and failures([entry])


def test_check_of_an_unknown_quantity_is_refused():
    with pytest.raises(ValueError, match="must be a key of the row"):
        row("a", 1.0, "us", checks=(Check("speed", 1.0, 1),))


def test_label_tells_rows_apart():
    entry = row("a", 1.0, "us", batch=8, threads=2, peer="other", peer_value=1.0)
    assert label(entry) == "a (other, batch 8, 2 threads)"


def test_relative_difference_is_that_of_each_sample():
    desired = np.array([[1.0, -4.0], [1e-3, 0.0]])
    actual = desired + np.array([[0.0, 0.4], [0.0, 1e-4]])
    # rounding
    np.testing.assert_allclose(relative_difference(actual, desired), 0.1, rtol=1e-12)
    assert relative_difference(desired, desired) == 0.0
    assert relative_difference(desired[:, :0], desired[:, :0]) == 0.0
    with pytest.raises(ValueError, match="shape"):
        relative_difference(desired[0], desired)
    assert not relative_difference(desired * math.nan, desired) <= 1.0


def test_markdown_shows_every_row():
    entry = row(
        "growth_axes", 1.5, "exponent", checks=(Check("value", 2.0, 6),), note="so"
    )
    header = {
        "machine": {"cpu": "cpu", "cores": 2, "memory_gib": 1.0, "system": "s"},
        "versions": {"jax": "1"},
        "date": "2000-01-01",
        "minutes": 1.0,
        "quick": False,
    }
    text = markdown(header, [entry | {"benchmark": "growth"}], ["x: y"], "## Notes")
    for part in ("| growth_axes | 1.50 |", "- growth_axes: so.", "- x: y", "## Notes"):
        assert part in text
    assert "How does cost grow" in text
