"""What is said of the machine beside times."""

import os

import pytest

from tauguard.report import machine
from tauguard.report.machine import BUSY, load, load_line


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)


@pytest.mark.parametrize(("begin", "end"), [(7.9, 1.0), (0.1, 2 * BUSY + 0.1), (None, 3.0)])
def test_times_of_a_busy_machine_are_not_to_be_trusted(begin, end):
    assert (
        "times are too long, and their ratios inaccurate; measure again on an idle machine"
        in load_line(begin, end)
    )


@pytest.mark.parametrize(("begin", "end"), [(0.0, 1.0), (1.9, 2 * BUSY)])
def test_an_idle_one_or_our_own_workers_raise_no_doubt(begin, end):
    line = load_line(begin, end)
    assert line == f"load: {begin} before, {end} after, 2 cores"


def test_a_system_that_gives_no_load_says_so(monkeypatch):
    monkeypatch.delattr(os, "getloadavg")
    assert load() is None
    assert machine()["load"] is None
    assert "not known" in load_line(load(), load())


def test_the_load_is_the_systems(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.14159, 2.0, 1.0))
    assert machine()["load"] == 3.1
