"""The commands say what they said: text, error line, exit code and JSON, word by word."""

import difflib

import pytest

from tests.golden import commands
from tests.golden.computed import machine

HINT = "; if that is meant: `python -m tests.golden.commands --write`, and look at the difference"


def names(file):
    return [case.name for case in commands.stored(file)[1]]


def compared(file, make):
    """A function that compares the text of a case with the stored one."""
    written_on, cases = commands.stored(file)
    now = {case.name: case.text for case in commands.run_all(cases, make)}
    wanted, same_machine = {case.name: case.text for case in cases}, machine() == written_on

    def compare(name):
        if same_machine:
            rows = (text.splitlines() for text in (wanted[name], now[name]))
            difference = "\n".join(difflib.unified_diff(*rows, "golden", "now", lineterm="", n=0))
            assert not difference, f"{name}{HINT}\n{difference}"
        assert not commands.differences(now[name], wanted[name]), f"{name}{HINT}"

    return compare


@pytest.fixture(scope="module")
def synthetic():
    return compared(commands.FILE, commands.write_all)


@pytest.fixture(scope="module")
def real(data_dir):
    return compared(commands.REAL_FILE, commands.cut_logs)


@pytest.mark.parametrize("name", names(commands.FILE))
def test_synthetic_arms(name, synthetic):
    synthetic(name)


@pytest.mark.data
@pytest.mark.parametrize("name", names(commands.REAL_FILE))
def test_real_arms(name, real):
    real(name)


@pytest.mark.parametrize(
    ("text", "differs"),
    [
        ("log0.csv   0.07 N m, 3.1234 s to 21.0 s", False),
        ("log0.csv 0.08 N m,\n3.1244 s to 21.0 s", False),  # one in the last digit, another line
        ("log0.csv   0.09 N m, 3.1234 s to 21.0 s", True),
        ("log1.csv   0.07 N m, 3.1234 s to 21.0 s", True),
        ("log0.csv   0.07 N m, 3.1234 s to 22.0 s", True),
        ("log0.csv   0.07 N m, 3.1234 s to 21.0 s more", True),
    ],
)
def test_texts_of_another_machine_may_differ_in_rounding_alone(text, differs):
    assert bool(commands.differences(text, "log0.csv 0.07 N m, 3.1234 s to 21.0 s")) == differs
