"""The page and the figures of error against cost."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest

from tauguard.report import rate
from tauguard.report.page import folded, page, picture, tables
from tauguard.report.pareto import Panel, Point, front, svg


class Balance(HTMLParser):
    """Counts what is opened and not closed, and keeps every link and source."""

    def __init__(self, text):
        super().__init__()
        self.open, self.links = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.links += [value for key, value in attrs if key in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_nothing_from_outside():
    rows = [{"study": "s", "name": "<a & b>", "hits": rate(9, 10), "met": np.False_ == 0}]
    panel = Panel("title", "us", "error", (Point("a", 1.0, 0.0), Point("b", 2.0, 1.0, peer=True)))
    body = tables(rows, {"s": "how it is read."}) + picture(svg(panel).encode(), "svg+xml", "it")
    text = page("report", {"One & two": body, "Three": folded("more", "<p>text</p>")})
    found = Balance(text)
    assert not found.open
    assert all(link.startswith(("#", "data:")) for link in found.links)
    assert "&lt;a &amp; b&gt;" in text
    assert "how it is read." in text
    assert "0.900 [0.596, 0.982]" in text


def test_the_front_is_what_nothing_beats_in_both():
    points = [Point("a", 1, 3), Point("b", 2, 3), Point("c", 3, 1), Point("d", 2, 2)]
    assert [p.label for p in front(points)] == ["a", "d", "c"]


def test_every_label_stands_once_below_and_every_point_is_numbered():
    points = (Point("slow", 9.0, 0.0), Point("fast", 1.0, 5.0), Point("fast", 2.0, 4.0))
    text = svg(Panel("t", "us", "e", points))
    assert text == svg(Panel("t", "us", "e", points))
    comments = re.findall(r"<!-- (.*?) -->", text)
    assert [c for c in comments if c in ("1  fast", "2  slow")] == ["1  fast", "2  slow"]
    assert comments.count("1") >= 2


def test_equal_rows_share_a_table():
    rows = [{"study": "a", "n": 1}, {"study": "a", "n": 2}, {"study": "b", "m": 3}]
    assert tables(rows, {}).count("<table>") == 2


@pytest.mark.parametrize("met", [True, False])
def test_verdicts_are_marked(met):
    assert f'class="{"yes" if met else "no"}"' in tables([{"right": met}], {})
