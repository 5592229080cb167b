"""What calibrate, train, detect and evaluate say: standard output, error line, exit code, JSON.

The cases stand in commands.txt and real_commands.txt: a name, a command line, and the expected
text. They run in a temporary folder, in order; a case may use files that earlier ones wrote.
``python -m tests.golden.commands --write`` writes what the commands say now (the real cases only
if there are real logs: TAUGUARD_DATA). To add a case, write its name and command line first.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import itertools
import json
import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from tauguard.cli import main
from tests.golden.command_files import DATA, cut_logs, write_all
from tests.golden.computed import machine

FILE = Path(__file__).with_name("commands.txt")
REAL_FILE = Path(__file__).with_name("real_commands.txt")
#: Significant digits of the numbers in JSON.
DIGITS = 5

PROMPT = "$ tauguard "
#: Fields of JSON files that tell of this machine or of this run.
UNSTABLE = ("machine", "versions", "date")


@dataclass(frozen=True)
class Case:
    name: str
    line: str  #: the command line after ``tauguard``
    text: str  #: standard output, then error line, exit code and JSON


def spoken(line: str) -> str:
    """What a command says: standard output, then error line, exit code and JSON."""
    words = line.split()
    out, errors, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            main(words)
        except SystemExit as stop:
            code = stop.code
    parts = [out.getvalue().rstrip()] if out.getvalue() else []
    if errors.getvalue():
        parts.append(f"[error] {errors.getvalue().rstrip()}")
    if code:
        parts.append(f"[exit {code}]")
    if "--json" in words and not code:
        path = Path(words[words.index("--json") + 1])
        content = {k: v for k, v in json.loads(path.read_text()).items() if k not in UNSTABLE}
        parts += ["[json]", *lines_of(rounded(content))]
        path.unlink()
    return "\n".join(line.rstrip() for line in "\n".join(parts).splitlines())


def lines_of(value, indent: str = "") -> list[str]:
    """A JSON value, one line for each field; a value without objects in it is on one line."""
    if not isinstance(value, dict):
        if not (isinstance(value, list) and any(isinstance(item, dict) for item in value)):
            return [indent + json.dumps(value)]
        return [line for item in value for line in [f"{indent}-", *lines_of(item, indent + "  ")]]
    lines = []
    for key, item in value.items():
        first, *more = lines_of(item, indent + "  ") or ["{}"]
        inline = not more and not isinstance(item, dict)
        lines += (
            [f"{indent}{key}: {first.strip()}"] if inline else [f"{indent}{key}:", first, *more]
        )
    return lines


def rounded(value):
    """Every number of a JSON value with DIGITS significant digits; noise around 0 is 0."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    if isinstance(value, float) and math.isfinite(value):
        return 0.0 if abs(value) < 1e-9 else float(f"{value:.{DIGITS}g}")
    return value


def run_all(cases: Iterable[Case], make: Callable[[], None]) -> list[Case]:
    """The cases with the text of now; ``make`` writes the files into the temporary folder."""
    before, found = Path.cwd(), []
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        os.chdir(folder)
        try:
            make()
            for case in cases:
                text = spoken(case.line).replace(folder, "FOLDER")
                found.append(replace(case, text=text))
        finally:
            os.chdir(before)
    return found


#: A printed number, and what may stand in its place on another processor: a ruler under a heading
#: is as long as the longest number.
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
RULER = re.compile(r"-{2,}")


def differences(text: str, wanted: str) -> list[str]:
    """Words that differ between two texts, apart from rounding of the last printed digit."""
    words, expected = (RULER.sub("--", one).split() for one in (text, wanted))
    pairs = itertools.zip_longest(words, expected, fillvalue="")
    return [f"{a!r} instead of {b!r}" for a, b in pairs if a != b and not _near(a, b)]


def _near(a: str, b: str) -> bool:
    if NUMBER.sub("#", a) != NUMBER.sub("#", b):
        return False
    numbers = zip(NUMBER.findall(a), NUMBER.findall(b), strict=True)
    return all(
        abs(float(x) - float(y)) <= max(1.01 * _unit(y), 1e-3 * abs(float(y)), 1e-6)
        for x, y in numbers
    )


def _unit(number: str) -> float:
    """One in the last digit of a printed number."""
    digits, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def stored(file: Path) -> tuple[str, list[Case]]:
    """Hash of the machine that wrote the expected text, and the cases."""
    head, *blocks = re.split(r"^== ", file.read_text(), flags=re.MULTILINE)
    parts = [block.strip("\n").split("\n", 2) for block in blocks]
    cases = [Case(name, line.removeprefix(PROMPT), "".join(text)) for name, line, *text in parts]
    return head.split()[-1], cases


def write(file: Path, cases: Iterable[Case]) -> None:
    """Store the cases, and the hash of this machine's arithmetic."""
    blocks = [f"== {case.name}\n{PROMPT}{case.line}\n{case.text}\n" for case in cases]
    file.write_text("\n".join([f"machine {machine()}\n", *blocks]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", required=True)
    parser.parse_args()
    write(FILE, run_all(stored(FILE)[1], write_all))
    if DATA.is_dir():
        write(REAL_FILE, run_all(stored(REAL_FILE)[1], cut_logs))
