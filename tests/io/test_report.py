"""Tables for the terminal and the report."""

import base64
import html.parser

import pytest
from elastax.io import FEEDFORWARD_COLUMNS, Column, feedforward_rows, format_table
from elastax.io._report import render_report

from tests.io.test_results import result


VOID = {"meta", "img"}


class Page(html.parser.HTMLParser):
    """Collects what a page holds and that its tags are closed in order."""

    def __init__(self, text: str):
        html.parser.HTMLParser.__init__(self)
        self.open, self.tags, self.attributes, self.text = [], [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        """Remember the tag."""
        self.tags.append(tag)
        self.attributes += attributes
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        """The last open tag must be closed first."""
        assert self.open.pop() == tag

    def handle_data(self, data):
        """Collect the text."""
        self.text += data


def test_table_aligns_and_shows_units():
    rows = [
        {"name": "rigid", "error": 0.0123456, "count": 3},
        {"name": "a long name", "error": 0.001, "count": 12},
    ]
    columns = [
        Column("name", "feed-forward"),
        Column("error", "path error", "mm", 1e3),
        Column("count", "steps"),
    ]
    assert format_table(rows, columns).splitlines() == [
        "feed-forward  path error  steps",
        "                    [mm]",
        "-------------------------------",
        "rigid              12.35      3",
        "a long name         1.00     12",
    ]


def test_table_without_units_has_one_head():
    table = format_table([{"a": "x"}], [Column("a", "title")])
    assert table.splitlines() == ["title", "-----", "x"]


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([12.0, 0.575], ["12.000", "0.575"]),
        ([1000.0, 0.001], ["1000.0", "1.00e-03"]),
        ([1e9, 2.0], ["1.00e+09", "2.00e+00"]),
        ([1e-9], ["1.00e-09"]),
        ([0.0], ["0.000"]),
        ([None, float("nan"), 1.0], ["-", "-", "1.000"]),
        ([float("inf"), 1.0], ["inf", "1.000"]),
        ([], []),
    ],
)
def test_numbers_have_sensible_digits(values, texts):
    table = format_table([{"x": value} for value in values], [Column("x", "x")])
    assert [line.strip() for line in table.splitlines()[2:]] == texts


def test_feedforward_rows_compare_with_the_flexible_joint():
    value = result()
    value["inverses"]["asim"]["path_error_integral"] = 1e-4
    value["inverses"]["rigid"]["path_error_integral"] = None
    rows = {row["inverse"]: row for row in feedforward_rows(value)}
    assert rows["ASIM"]["ratio"] == pytest.approx(0.1)
    assert rows["ASIM"]["ratio_relative"] == 1.0
    assert rows["rigid"]["ratio"] is None
    table = format_table(list(rows.values()), FEEDFORWARD_COLUMNS)
    assert "[mm s]" in table and "ASIM" in table


def test_report_is_complete_and_self_contained():
    value = result()
    value["robot"] = {"name": "kr210", "assumptions": ["soft"], "sources": ["a book"]}
    value["configuration"] = {"pose": "stretched", "filter": {"order": 6}}
    value["not_finite"] = {"inverses.rigid.criterion": "nan"}
    picture = b"\x89PNG picture"
    text = render_report(value, [("error", "Path error", "Of the tool.", picture)])
    page = Page(text)
    assert not page.open
    assert "script" not in page.tags and "link" not in page.tags
    sources = [value for name, value in page.attributes if name in ("src", "href")]
    data = base64.b64encode(picture).decode()
    assert sources == [f"data:image/png;base64,{data}"]
    for word in (
        "feedforward: kr210",
        "flexible joint (RLFJ)",
        "Of the tool.",
        "torque R²",
        "soft",
        "a book",
        "filter.order",
        "stretched",
        "inverses.rigid.criterion",
        "wall_s",
    ):
        assert word in page.text
    assert "prefers-color-scheme: dark" in text


def test_report_escapes_text():
    value = {
        "schema": "x/1",
        "robot": "<b>bold</b>",
        "assumptions": ['<script>alert("x")</script>'],
        "configuration": {"a<b": "&"},
    }
    text = render_report(value, [("f", '"><script>', "<i>", b"")])
    page = Page(text)
    assert "script" not in page.tags and "i" not in page.tags
    assert '<script>alert("x")</script>' in page.text
    assert "<b>bold</b>" in page.text and "a<b" in page.text


def test_report_of_little_data():
    page = Page(render_report({"schema": "elastax.analyse/1", "number": 0.1}, []))
    assert "analyse" in page.text and "0.1" in page.text
