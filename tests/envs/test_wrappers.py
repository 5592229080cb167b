"""Wrappers: a stop stops, a retraction lets go, a recording holds what happened."""

import gymnasium as gym
import numpy as np
import pytest

from oracles.reaction_swings import planned
from tauguard.envs.gym.sensing import ObserverListener
from tauguard.envs.wrappers import (
    REACTIONS,
    DetectorObservation,
    Reaction,
    RecordMcap,
    SpeedAndSeparation,
)
from tauguard.models import BodyProxy, cura6
from tauguard.traces import read_mcap

REACT = "tauguard/React-v1"


def swung(reaction, trigger="contact", speed=0.5, detector=None, seconds=2.0):
    """A swing into the chest with a reaction: rows of (time, force, q, qd)."""
    made = gym.make(REACT, detector=detector, disable_env_checker=True, max_episode_steps=10**6)
    env = Reaction(made, reaction, trigger)
    env.reset(seed=0)
    inner = env.unwrapped
    swing = planned(inner, speed) / inner.compiled.max_speed
    rows = []
    for step in range(round(seconds * 100)):
        action = swing[step] if step < len(swing) else np.zeros(6)
        observation, _, _, _, info = env.step(action)
        rows.append((info["time"], info["force"], observation.copy(), info["reacting"]))
    return rows


@pytest.fixture(scope="module")
def runs():
    return {reaction: swung(reaction) for reaction in REACTIONS}


def peak(rows):
    return max(row[1] for row in rows)


def test_every_reaction_begins_with_the_touch(runs):
    for rows in runs.values():
        first = next(i for i, row in enumerate(rows) if row[1] > 0)
        assert [row[3] for row in rows] == [i >= first for i in range(len(rows))]


def test_going_on_is_the_worst_and_goes_on(runs):
    assert all(peak(runs[name]) <= peak(runs["continue"]) for name in REACTIONS)
    ends = {name: rows[-1][2][19] for name, rows in runs.items()}
    assert all(ends["continue"] > ends[name] + 0.1 for name in REACTIONS if name != "continue")


@pytest.mark.parametrize("name", ["stop0", "stop1", "stop2"])
def test_a_stop_ends_at_rest_and_stays(runs, name):
    last = [row[2] for row in runs[name][-20:]]
    assert np.abs(np.array(last)[:, 6:12]).max() < 0.01
    # Brakes and servo hold the arm against gravity: less than a millimetre in 0.2 s.
    assert np.abs(last[-1][18:21] - last[0][18:21]).max() < 1e-3


def test_no_current_flows_after_stops_0_and_1_and_some_after_2(runs):
    for name in ("stop0", "stop1"):
        assert np.abs(runs[name][-1][2][12:18]).max() < 1e-6
    assert np.abs(runs["stop2"][-1][2][12:18]).max() > 5


def test_a_retraction_lets_go_and_comes_back(runs):
    stop, back = runs["stop2"][-1][2][19], runs["retract"][-1][2][19]
    assert back < stop - 0.01
    assert runs["retract"][-1][1] == 0


def test_an_admittance_is_the_gentlest_of_those_that_keep_power(runs):
    assert peak(runs["admittance"]) < min(peak(runs["stop1"]), peak(runs["stop2"]))


def test_waiting_for_the_alarm_costs_force():
    late = swung("stop0", "alarm", detector="observer")
    soon = swung("stop0", "contact", detector="observer")
    first = {
        name: next(row[0] for row in rows if row[3]) for name, rows in (("a", late), ("c", soon))
    }
    assert 0 < first["a"] - first["c"] < 0.1
    assert peak(soon) < peak(late)


def test_a_stop_in_free_motion_takes_the_time_of_its_deceleration():
    proxy = BodyProxy("hand", position=(0.0, 3.0, 0.5))
    env = Reaction(
        gym.make("tauguard/Reach-v0", obstacles=(proxy,), ideal_drive=True), "stop2", "contact"
    )
    env.reset(seed=0)
    inner = env.unwrapped
    for _ in range(80):
        observation = env.step(np.array([0.5, 0, 0, 0, 0, 0]))[0]
    speed = observation[6]
    inner.batch.metrics["force"][0] = 1.0
    inner.rules.look(0)
    taken = 0
    while abs(observation[6]) > 0.02 * speed:
        observation = env.step(np.zeros(6))[0]
        taken += 1
    ideal = speed / cura6.MAX_ACCELERATION[0]
    lag = 4 / 30  # the servo's bandwidth is 30 rad/s, critically damped
    assert ideal - 0.01 <= taken * 0.01 <= ideal + lag
    assert inner.compiled.max_speed[0] * 0.45 < speed


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"reaction": "panic", "trigger": "contact"}, "stop0"),
        ({"reaction": "stop2", "trigger": "never"}, "contact"),
        ({"reaction": "stop2", "trigger": "alarm"}, "detector="),
    ],
)
def test_reactions_that_cannot_be(keywords, words):
    with pytest.raises(ValueError, match=words):
        Reaction(gym.make(REACT), **keywords)


