"""The page that needs nothing from outside."""

from html.parser import HTMLParser

import numpy as np
import pytest

from tauguard.report import rate
from tauguard.report.page import folded, page, picture, tables


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
    body = tables(rows, {"s": "how it is read."}) + picture(b"<svg/>", "svg+xml", "it")
    text = page("report", {"One & two": body, "Three": folded("more", "<p>text</p>")})
    found = Balance(text)
    assert not found.open
    assert all(link.startswith(("#", "data:")) for link in found.links)
    assert "&lt;a &amp; b&gt;" in text
    assert "how it is read." in text
    assert "0.900 [0.596, 0.982]" in text


def test_equal_rows_share_a_table():
    rows = [{"study": "a", "n": 1}, {"study": "a", "n": 2}, {"study": "b", "m": 3}]
    assert tables(rows, {}).count("<table>") == 2


@pytest.mark.parametrize("met", [True, False])
def test_verdicts_are_marked(met):
    assert f'class="{"yes" if met else "no"}"' in tables([{"right": met}], {})
