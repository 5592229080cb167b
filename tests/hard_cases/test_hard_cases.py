"""The hard cases: their answers from exact arithmetic elsewhere, and how libraries are asked."""

import json
import subprocess
import sys
from fractions import Fraction

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.convex_overlap import cross, dot
from oracles.mesh_contact import first_contact
from tauguard.cli import main
from tauguard.hard_cases import adapters, load_cases, run
from tauguard.hard_cases.case import Case
from tauguard.hard_cases.verdicts import by_library, verdicts

CASES = load_cases()
#: Where a scene's answer is MuJoCo's, whose contacts and dry friction yield.
SOFT = {"mass_ratio_1e4", "friction_holds", "joint_limit_at_speed"}


def of(*kinds):
    chosen = [case for case in CASES if case.kind in kinds]
    return pytest.mark.parametrize("case", chosen, ids=lambda case: case.name)


def test_names_are_unique_and_origins_are_given():
    assert len({case.name for case in CASES}) == len(CASES)
    assert all(case.why and case.origin for case in CASES)
    origins = " ".join(case.origin for case in CASES)
    for origin in ("Tight-Inclusion/issues/1", "Scalable-CCD/issues/8", "mujoco/issues/441"):
        assert origin in origins
    assert "parry/issues/429" in origins
    assert "box2d/issues/115" in origins


@of("vertex_face", "edge_edge")
def test_query_times_are_those_of_exact_integers(case):
    found = first_contact(case.given["x_t0"], case.given["x_t1"], case.kind == "vertex_face")
    if case.exact is None:
        assert found is None
    else:
        low, high = found
        assert low <= case.exact <= high
        assert high - low < Fraction(1, 10**9)


def axes(a, b):
    """Every direction that can separate two hulls: differences of corners, crossed."""
    a, b = ([tuple(map(Fraction, p)) for p in side] for side in (a, b))
    edges = [
        tuple(x - y for x, y in zip(p, q, strict=True))
        for s in (a, b)
        for p in s
        for q in s
        if p != q
    ]
    edges = list({e if e > tuple(-x for x in e) else tuple(-x for x in e) for e in edges})
    return a, b, {cross(u, v) for u in edges for v in edges} - {(0, 0, 0)} | set(edges)


@of("convex_overlap", "convex_sweep")
def test_convex_answers_are_those_of_rational_numbers(case):
    a, b, directions = axes(case.given["a"], case.given["b"])
    move = tuple(map(Fraction, case.given.get("displacement", (0, 0, 0))))
    enter, leave = Fraction(0), Fraction(1)
    for n in directions:
        low = min(dot(n, p) for p in a) - max(dot(n, p) for p in b)
        high = max(dot(n, p) for p in a) - min(dot(n, p) for p in b)
        speed = dot(n, move)
        if speed == 0:
            if low > 0 or high < 0:
                leave = Fraction(-1)
            continue
        first, last = sorted((low / speed, high / speed))
        enter, leave = max(enter, first), min(leave, last)
    touch = enter if enter <= leave else None
    if case.kind == "convex_overlap":
        assert (touch is not None) == case.expected["overlap"]
    else:
        assert touch == case.exact


def test_rectangles_of_box2d_115_never_touch():
    """Apart at 2,001 times by more than any corner moves between two of them."""
    case = next(case for case in CASES if case.name == "box2d_115")

    def corners(points, motion, t):
        turn = Rotation.from_rotvec(np.add(motion["rotation"], np.multiply(t, motion["angular"])))
        return turn.apply(points) + motion["position"] + np.multiply(t, motion["linear"])

    still = corners(case.given["a"], case.given["motion_a"], 0.0)
    normals = Rotation.from_rotvec(case.given["motion_a"]["rotation"]).as_matrix()[:, :2].T
    times = np.linspace(0.0, 1.0, 2001)
    moving = [corners(case.given["b"], case.given["motion_b"], t) for t in times]
    gaps = [max(g(still, p, n) for n in normals for g in (gap, back)) for p in moving]
    step = np.abs(np.diff(moving, axis=0)).sum(axis=2).max()
    assert min(gaps) > step


def gap(a, b, n):
    return (a @ n).min() - (b @ n).max()


def back(a, b, n):
    return gap(b, a, n)


def test_ours_are_right_but_for_what_mujoco_softens():
    rows = run(CASES, adapters(("tauguard",)))
    assert len(rows) == len(CASES)
    assert {row["case"] for row in rows if not row["right"]} == SOFT


def test_wrong_answers_are_found():
    class Wrong:
        name = "wrong"

        def vertex_face(self, x_t0, x_t1):
            return 0.0

        def convex_overlap(self, a, b):
            raise RuntimeError("no hull")

        def observer(self, **_):
            return float("nan")

    rows = {row["case"]: row for row in run(CASES, [Wrong()])}
    assert [n for n, r in rows.items() if r["right"]] == ["touches_at_the_start"]
    assert rows["box_in_a_box"]["answer"] == "RuntimeError: no hull"
    assert rows["box_in_a_box"]["wrong"] == "failed"
    assert "impact_20_m_per_s" not in rows


