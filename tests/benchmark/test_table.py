"""The committed table: floors are at their chance, and the pages state its numbers."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest, chi2

from tauguard.benchmark.arms import ARMS
from tauguard.benchmark.judging import COLUMNS, COUNTED, UNMEASURED

ROOT = Path(__file__).resolve().parents[2]
FLOORS = ("knows nothing", "alarm at random")


@pytest.fixture(scope="module")
def rows():
    with (ROOT / "benchmark" / "table.csv").open(newline="") as stream:
        table = csv.DictReader(stream)
        assert tuple(table.fieldnames) == COLUMNS
        return list(table)


def test_a_floor_finds_what_chance_finds(rows):
    """The variance of a sum of independent hits with these probabilities is at most n p (1 - p)."""
    judged = [row for row in rows if row["method"] in FLOORS and row["contacts"]]
    assert len({row["arm"] for row in judged}) == 3
    for row in judged:
        n, chance = int(row["contacts"]), float(row["by chance"])
        error = 3 * np.sqrt(n * chance * (1 - chance)) + 1
        assert abs(int(row["found"]) - n * chance) <= error, row


def test_a_floor_has_no_rank_above_a_method_that_is_calibrated(rows):
    every = [row for row in rows if row["operating point"] == "60 an hour" and row["contacts"]]
    own = [r for r in every if r["method"] == "tauguard free-motion" and r["truth"] in COUNTED]
    assert all(int(r["found"]) / int(r["contacts"]) > float(r["by chance"]) for r in own)


def test_intervals_are_those_of_scipy(rows):
    for row in [row for row in rows if row["contacts"]]:
        interval = binomtest(int(row["found"]), int(row["contacts"])).proportion_ci(method="wilson")
        assert float(row["low"]) == pytest.approx(interval.low, abs=5e-4)
        assert float(row["high"]) == pytest.approx(interval.high, abs=5e-4)
    for row in [row for row in rows if row["free min"]][::7]:
        high = chi2.ppf(0.975, 2 * int(row["false alarms"]) + 2) / 2 / float(row["free min"]) * 60
        assert float(row["per hour high"]) == pytest.approx(high, rel=0.01, abs=1)


def test_every_arm_has_rows_and_the_blind_ones_say_that_they_are_not_measured(rows):
    assert {row["arm"] for row in rows} == set(ARMS)
    blind = {row["arm"] for row in rows if row["truth"] == UNMEASURED}
    assert blind == {name for name, arm in ARMS.items() if arm.blind}
    assert all(not row["within 100 ms"] for row in rows if row["truth"] == "by eye")


def test_the_pages_state_the_rows_of_the_table(rows):
    command = [sys.executable, "-m", "studies.real_arms.page"]
    table = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert len(table.splitlines()) == 18
    assert table in (ROOT / "docs/howto/benchmark.md").read_text()
    own = {
        (row["arm"], row["truth"], row["state"]): row
        for row in rows
        if row["method"] == "tauguard free-motion" and row["operating point"] == "60 an hour"
    }
    stated = re.findall(
        r"^\| (\w+), ([a-z ]+), (standing|moving) \| (\d+) of (\d+) \| ([\d.]+) \|",
        (ROOT / "docs/howto/real_arms.md").read_text(),
        re.M,
    )
    assert len(stated) >= 4
    for arm, truth, state, found, contacts, chance in stated:
        row = own[arm, truth, state]
        by_chance = f"{float(row['by chance']) * int(row['contacts']):.1f}"
        assert (row["found"], row["contacts"], by_chance) == (found, contacts, chance)
