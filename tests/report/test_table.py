"""Tables that fit a terminal and lose no column, and of a value its interval at most."""

import pytest

from tauguard.report import WIDTH, cell, rate, table


def test_a_table_that_fits_shows_everything():
    rows = [{"study": "s", "name": "a", "hits": rate(9, 10), "same": True}] * 2
    assert table(rows).splitlines() == [
        "s",
        "",
        "name  hits                  same",
        "----  --------------------  ----",
        "a     0.900 [0.596, 0.982]  yes",
        "a     0.900 [0.596, 0.982]  yes",
    ]


def test_another_study_or_other_columns_begin_another_table():
    rows = [{"study": "a", "n": 1}, {"study": "b", "n": 2}, {"study": "b", "m": 3}, {"m": 4}]
    heads = ["a\n\nn\n-\n1", "b\n\nn\n-\n2", "b\n\nm\n-\n3", "m\n-\n4"]
    assert table(rows) == "\n\n".join(heads)


def test_a_note_stands_beside_its_study():
    rows = [{"study": "a", "n": 1}, {"study": "b", "n": 2}]
    text = table(rows, notes={"b": "n: how many."})
    assert text == "a\n\nn\n-\n1\n\nb: n: how many.\n\nn\n-\n2"
    long = table(rows, width=40, notes={"a": "words " * 30})
    assert max(map(len, long.splitlines())) <= 40


def test_headings_break_before_intervals_go_and_these_before_columns_do():
    def wide(**more):
        return table([{"name": "a", "a_long_heading_in_words": 1, **more}], width=40)

    assert wide().splitlines()[0] == "name  a_long_heading_in_words"
    kept = wide(error=rate(1, 2))
    assert "a_long_" in kept.split()
    assert "0.500 [0.095, 0.905]" in kept
    brief = wide(error=rate(1, 2), other=rate(1, 4))
    assert "0.500  0.250" in " ".join(brief.split("\n")).replace("   ", "  ")
    assert "[" not in brief


@pytest.mark.parametrize("count", [1, 12, 40])
def test_columns_that_do_not_fit_follow_below_under_the_same_names(count):
    row = {"study": "s", "name": "arm", "kind": "x" * 20}
    row |= {f"the_value_{i}": 1000 + i for i in range(count)} | {"note": "some words " * 40}
    text = table([row, row])
    assert max(map(len, text.splitlines())) <= WIDTH
    for i in range(count):
        assert text.count(str(1000 + i)) == 2
    assert text.count("words") == 80
    assert text.count("arm") == 2 * (1 + text.count("\n\n") - 1)


def test_a_small_rate_is_not_shown_as_none():
    assert cell(rate(0, 10**6), brief=True) == "0.000"
    assert cell(rate(3, 10**6), brief=True) == "3.0e-06"
    assert cell(rate(0, 0), brief=True) == "-"
    assert cell({"median": 12.345, "low": 1.0, "high": 20.0}, brief=True) == "12.3"
    assert cell({"median": -12.345, "low": -20.0, "high": 1.0}, brief=True) == "-12.3"
    assert cell({"median": 12.345, "low": 1.0, "high": 20.0}) == "12.3 [1, 20]"


def test_a_time_of_one_repeat_has_no_interval():
    assert cell({"median": 2.0, "low": 2.0, "high": 2.0}) == "2"
    assert cell({"median": 2.0, "low": 1.5, "high": 2.0}) == "2 [1.5, 2]"


def test_a_broken_heading_keeps_its_spaces():
    rows = [{"held out, rms of each log": "a" * 30, "another long_heading [N m]": "b" * 30}]
    lines = table(rows, width=60).splitlines()
    text = " ".join(" ".join(lines).split())
    assert "held out" in text
    assert "another long_" in text
    assert "heldout" not in text
    assert "[N m]" in text


def test_delays_are_their_median_and_95th_percentile():
    some = {"median": 5.0, "p95": 14.8, "n": 3}
    assert cell(some) == "5, 14.8"
    assert cell(some, brief=True) == "5"
    assert cell({"median": None, "p95": None, "n": 0}) == "-"