def test_what_a_library_has_no_form_of_is_not_asked():
    class Few:
        name = "few"

        def convex_overlap(self, a, b):
            raise NotImplementedError

    assert run(CASES, [Few()]) == []


def test_verdicts_by_library():
    found = [("scene", "a", True), ("scene", "a", False), ("observer", "b", True)]
    rows = [{"kind": k, "library": name, "right": right} for k, name, right in found]
    assert by_library(rows) == [
        {"kind": "scene", "a": "1 of 2", "b": None},
        {"kind": "observer", "a": None, "b": "1 of 1"},
    ]


def test_what_is_wrong_of_ours_is_explained():
    assert {case.name for case in CASES if case.explained} == SOFT


def test_early_is_right_within_a_share_of_the_step_and_late_never():
    case = Case("c", "vertex_face", "here", "why", {}, {"toi": "1/2"})
    assert case.right(0.5)
    assert case.right(0.4999999)
    assert not case.right(0.4999)
    assert not case.right(0.5000001)
    assert not case.right(None)


@pytest.mark.parametrize(
    ("expected", "answer", "wrong"),
    [
        ({"toi": "1/2"}, None, "missed"),
        ({"toi": "1/2"}, 0.75, "late by 0.25"),
        ({"toi": "1/2"}, np.float32(0.25), "early by 0.25"),
        ({"toi": "1/2"}, float("nan"), "not a number"),
        ({"toi": None}, 0, "invented"),
        ({"overlap": True}, np.False_, "missed"),
        ({"overlap": False}, True, "invented"),
        ({"overlap": True}, np.True_, ""),
        ({"low": 0, "high": 1}, np.float32(2), "out of bounds"),
        ({"low": 0, "high": 1}, 1, ""),
    ],
)
def test_what_is_wrong_is_said(expected, answer, wrong):
    case = Case("c", "vertex_face", "here", "why", {}, expected)
    assert case.wrong(answer) == wrong
    assert case.right(answer) == (not wrong)


@pytest.mark.parametrize(
    ("expected", "answer"),
    [({"overlap": True}, 1), ({"toi": "1"}, True), ({"toi": "0"}, [0.0]), ({"low": 0}, None)],
)
def test_an_answer_of_another_type_is_no_answer(expected, answer):
    with pytest.raises(TypeError, match="expected"):
        Case("c", "vertex_face", "here", "why", {}, expected).wrong(answer)


def test_verdicts_part_what_lets_bodies_pass_from_what_is_too_cautious():
    said = ["", "missed", "late by 0.1", "early by 0.1", "invented", "failed", "out of bounds"]
    rows = [{"kind": "scene", "library": "a", "wrong": wrong} for wrong in said]
    (row,) = verdicts(rows)
    counts = {"right": 1, "missed_or_late": 2, "invented_or_early": 2, "other": 2}
    assert row == {"kind": "scene", "library": "a", "cases": 7, **counts}


OWN = """
class Right:
    name = "mine"

    def vertex_face(self, x_t0, x_t1):
        return None


class Misspelt:
    name = "misspelt"

    def vertex_faces(self, x_t0, x_t1):
        return None


class Asks:
    name = "asks"

    def __init__(self, model):
        pass
"""


def test_an_adapter_in_the_working_folder_is_found(tmp_path):
    (tmp_path / "my_adapters.py").write_text(OWN)

    def asked(name):
        command = [
            sys.executable,
            "-P",
            "-c",
            "import sys, tauguard.cli as c; c.main(sys.argv[1:])",
        ]
        command += ["hard-cases", "--case", "tight", "--adapter", f"my_adapters:{name}"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)

    assert "1      1" in asked("Right").stdout
    for name, said in (("Misspelt", "none of the methods"), ("Asks", "positional argument")):
        refused = asked(name)
        assert refused.returncode == 2
        assert said in refused.stderr


def test_plain_steps_pass_the_wall_that_the_guard_holds():
    case = next(case for case in CASES if case.name == "impact_20_m_per_s")
    answers = {r["library"]: r["right"] for r in run([case], adapters(("tauguard", "mujoco")))}
    assert answers == {"tauguard": True, "mujoco": False}
    assert mujoco.MjModel.from_xml_string(case.given["mjcf"]).opt.timestep == 0.002


def test_the_command_writes_rows(tmp_path, capsys):
    path = tmp_path / "rows.json"
    main(["hard-cases", "--adapter", "tauguard", "--case", "tight", "--json", str(path)])
    (row,) = json.loads(path.read_text())["rows"]
    assert {"case", "library", "expected", "answer", "right"} <= row.keys()
    assert row["expected"] == "no contact"
    assert row["right"] is True
    assert "tight_inclusion_1" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["nothing", "tauguard.hard_cases:Missing", "no_module:X"])
def test_an_adapter_that_is_none_is_refused(name):
    with pytest.raises(ValueError, match=name.split(":")[0]):
        adapters((name,))
