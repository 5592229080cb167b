"""Threshold laws on arms whose rates are known, and a run that is broken off and goes on."""

from dataclasses import replace

import numpy as np
import pytest

from studies.detection import arm_scores, false_alarms, pool
from studies.detection.arm_scores import Arm, Blow, Extent
from studies.detection.fleet import Training
from studies.detection.known_tails import TAILS
from studies.detection.threshold_laws import LAWS, judged, price_row, rate_row
from studies.framework.jobs import read
from tauguard.detectors import FreeScores
from tauguard.detectors.thresholds.speed_levels import SpeedLevels
from tauguard.envs import Episode, simulate
from tauguard.report import table

LEVELS = SpeedLevels(np.array([0.0]), np.array([0.0]), np.array([1.0]))
T = np.arange(-500, 501) * 1e-3


def blow(level, peak_tau=20.0):
    return Blow(peak_tau, T, np.asarray(level, dtype=float), np.ones(len(T)))


@pytest.mark.parametrize(
    ("up", "delay"),
    [
        ((T >= 0.02) & (T < 0.1), 0.02),
        (T >= 0.6, None),  # not within the window
        (T > -2, None),  # up already at the touch
        (((T > -0.3) & (T < -0.2)) | (T > 0.05), None),  # one alarm with that before the touch
        ((T > -0.5) & (T < -0.45) | (T >= 0.1), 0.1),
    ],
)
def test_a_collision_is_found_as_everywhere(up, delay):
    found = blow(up * 10.0).delay(LEVELS, 5.0)
    assert found == (None if delay is None else pytest.approx(delay))


def arm(rng, seed):
    def episodes(count):
        return [
            FreeScores(np.repeat(rng.exponential(size=120), 25), np.ones(3000), 60.0)
            for _ in range(count)
        ]

    strong = [blow((T >= 0.01) * 1e6, 20.0), blow((T >= 0.01) * 1e-6, 5.0)]
    return Arm(seed, {"d": episodes(20)}, {"d": episodes(20)}, {"d": strong})


def test_a_law_is_judged_by_what_fresh_motion_gives_and_by_what_it_finds():
    rng = np.random.default_rng(0)
    arms = [arm(rng, k) for k in range(3)]
    rows = {}
    for law in LAWS:
        case = judged(arms, "d", law, 30.0)
        rows[law] = rate_row(case, "all", case.arms)
        price = price_row(case, "all", case.arms)
        assert (price["sensitivity"]["value"], price["sensitivity_all"]["value"]) == (1.0, 0.5)
        assert price["delay_ms"] == pytest.approx(10.0)
    row = rows["mean over draws"]
    assert row["found_per_hour"]["low"] < 30 < row["found_per_hour"]["high"]
    assert row["found_per_hour"]["hours"] == pytest.approx(1.0)
    assert 3 * row["alarms_an_arm"]["low"] <= row["found_per_hour"]["n"]
    assert 3 * row["alarms_an_arm"]["high"] >= row["found_per_hour"]["n"]
    assert (row["kept"]["value"], row["inside"]["value"], row["kept"]["n"]) == (1.0, 1.0, 3)
    assert rows["80 % bound"]["found_per_hour"]["value"] <= row["found_per_hour"]["value"]


@pytest.mark.parametrize("name", TAILS)
def test_known_rates_are_those_of_what_is_drawn(name):
    tail, rng = TAILS[name], np.random.default_rng(0)
    drawn = np.concatenate([tail.draw(rng) for _ in range(40)])
    hours = drawn.size / 7200
    for threshold in (1.0, 2.0, 4.0):
        counted = np.sum(drawn > threshold) / hours
        assert counted == pytest.approx(tail.rate(threshold), rel=0.25, abs=2.0)


def test_every_arm_is_struck_in_its_own_episodes_and_with_several_payloads(monkeypatch):
    made = {5: [], 6: []}
    nothing = simulate(Episode(seed=1, seconds=0.1))

    def struck(episode, without):
        assert not without
        made[episode.mismatch.seed].append(episode)
        return nothing

    monkeypatch.setattr(pool, "simulate", struck)
    monkeypatch.setattr(arm_scores, "_free", lambda *_: {})
    extent = Extent((), Training(), 0.0, 0.0, 1)
    for seed in made:
        arm_scores.scored(extent, 0, seed, {})
    assert not {e.seed for e in made[5]} & {e.seed for e in made[6]}
    first = made[5][:: pool.ROUNDS]  # of each speed: nothing was struck, so all rounds are drawn
    assert [e.speed for e in first] == list(pool.SPEEDS)
    assert {e.payload_g for e in first} == set(pool.PAYLOADS)


def test_arms_are_kept_and_not_made_again(tmp_path, monkeypatch):
    little = Training(slices=1, collisions=1, free=1, free_seconds=8.0)
    extent = Extent(("moving-thresholds",), little, 0.001, 0.001, 0)
    monkeypatch.setattr(false_alarms, "NAMES", extent.names)
    monkeypatch.setattr(arm_scores, "SPEEDS", (60.0,))  # an episode of a minute each
    size = replace(false_alarms.QUICK, arms=1, extent=extent, calibrations=2)
    monkeypatch.setattr(false_alarms, "QUICK", size)
    monkeypatch.setattr(false_alarms, "KNOWN", 1)
    (one,) = false_alarms.arms_of(size, 3, 1, str(tmp_path))
    (path,) = tmp_path.rglob("*.npz")
    assert read(path).seed == one.seed
    monkeypatch.setattr(false_alarms, "arm_scores", None)
    rows = false_alarms.measure(True, 3, str(tmp_path))
    assert {row["study"] for row in rows} == {"arms", "known"}
    assert "usual tail" in table(rows, notes=false_alarms.NOTES)
    figure = pytest.importorskip("matplotlib.figure").Figure()
    false_alarms.draw(rows, figure)
