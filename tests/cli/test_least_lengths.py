"""The least lengths of logs: every command enforces the same ones, and every text states them."""

import dataclasses
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from tauguard import detect_after_quiet
from tauguard.cli import calibrate, detect, main, train
from tauguard.detectors.calibration import identification
from tauguard.detectors.calibration.recording import LEAST, LEAST_STANDING, cut
from tauguard.detectors.scores.free_motion import FreeMotion
from tests.cli.test_real_logs import COLUMNS, GAINS, fails, flags, folder, written  # noqa: F401
from tests.detectors.synthetic_arm import record

PAGE = Path(__file__).parents[2] / "docs/howto/real_arms.md"


def asked(folder, log, longer):  # noqa: F811
    """The commands that learn from a log, or from the beginning of a longer one of its length."""
    given, out = [*flags(folder), "--gains", *GAINS], str(folder / "out")
    seconds = str(np.loadtxt(log, delimiter=",")[[0, -1], 0] @ [-1, 1])
    return {
        "calibrate": ["calibrate", log, *given, "--out", f"{out}.xml"],
        "train": ["train", "--free", log, *given, "--model", f"{out}.tauguard"],
        "detect": ["detect", longer, *given, "--quiet", seconds],
    }


@pytest.mark.parametrize("seconds", [10.2, 12.0, 14.0, 16.5])
def test_ten_seconds_of_motion_are_enough_for_every_command(folder, capsys, seconds):  # noqa: F811
    trace = record(5, seconds=20.0)
    longer = written(folder, "longer.csv", trace)
    log = written(folder, "enough.csv", cut(trace, slice(0, round(100 * seconds))))
    for arguments in asked(folder, log, longer).values():
        main(arguments)
    assert re.search(
        r"alarms in these logs: 0 in 0.\d min, each part with calibration", capsys.readouterr().out
    )


def test_less_motion_is_refused_by_every_command_in_the_same_words(folder, capsys):  # noqa: F811
    trace = record(5, seconds=20.0)
    longer = written(folder, "longer.csv", trace)
    log = written(folder, "little.csv", cut(trace, slice(0, 990)))
    for arguments in asked(folder, log, longer).values():
        said = fails(capsys, *arguments)
        assert (
            "9.8 s of motion in all, in each log from the first to the last: 10 s are the least"
            in said
        )


@pytest.mark.parametrize(("seconds", "enough"), [(1.9, False), (2.1, True)])
def test_two_seconds_are_enough_for_an_arm_that_stands(folder, capsys, seconds, enough):  # noqa: F811
    trace = record(5, seconds=20.0)
    rng = np.random.default_rng(0)
    current = np.repeat(trace.current[:1], len(trace.t), axis=0)
    current = current + rng.normal(scale=0.01, size=current.shape)
    still = dataclasses.replace(trace, q=0 * trace.q + 0.3, qd=0 * trace.qd, current=current)
    longer = written(folder, "still.csv", still)
    log = written(folder, "short.csv", cut(still, slice(0, round(100 * seconds) + 1)))
    commands = asked(folder, log, longer)
    for name in ("train", "detect"):
        if enough:
            main(commands[name])
            continue
        said = fails(capsys, *commands[name])
        assert "too short, 1.9 s in all: 2 s are the least" in said
    assert "no joint moves: 0 s of motion" in fails(capsys, *commands["calibrate"])


def test_texts_state_what_is_enforced():
    page = PAGE.read_text()
    assert COLUMNS
    for text in (
        page,
        calibrate.command.__doc__,
        train.command.__doc__,
        FreeMotion.fit.__doc__,
        identification.identify.__doc__,
    ):
        plain = " ".join(text.split())
        assert re.findall(r"(\d+) s of (?:collision-free )?motion", plain) == [f"{LEAST:g}"]
    assert f"only stands needs {LEAST_STANDING:g} s" in " ".join(page.split())
    quiet = inspect.signature(detect_after_quiet).parameters["quiet"].default
    assert f"`--quiet` seconds ({quiet:g})" in " ".join(page.split())
    assert f"[s] (default: {quiet:g})" in " ".join(detect.command.__doc__.split())
    assert LEAST_STANDING < LEAST < quiet