def test_foreign_environments_are_refused():
    with pytest.raises(ValueError, match="tauguard"):
        Reaction(gym.make("CartPole-v1"), "stop2", "contact")


def test_the_detector_speaks_in_the_observation():
    env = DetectorObservation(gym.make(REACT), "observer")
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation.shape == (30 + 7,)
    observation, _, _, _, info = env.step(np.zeros(6))
    assert np.array_equal(observation[30:36], info["residual"])
    assert observation[36] == info["alarm"]
    assert np.abs(info["residual"]).max() > 0
    with pytest.raises(ValueError, match="observer"):
        DetectorObservation(gym.make(REACT))


def test_the_separation_monitor_lets_nobody_meet_a_moving_arm():
    proxy = BodyProxy("hand", position=(0.36, 0.4, 0.75), direction=(0.0, -1.0, 0.0))
    results = {}
    for guarded in (False, True):
        env = gym.make("tauguard/Reach-v0", obstacles=(proxy,))
        env = SpeedAndSeparation(env) if guarded else env
        env.reset(seed=0)
        inner = env.unwrapped
        data, model = inner.batch.datas[0], inner.compiled.scene.model
        data.qpos[model.joint("hand").qposadr[0]] = -0.6
        data.qvel[model.joint("hand").dofadr[0]] = 0.8
        stopped = separations = 0
        speed_at_touch = None
        for _ in range(300):
            action = np.array([0.1, 0, 0, 0, 0, 0])
            info = env.step(action)[4]
            if guarded:
                stopped += info["stopped"]
                separations += info["separation"] < info["protective_distance"]
            if info["onset"] and speed_at_touch is None:
                speed_at_touch = float(inner.batch.metrics["speed_ratio"][0])
        results[guarded] = speed_at_touch
        if guarded:
            assert stopped > 0
            assert separations > 0
    assert results[False] is not None
    assert results[False] > 0.08
    assert results[True] is None or results[True] < 0.02


def test_the_monitor_needs_somebody_to_keep_away_from():
    with pytest.raises(ValueError, match="body regions"):
        SpeedAndSeparation(gym.make("tauguard/Reach-v0", obstacles=()))
    with pytest.raises(ValueError, match="reaction_time"):
        SpeedAndSeparation(gym.make("tauguard/Reach-v0"), reaction_time=-1)


def test_a_recording_holds_what_the_environment_said(tmp_path):
    env = RecordMcap(gym.make(REACT, detector="observer"), tmp_path / "runs")
    env.reset(seed=7)
    inner = env.unwrapped
    swing = planned(inner, 0.2)[:220] / inner.compiled.max_speed
    infos = [env.step(action)[4] for action in swing]
    env.reset(seed=8)
    env.step(np.zeros(6))
    env.close()
    assert [path.name for path in env.files] == ["episode_00000.mcap", "episode_00001.mcap"]
    trace = read_mcap(env.files[0])
    detection = trace.detection
    assert len(trace.t) == 10 * len(swing)
    assert trace.meta["seed"] == "7"
    assert trace.meta["environment"] == REACT
    last = trace.truth.tau_ext[9::10]
    assert np.array_equal(last, [info["tau_ext"] for info in infos])
    blocks = trace.truth.contact_force.reshape(-1, 10).max(axis=1)
    # The whole arm's force and the strongest link's are one where one link is touched.
    assert blocks == pytest.approx([info["force"] for info in infos], rel=1e-9)
    first = next(info for info in infos if info["onset"])
    assert trace.truth.collisions[0].onset == pytest.approx(first["onset_time"])
    assert trace.truth.collisions[0].link == 6
    assert trace.truth.obstacle_names == ("chest",)
    moved = trace.truth.obstacle_poses[:, 0, 1, 3]
    assert moved[-1] > moved[0] + 0.001
    assert detection.alarms
    alarm = detection.alarm.reshape(-1, 10).any(axis=1)
    assert alarm.tolist() == [info["alarm"] for info in infos]


def test_the_observer_judges_a_block_as_it_judges_sample_by_sample():
    env = gym.make("tauguard/Reach-v0", detector="observer").unwrapped
    env.reset(seed=1)
    block = env.batch.sensing[0].detector
    single = ObserverListener(block._observer.robot, block._drive, 1e-3)
    rng = np.random.default_rng(0)
    for _ in range(20):
        env.step(rng.uniform(-1, 1, 6))
        measured = env.batch.sensing[0].measured
        for row, sample in enumerate(zip(*measured, strict=True)):
            residual, alarm = single.steps(*(x[None] for x in sample))
            assert alarm == env.batch.sensing[0].alarms[row]
            assert np.array_equal(residual[0], env.batch.sensing[0].residuals[row])
