"""Planned episodes and their generation: in order, resumable, equal for any number of workers."""

import re

import numpy as np
import pytest

from tauguard.datasets import (
    collision_plans,
    demo_plan,
    free_episodes,
    simulate_all,
    struck_episodes,
    write_dataset,
)
from tauguard.datasets.recordings import labelled
from tauguard.traces import STRATA, read_mcap


@pytest.fixture(scope="module")
def episodes():
    return free_episodes(3, 3, 1.5, (20.0, 60.0), (0.0, 2000.0))


def test_plans_are_spread_over_kinds_links_and_strata():
    plans = collision_plans(np.random.default_rng(1), 40)
    assert sum(p.kind == "strike" for p in plans) == 20
    assert sum(p.kind == "clamp" for p in plans) == 10
    assert {p.link for p in plans} == {2, 3, 4, 5, 6}
    for stratum in STRATA:
        assert sum(p.severity == stratum for p in plans) == 8
    times = [p.time for p in plans]
    assert (np.diff(times) > 2.5).all()


def test_the_demo_shares_no_seed_between_training_and_judging():
    plan = demo_plan(7)
    judged = {e.seed for e in (*plan.judge_struck, *plan.judge_free, plan.showcase)}
    assert not judged & {e.seed for e in plan.train}
    assert len({e.mismatch for e in (*plan.train, *plan.judge_free)}) == 1
    assert sum(len(e.collisions) for e in plan.judge_struck) >= 60
    assert sum(e.seconds for e in plan.judge_free) >= 600
    assert demo_plan(7) == plan
    assert demo_plan(8) != plan


def test_speeds_and_payloads_are_gone_through_in_turn():
    planned = struck_episodes(1, 4, 2, (10.0, 30.0), (0.0, 500.0, 1000.0))
    assert [e.speed for e in planned] == [10, 30, 10, 30]
    assert [e.payload_g for e in planned] == [0, 500, 1000, 0]


def test_workers_change_nothing(episodes):
    one = list(simulate_all(episodes, workers=1))
    two = list(simulate_all(episodes, workers=2))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.current, b.current)
        assert a.meta == b.meta


def test_a_second_run_continues_and_keeps_whole_files(episodes, tmp_path):
    write_dataset(episodes[:1], tmp_path, workers=1)
    (first,) = tmp_path.iterdir()
    before = first.stat().st_mtime_ns, first.read_bytes()
    paths = write_dataset(episodes, tmp_path, workers=1)
    assert (first.stat().st_mtime_ns, first.read_bytes()) == before
    assert [re.sub("[0-9a-f]{6}[.]", "*.", p.name) for p in paths] == [
        f"{'episode' if e.collisions else 'free'}-0000{i}-*.mcap" for i, e in enumerate(episodes)
    ]
    trace = read_mcap(paths[2])
    assert trace.meta["config_sha256"] == episodes[2].config_hash


def test_another_datasets_files_are_not_overwritten(episodes, tmp_path):
    (first,) = write_dataset(episodes[:1], tmp_path, workers=1)
    before = first.read_bytes()
    (second,) = write_dataset(episodes[1:2], tmp_path, workers=1)
    assert second != first
    assert first.read_bytes() == before


def test_a_file_under_its_earlier_name_is_kept_and_folders_are_read_whole(episodes, tmp_path):
    (path,) = write_dataset(episodes[:1], tmp_path, workers=1)
    old = path.rename(tmp_path / "episode-00000.mcap")
    assert write_dataset(episodes[:1], tmp_path, workers=1) == [old]
    (tmp_path / "below").mkdir()
    old.rename(tmp_path / "below" / "a.mcap")
    write_dataset(episodes[1:2], tmp_path, workers=1)
    assert next(trace.meta["log"] for trace in labelled(tmp_path)) == "below/a.mcap"


def test_checkers_write_their_contacts_and_are_part_of_what_a_file_is(episodes, tmp_path):
    (path,) = write_dataset(episodes[:1], tmp_path, workers=1, checkers=["mujoco", "rigid"])
    trace = read_mcap(path)
    assert [one.checker for one in trace.contacts] == ["mujoco", "rigid"]
    before = path.read_bytes()
    write_dataset(episodes[:1], tmp_path, workers=1, checkers=["mujoco", "rigid"])
    with pytest.raises(ValueError, match="holds contacts of mujoco, rigid, not of no checker"):
        write_dataset(episodes[:1], tmp_path, workers=1)
    assert path.read_bytes() == before


def test_an_unknown_checker_is_named_before_anything_is_written(episodes, tmp_path):
    with pytest.raises(ValueError, match=r"'rigidd': expected some of mujoco, cloth, rigid"):
        write_dataset(episodes[:1], tmp_path / "new", workers=1, checkers=["rigidd"])
    assert not (tmp_path / "new").exists()
