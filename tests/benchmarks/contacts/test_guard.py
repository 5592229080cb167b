"""The guard's study: what it calls held, and which fixed step it compares with."""

import mujoco
import pytest
from matplotlib.figure import Figure

from tauguard.benchmarks.contacts import guard
from tauguard.contacts.scenes import ball_cloth, sphere_plate


def test_plain_steps_lose_what_guarded_steps_hold():
    for build in (ball_cloth, sphere_plate):
        plain = guard.one(build(50.0, 0.1), 50.0, 0.1, 5e-3, 0)
        guarded = guard.one(build(50.0, 0.1), 50.0, 0.1, 5e-3, 1)
        assert not plain.held
        assert not plain.generated
        assert plain.velocity == pytest.approx(-50)
        assert guarded.held
        assert guarded.generated
        assert guarded.velocity > -1
        assert guarded.cuts > 0 == guarded.exhausted


def test_the_side_turns_where_the_centre_crosses_the_sheet():
    model, data = ball_cloth().start()
    scratch = mujoco.MjData(model)
    sides = {}
    for height in (0.1, 1e-4, -1e-4, -0.1):
        data.qpos[-5] = height
        sides[height] = guard.side(model, data, scratch)
    assert sides[0.1] == sides[1e-4] == -sides[-1e-4] == -sides[-0.1] != 0


def row(method, timestep, held, ms):
    return {
        "study": "ball_cloth",
        "contact": "stiff",
        "speed": 1.0,
        "method": method,
        "timestep_ms": timestep,
        "held": {"value": held},
        "ms": {"median": ms},
        "error": {"median": 0.1},
    }


def test_a_step_that_holds_by_luck_is_not_the_first_that_holds():
    rows = [row("plain", 5, 1.0, 1), row("plain", 2, 0.5, 2), row("plain", 1, 1.0, 4)]
    rows += [row("plain", 0.5, 1.0, 8), row("guarded", 5, 1.0, 2)]
    guard.with_ratio(rows)
    assert {r["first_fixed_ms"] for r in rows} == {1}
    assert rows[-1]["saves"] == 2
    figure = Figure()
    guard.draw(rows, figure)
    assert len(figure.axes) == 1


def test_nothing_to_compare_with_where_no_fixed_step_holds():
    rows = guard.with_ratio([row("plain", 1, 0.9, 1), row("guarded", 1, 1.0, 1)])
    assert rows[1]["saves"] is None
