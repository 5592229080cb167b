"""The study of environments: its peers do the same work, and its rows say what happened."""

import matplotlib.figure
import numpy as np
import pytest

from studies.simulation import environments
from studies.simulation.reactions import SPEEDS, reactions
from tauguard.report import table

KNOWN = {"contact": None, "observer": "observer"}


def test_the_bare_loop_makes_the_same_motion():
    env = environments.made(0)
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (60, 6)).astype(np.float32)
    forces, error = environments.recorded(env, actions, 0)
    assert forces.shape[0] == 600
    assert error == 0


@pytest.fixture(scope="module")
def rows():
    found = environments.steps(5, 1, 0) + environments.vectors(3, 1, 0)
    return found + reactions(1, 0, KNOWN)


def test_a_row_a_checker_and_a_reaction(rows):
    from tauguard.contacts import registered
    from tauguard.envs.adapters.reactions import REACTIONS

    whats = [row["what"] for row in rows if row["study"] == "step"]
    assert all(f"checker {name}" in whats for name in registered())
    swings = [row for row in rows if row["study"] == "reaction"]
    assert len(swings) == len(REACTIONS) * len(SPEEDS) * 2
    assert all(row["same_bits_as_sync"] in (True, None) for row in rows if row["study"] == "vector")


def test_stopping_beats_going_on(rows):
    for speed in SPEEDS:
        for known in KNOWN:
            peak = {
                row["reaction"]: row["peak_force_N"]["median"]
                for row in rows
                if row["study"] == "reaction"
                and (row["speed_m_s"], row["known_from"]) == (speed, known)
            }
            assert peak["stop0"] < peak["continue"]


def test_what_was_asked_is_answered(rows):
    asked = {row["what"]: row["measured"] for row in environments.answers(rows)}
    assert asked["vector environments with the bits of the single ones"] == "3 of 3"
    assert 0 < asked["a reaction's peak force over that of going on, worst"] < 1


def test_a_retraction_ends_behind_the_touch_and_a_stop_does_not(rows):
    ends = {
        row["reaction"]: row["end_m"]["high"]
        for row in rows
        if row["study"] == "reaction" and row["known_from"] == "contact"
    }
    assert ends["retract"] < -0.02 < ends["stop2"] < ends["continue"]


def test_table_and_figure(rows):
    assert "stop1" in table(rows)
    figure = matplotlib.figure.Figure()
    environments.draw(rows, figure)
    assert len(figure.axes) == 4
