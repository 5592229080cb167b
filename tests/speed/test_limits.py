"""Permissible speeds along whole programs."""

import csv
import json

import numpy as np
import pytest

import tauguard
from tauguard.cli import main
from tauguard.envs.episodes.motions import point_to_point
from tauguard.findings import ArgumentError, FileError, MismatchError
from tauguard.models import BODY_REGIONS, read_regions
from tauguard.speed import Program, SpeedOptions, Stop, read_waypoints
from tauguard.speed.contact import Integration

QUICK = SpeedOptions(
    interval=0.3, coarse=6, fine=2, simulated=4, points=2, integration=Integration(step=1e-3)
)


@pytest.fixture(scope="module")
def program():
    home = np.array([0.0, -1.2, 1.5, -1.0, -1.5, 0.0])
    far = home + np.array([0.8, 0.3, -0.4, 0.2, 0.0, 0.3])
    motion = point_to_point([home, far, home], [1.2, 1.2], [0.0, 1.0, 0.0], 0.01)
    names = tuple(f"joint_{k}" for k in range(1, 7))
    return Program("move", names, motion.t, motion.q, motion.qd)


REGIONS = {name: BODY_REGIONS[name] for name in ("skull", "chest", "hand")}


@pytest.fixture(scope="module")
def late(program):
    return tauguard.speed_limits(program, "ur5e", delay=0.05, regions=REGIONS, options=QUICK)


def by_key(result):
    return {(limit.segment, limit.region): limit for limit in result.limits}


def test_every_segment_and_region_has_a_limit(program, late):
    assert [round(start, 1) for start, _ in late.segments] == [0.0, 2.2]
    assert set(by_key(late)) == {(n, name) for n in (1, 2) for name in ("chest", "hand")}
    assert all(limit.force > 0 for limit in late.limits)
    assert late.slow_down().keys() <= {1, 2}


def test_binding_cases_stay_at_their_limits_in_mujoco(late):
    ratios = [limit.simulated for limit in late.limits if np.isfinite(limit.simulated)]
    assert len(ratios) == QUICK.simulated
    assert min(ratios) > 0.5
    assert max(ratios) < 1.05


def test_an_earlier_stop_a_margin_and_a_free_region(program, late):
    options = SpeedOptions(**{**vars(QUICK), "simulated": 0})

    def limits(**changes):
        made = tauguard.speed_limits(
            program,
            "ur5e",
            regions=REGIONS,
            options=options,
            check=False,
            **{"delay": 0.05, **changes},
        )
        return by_key(made)

    reference = by_key(late)
    for key, limit in limits(delay=0.005).items():
        assert limit.permissible >= reference[key].permissible * 0.999, key
    for key, limit in limits(delay=None).items():
        assert limit.permissible == pytest.approx(limit.undetected, abs=QUICK.slowest)
        assert limit.permissible <= reference[key].permissible * 1.001
        assert np.isinf(limit.delay)
    free = limits(contact={"chest": "free"}, person_speed=0.2, margin=1.2, cover="5:20")
    assert free[1, "hand"].free > reference[1, "hand"].free  # the cover is softer than a hand
    assert free[1, "chest"].permissible > reference[1, "chest"].permissible


def test_peak_of_a_free_contact_is_the_standards_formula(program):
    options = SpeedOptions(**{**vars(QUICK), "simulated": 0})
    free = dict.fromkeys(REGIONS, "free")
    made = tauguard.speed_limits(
        program,
        "ur5e",
        contact=free,
        tool="flat:100",
        delay=0.0,
        regions=REGIONS,
        options=options,
        check=False,
    )
    for limit in made.limits:
        region = BODY_REGIONS[limit.region]
        bound = region.speed_limit(limit.mass)  # along the contact's normal
        assert limit.free >= bound * 0.999, limit  # the point's speed has other directions too


def test_the_text_leads_with_what_is_assumed(late):
    lines = str(late).splitlines()
    assert "ur5e" in lines[0]
    assert "2 segments" in lines[0]
    assert any("rotor inertia" in line for line in lines[1:3]) or "given" in str(late.findings)
    assert any(line.startswith("reaction: delay 50 ms, given") for line in lines)
    assert lines[-1].startswith("Estimates")
    assert json.loads(json.dumps(late.to_dict()))["segments"][0][0] < 0.1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"delay": -1.0}, "delay"),
        ({"delay": 0.1, "detector": object()}, "not both"),
        ({"margin": 0.5}, "margin"),
        ({"person_speed": np.nan}, "person_speed"),
        ({"contact": {"hand": "held"}}, "hand=held"),
        ({"contact": {"nose": "free"}}, "nose"),
        ({"tool": "needle"}, "flat"),
        ({"detector": object()}, "delay="),
    ],
)
def test_bad_arguments(program, arguments, message):
    with pytest.raises(ArgumentError, match=message):
        tauguard.speed_limits(program, "ur5e", **arguments)


def test_a_program_of_another_arm(program):
    short = Program("five", program.joint_names[:5], program.t, program.q[:, :5], program.qd[:, :5])
    with pytest.raises(MismatchError, match="5 joints"):
        tauguard.speed_limits(short, "ur5e")


def test_programs_are_checked():
    with pytest.raises(ArgumentError, match="increase"):
        Program("p", ("a",), np.zeros(3), np.zeros((3, 1)), np.zeros((3, 1)))
    with pytest.raises(ArgumentError, match="row 1"):
        Program("p", ("a",), np.arange(3.0), np.array([[0], [np.nan], [0]]), np.zeros((3, 1)))
    with pytest.raises(ArgumentError, match="times"):
        Program.from_waypoints([0, 0], [[0.0], [1.0]])


def test_limits_of_ones_own(tmp_path):
    file = tmp_path / "limits.toml"
    file.write_text("[hand]\nquasi_static_force = 70\n")
    regions = read_regions(file)
    assert regions["hand"].transient_force == 140
    assert regions["chest"] == BODY_REGIONS["chest"]
    for text in ("[nose]\nmass = 1\n", "[hand]\nweight = 1\n", "[hand]\nmass = 0\n"):
        file.write_text(text)
        with pytest.raises(ArgumentError, match="expected"):
            read_regions(file)
    file.write_text("[hand")
    with pytest.raises(FileError, match=r"limits\.toml"):
        read_regions(file)


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    waypoints = tmp_path / "move.csv"
    waypoints.write_text("t,q1,q2,q3,q4,q5,q6\n0,0,-1.2,1.5,-1,-1.5,0\n1,.6,-1,1.3,-1,-1.5,0\n")
    assert read_waypoints(waypoints).seconds == pytest.approx(0.99)
    files = {name: tmp_path / f"out.{name}" for name in ("json", "csv", "html", "png")}
    arguments = ["--json", files["json"], "--table", files["csv"], "--report", files["html"]]
    arguments += ["--picture", files["png"], "--delay", "0.05", "--no-check"]
    main(["speed", str(waypoints), "--robot", "ur5e", *map(str, arguments)])
    printed = capsys.readouterr().out
    result = json.loads(files["json"].read_text())
    with files["csv"].open() as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == len(result["rows"]) == 10
    assert "slow down" in printed
    assert "<svg" in files["html"].read_text()
    assert files["png"].stat().st_size > 5000


def test_stops_print_what_they_do():
    assert str(Stop(0)) == "stop 0, brakes after 20 ms"
    assert "from the measured speed" in str(Stop(2, start="measured"))
