"""The framework, tried on studies of the test's own: what is measured, kept, printed and shown."""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
from html import escape
from pathlib import Path
from types import SimpleNamespace

import pytest

from tauguard.report import versions

ROOT = Path(__file__).resolve().parents[2]
FRAMEWORK = ROOT / "studies" / "framework"
INIT = """
from studies.framework import Part, Point, Study
STUDY = Study("a study", {parts})
def points(rows):
    for row in rows:
        if "us" in row:
            yield Point("a question", "ours", row["us"], 0.5, "1 wrong", "ours")
            yield Point("a question", "theirs", 2 * row["us"], 0.0, "0 wrong", "peer")
def detections(rows):
    return [{{"found": row["found"]}} for row in rows if "found" in row]
"""
PART = """
NOTES = {"a": "What the columns mean."}
def draw(rows, figure):
    figure.subplots().plot([row["us"] for row in rows if row["study"] == "a"])
"""
GOOD = """
def measure(quick, seed, robot=None):
    return [{"study": "a", "us": 40.0, "robot": robot, "seed": seed, "quick": quick, "found": 7}]
def judge(rows):
    from studies.framework import answer
    return [answer("how far", "1 m", "2 m", rows[0]["us"] > 50)]
"""
JOBS = """
import os
from studies.framework import JobCache, Workers
def double(job):
    with open("done.txt", "a") as log:
        log.write(f"{job} ")
    if job == 3 and "FAIL" in os.environ:
        raise ZeroDivisionError("three")
    return [{"value": 2.0 * job, ("a", 1): [job, None]}]
def measure(quick, seed, keep=None):
    cache = JobCache.of(keep, "jobs", seed, "size")
    with Workers() as each:
        found = [one["value"] for (one,) in cache.over(each, "double")(double, [5, 3, 4])]
    return [{"study": "a", "us": value} for value in found]
"""
RECORDED = """
def judged(folder, seed):
    folder.mkdir(exist_ok=True)
    rows = []
    for kind in ("missed", "late", "false alarm"):
        for k in (1, 2):
            (folder / f"{kind}-{k}.rrd").write_bytes(b"")
            (folder / f"{kind}-{k}.png").write_bytes(f"{kind}-{k}".encode())
            rows.append({"kind": kind, "file": f"{kind}-{k}.rrd", "at [s]": 1.5})
    return {"counts": "2 missed, 2 late, 2 false alarms", "rows": rows}
"""
#: Parts by study: their modules' text, and the options that they take.
STUDIES = {
    "first": {"good": (GOOD, ("robot",)), "jobs": (JOBS, ("keep",))},
    "second": {
        "broken": ("import numpy\ndef measure(quick, seed): numpy.zeros(0).max()", ()),
        "refused": ("def measure(quick, seed): raise ValueError('no detector of that name')", ()),
        "partial": (
            "from studies.framework import Incomplete\ndef measure(quick, seed):\n"
            "    raise Incomplete([{'study': 'a', 'us': 42.0}], {'b': ZeroDivisionError('zero')})",
            (),
        ),
    },
}


#: Runs commands one after the other in a process, where libraries are loaded once.
EACH = """
import contextlib, io, json, runpy, sys
found = []
for command in json.loads(sys.argv[1]):
    sys.argv[1:], out, err, code = command, io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            runpy.run_module("studies", run_name="__main__")
        except SystemExit as end:
            code = end.code
    found.append([code or 0, out.getvalue(), err.getvalue()])
print(json.dumps(found))
"""


@pytest.fixture
def checkout(tmp_path):
    """A folder with the framework and the studies above; functions that run it there.

    ``run(*command)`` starts a process of its own, ``run.each(command, ...)`` one for all commands.
    """
    studies = tmp_path / "studies"
    studies.mkdir()
    shutil.copytree(FRAMEWORK, studies / "framework")
    shutil.copy(FRAMEWORK.parent / "__main__.py", studies)
    with (studies / "framework" / "mistakes.py").open("a") as module:
        module.write(RECORDED)  # instead of training a detector for minutes
    (studies / "__init__.py").write_text(f"STUDIES = {tuple(STUDIES)!r}\n")
    for study, parts in STUDIES.items():
        (studies / study).mkdir()
        named = ", ".join(
            f"{name!r}: Part('{study}.{name}', 'asks', {options!r}, alias='own_{name}')"
            for name, (_, options) in parts.items()
        )
        (studies / study / "__init__.py").write_text(INIT.format(parts=f"{{{named}}}"))
        for name, (text, _) in parts.items():
            (studies / study / f"{name}.py").write_text(PART + text)

    def run(*args, **environment):
        return subprocess.run(
            [sys.executable, "-m", "studies", *map(str, args)],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(tmp_path)} | environment,
            capture_output=True,
            text=True,
        )

    def each(*commands):
        texts = json.dumps([[str(arg) for arg in command] for command in commands])
        done = subprocess.run(
            [sys.executable, "-c", EACH, texts],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        fields = ("returncode", "stdout", "stderr")
        return [
            SimpleNamespace(**dict(zip(fields, one, strict=True)))
            for one in json.loads(done.stdout)
        ]

    run.folder, run.each = tmp_path, each
    return run


def test_every_part_of_every_study_has_what_the_framework_asks_for():
    """The parts themselves run in the slow tests; mypy holds what they call.

    A hook that a part imports for its own use must not pass for the one that the framework calls.
    """
    code = """
import inspect
from studies.framework.study import all_parts, package
for name, part in all_parts().items():
    module = part.load()
    assert {"quick", "seed", *part.options} == set(inspect.signature(module.measure).parameters)
    assert module.NOTES and all(text.endswith(".") for text in module.NOTES.values()), name
    assert hasattr(module, "draw") or hasattr(package(name.partition("-")[0]), "points"), name
    for hook in ("measure", "draw", "judge", "table"):
        function = getattr(module, hook, None)
        assert function is None or function.__module__.startswith("studies."), (name, hook)
"""
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def rows(path):
    return json.loads(path.read_text())["rows"]


def test_a_part_is_measured_judged_printed_drawn_and_written(checkout):
    flags = ("bench", "first-good", "--seed", "3", "--json", "rows.json")
    done, full = checkout.each(flags, (*flags, "--tables"))
    assert done.returncode == 0, done.stderr
    written = json.loads((checkout.folder / "rows.json").read_text())
    assert written["name"] == "first-good"
    row, summary = written["rows"]
    assert (row["seed"], row["quick"], row["robot"]) == (3, False, None)
    assert (summary["question"], summary["met"]) == ("how far", False)
    short = done.stdout
    assert "a: What the columns mean." not in short
    assert re.search(
        r"^a question\n\nmethod +microseconds +error\n.*\nours +40 +0.5\n", short, re.M
    )
    assert re.search(r"^how far +1 m +2 m +no\nevery table: --tables\n", short, re.M)
    assert "a: What the columns mean." in full.stdout
    assert "every table" not in full.stdout
    assert re.search(r"^load: ", done.stdout, re.MULTILINE)
    assert (checkout.folder / "bench-first-good.png").read_bytes().startswith(b"\x89PNG")


def test_a_study_runs_all_its_parts_and_each_has_a_name_of_its_own(checkout):
    done, alias, listed = checkout.each(
        ("bench", "first", "--quick", "--json", "rows.json"),
        ("bench", "own_good", "--json", "one.json"),
        ("bench", "list"),
    )
    assert done.returncode == 0, done.stderr
    assert rows(checkout.folder / "rows-good.json")[0]["quick"] is True
    assert [row["us"] for row in rows(checkout.folder / "rows-jobs.json")] == [10.0, 6.0, 8.0]
    assert alias.returncode == 0, alias.stderr
    assert rows(checkout.folder / "one.json")[0]["us"] == 40.0
    assert "first: a study" in listed.stdout
    assert "jobs (own_jobs)  asks" in listed.stdout


def test_an_option_runs_the_parts_that_take_it(checkout):
    done, refused = checkout.each(
        ("bench", "first", "--robot", "ur5", "--json", "rows.json"),
        ("bench", "second", "--robot", "ur5"),
    )
    assert done.returncode == 0, done.stderr
    assert rows(checkout.folder / "rows.json")[0]["robot"] == "ur5"
    assert not (checkout.folder / "done.txt").exists()
    assert "--robot goes with first-good, not with second" in refused.stderr


#: Commands of bad input, and what is said to them.
BAD = (
    (("frist",), "no study 'frist': did you mean first?"),
    (("nothing",), "no study 'nothing': there are first, second"),
    (("first-bad",), "no study 'first-bad': there are first, second"),
    (("second-refused",), "no detector of that name"),
    (("own_good", "--json", "none/f.json"), "no folder none; make it first"),
    (("own_jobs", "--keep", "file"), "--keep file: cannot be written"),
)


def test_bad_input_is_one_line_and_exit_code_2(checkout):
    (checkout.folder / "file").touch()
    every = checkout.each(*(("bench", *args) for args, _ in BAD))
    for (_, said), done in zip(BAD, every, strict=True):
        assert done.returncode == 2, said
        assert said in done.stderr
        assert done.stderr.count("\n") == 1, said


def test_an_error_of_a_library_is_a_defect_and_not_bad_input(checkout):
    done = checkout("bench", "own_broken")
    assert done.returncode == 1
    assert "a defect of tauguard" in done.stderr
    assert "zero-size array" in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" in checkout("bench", "own_broken", "--debug").stderr


def test_what_was_found_before_a_failure_is_printed_and_written(checkout):
    done = checkout("bench", "own_partial", "--json", "rows.json")
    assert done.returncode == 1
    assert "42" in done.stdout
    assert "b: ZeroDivisionError: zero" in done.stderr
    written = json.loads((checkout.folder / "rows.json").read_text())
    assert written["rows"] == [{"study": "a", "us": 42.0}]
    assert "zero" in written["incomplete"]


def test_jobs_that_the_cache_holds_are_not_run_again(checkout):
    log, flags = checkout.folder / "done.txt", ("own_jobs", "--keep", "kept", "--json", "r.json")
    assert checkout("bench", *flags, "--workers", "1", FAIL="1").returncode == 1
    first = log.read_text().split()
    assert first == ["5", "3"]
    assert checkout("bench", *flags, "--workers", "2").returncode == 0
    again = log.read_text().split()[len(first) :]
    assert sorted(again) == ["3", "4"]
    assert [row["us"] for row in rows(checkout.folder / "r.json")] == [10.0, 6.0, 8.0]
    other = ("--seed", "1", "--workers", "1")  # another seed, another folder
    assert checkout("bench", *flags, *other).returncode == 0
    assert len(log.read_text().split()) == len(first) + len(again) + 3
    for path in checkout.folder.glob("kept/jobs-seed0-*/*.npz"):
        path.write_bytes(path.read_bytes()[:-40])
    done = checkout("bench", *flags, "--workers", "1")
    assert "damaged, or of other code: delete it" in done.stderr


def test_the_report_runs_what_is_not_there_and_says_what_failed(checkout):
    case = {"case": "c", "library": "tauguard", "kind": "scene", "expected": "1", "answer": "2"}
    case |= {"right": False, "why": "a hard one", "origin": "here", "explained": "soft"}
    (checkout.folder / "page").mkdir()
    kept = {"versions": versions(), "rows": [case]}  # of this build: they are not run again
    (checkout.folder / "page" / "hard-cases.json").write_text(json.dumps(kept))
    done = checkout("report", "--out", "page", "--quick", "--no-mistakes")
    assert done.returncode == 1
    text = (checkout.folder / "page" / "index.html").read_text()
    asked = "0 of 1 targets are reached"
    for part in (
        "Not recorded in a quick run",
        "Study: first-good",
        "how far",
        asked,
        "a hard one",
    ):
        assert part in text
    assert "<td>40 µs</td><td>1 wrong</td><td>theirs</td><td>80 µs</td>" in text
    assert "<th>found</th></tr><tr><td>7</td>" in text
    assert 'alt="a question" src="data:image/svg+xml' in text
    assert "zero-size array" in text
    assert "Study: second-broken" not in text
    again, nowhere, unknown = checkout.each(
        ("report", "--out", "page", "--quick", "--no-mistakes", "--study", "first"),
        ("report", "--out", "none", "--bound"),
        ("report", "--out", "a", "--study", "x"),
    )
    assert "first-good: there already" in again.stdout
    assert "second" not in again.stdout
    assert nowhere.returncode == 2
    assert "there are first, second" in unknown.stderr


def written(name, one_row, **changed):
    """A file as a part writes it."""
    on = {"processor": "P", "cores": 2, "system": "Linux"}
    file = {"name": name, "quick": True, "seed": 0, "machine": on, "versions": {}}
    return json.dumps(file | {"rows": [one_row]} | changed)


#: Files under the names of parts that no part wrote: their text, and what is wrong with them.
STRANGE = {
    "first-good": ("", "is no JSON file"),
    "first-jobs": ("[" * 100_000, "is no JSON file"),
    "second-broken": ("[1]", "it holds no object"),
    "second-refused": (written("first-good", {}), "it says 'first-good'"),
    "second-partial": (written("second-partial", 1), "a row is no object"),
}
ALSO = {
    "first-good": (json.dumps({"name": "first-good"}), "'quick' is missing"),
    "first-jobs": (written("first-jobs", {}, machine={"cores": 2}), "'machine' lacks one of"),
}


@pytest.mark.parametrize("strange", [STRANGE, ALSO])
def test_files_that_no_part_wrote_are_named_and_not_written_over(checkout, strange):
    folder = checkout.folder / "page"
    folder.mkdir()
    (folder / "mine.json").write_text("{}")
    for name, (text, _) in strange.items():
        (folder / f"{name}.json").write_text(text)
    done, ran = checkout.each(
        ("report", "--out", "page", "--bound", "--no-mistakes"),
        ("bench", "all", "--out", "page", "--quick"),
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == len(strange)
    page = (folder / "index.html").read_text()
    assert "not read: mine.json" in page
    for name, (text, why) in strange.items():
        (line,) = [line for line in done.stderr.splitlines() if f" {name}: {name}.json" in line]
        assert why in line
        assert escape(line.partition("not whole: ")[2]) in page
        assert re.search(rf"^{name}: {name}\.json .*move it away", ran.stdout, re.MULTILINE)
        assert (folder / f"{name}.json").read_text() == text


def test_what_comes_from_outside_is_escaped_and_rows_of_another_form_are_named(checkout):
    evil = "<script>alert(1)</script>\x1b[2J"
    folder = checkout.folder / "page"
    folder.mkdir()
    row = {
        "study": evil,
        "us": 1.0,
        "asked": evil,
        "measured": evil,
        "met": False,
        "question": evil,
    }
    changed = {"incomplete": evil, "machine": {"processor": evil, "cores": 2, "system": "Linux"}}
    (folder / "first-good.json").write_text(written("first-good", row, **changed))
    (folder / "first-jobs.json").write_text(written("first-jobs", {"study": "a", "us": "x"}))
    (folder / f"{evil.replace('/', '')}.json").write_text("{}")
    done = checkout("report", "--out", "page", "--bound", "--no-mistakes")
    page = (folder / "index.html").read_text()
    assert "<script" not in page
    assert "\x1b" not in done.stderr
    assert "&lt;script&gt;" in page
    assert "first table: TypeError" in done.stderr
    assert "incomplete: " in page


def test_mistakes_are_recorded_once_and_linked(checkout):
    folder = checkout.folder / "a & b"
    folder.mkdir()
    command, index = ("report", "--out", "a & b", "--bound"), folder / "index.html"
    done = checkout(*command)
    page = index.read_text()
    assert done.stdout.count("training the detector") == 1
    for part in (escape("'a & b'"), "2 missed, 2 late", "no alarm starts in the collision"):
        assert part in page
    assert 'href="open/wrong/false%20alarm-1.rrd"' in page
    drawn = [base64.b64decode(one).decode() for one in re.findall('png;base64,([^"]+)', page)]
    assert drawn == ["missed-1", "late-1", "false alarm-1"]
    assert "training" not in checkout(*command).stdout
    assert index.read_text() == page
    (folder / "wrong" / "late-2.rrd").unlink()
    gone, seed = checkout.each(command, (*command, "--seed", "1"))
    assert "some recordings are gone" in gone.stdout
    assert "another seed or build" in seed.stdout


def test_a_list_of_mistakes_of_somebody_else_is_named_and_kept(checkout):
    texts = {"a & b": "", "b": '{"seed": 3, "rows": 1, "counts": ""}'}
    for folder, text in texts.items():
        (checkout.folder / folder).mkdir()
        (checkout.folder / folder / "wrong.json").write_text(text)
    every = checkout.each(*(("report", "--out", folder, "--bound") for folder in texts))
    for (folder, text), done in zip(texts.items(), every, strict=True):
        assert done.returncode == 1
        assert "not a list of mistakes" in done.stderr
        assert (checkout.folder / folder / "wrong.json").read_text() == text


def test_an_installation_without_studies_says_where_they_are(tmp_path):
    """The package alone, as a wheel has it, in a folder without a checkout."""
    code = (
        "import tauguard.cli.checkout as own, sys, tauguard.cli as cli\n"
        f"own.tauguard.__file__ = {str(tmp_path / 'a' / 'b' / 'c' / '__init__.py')!r}\n"
        "cli.main([sys.argv[1], 'list'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "report"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "the studies are in the source distribution" in done.stderr
    assert done.stderr.count("\n") == 1
