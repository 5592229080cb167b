"""Alarms of a file judged on a dataset: the truth's own onsets, and files that are wrong."""

import pytest

from tauguard.cli import main
from tauguard.datasets import read
from tauguard.datasets.alarm_files import judged_alarms, read_alarm_file
from tauguard.datasets.plans import BEGIN


def written(path, *lines):
    path.write_text("\n".join(("episode,start,end", *lines)) + "\n")
    return path


def test_alarms_at_every_onset_find_all_and_nothing_else(tiny, tmp_path):
    lines, collisions = [], 0
    for trace in read(tiny, ["test"]):
        for collision in trace.truth.collisions:
            collisions += collision.onset >= trace.t[0] + BEGIN
            lines.append(
                f"{trace.meta['episode']},{collision.onset + 0.02},{collision.onset + 0.1}"
            )
    [(split, matched)] = judged_alarms(tiny, written(tmp_path / "a.csv", *lines))
    delays = [delay for one in matched for delay in one.delays]
    assert split == "test"
    assert len(matched) == 2
    assert collisions > 0
    assert len(delays) == collisions
    assert delays == pytest.approx([0.02] * collisions)
    assert not any(one.false_alarms for one in matched)


def test_a_late_alarm_is_false_and_an_early_one_does_not_count(tiny, tmp_path):
    free = next(t for t in read(tiny, ["test"]) if not t.truth.collisions)
    name = free.meta["episode"]
    path = written(tmp_path / "a.csv", f"{name},1.0,1.1", f"{name},5.0,5.1", f"{name},5.25,5.4")
    [(_, matched)] = judged_alarms(tiny, path)
    assert sum(len(one.false_alarms) for one in matched) == 1


def test_alarms_less_than_a_fifth_of_a_second_apart_are_one(tmp_path):
    found = read_alarm_file(written(tmp_path / "a.csv", "x/0,2,2.5", "x/0,1,1.85", "x/0,2.75,3"))
    assert [(a.start, a.end) for a in found["x/0"]] == [(1.0, 2.5), (2.75, 3.0)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("episode,start\ntest/0,1\n", "columns episode, start; expected"),
        ("episode,start,end\ntest/0,2,1\n", "line 2: expected an episode and two times"),
        ("episode,start,end\ntest/0,nan,1\n", "line 2"),
        ("episode,start,end\ntest/0,1,2,3\n", "line 2"),
        ("episode,start,end\ntest/7,1,2\n", "no episode 'test/7'.*test/0 to test/1"),
        ("episode,start,end\ntrain/0,1,2\n", "no episode 'train/0'"),
        ("episode,start,end\n\xff", "expected an episode"),
    ],
)
def test_a_wrong_file_is_named(tiny, tmp_path, text, message):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        list(judged_alarms(tiny, path))


def test_the_command(tiny, tmp_path, capsys):
    path = written(tmp_path / "a.csv")
    main(["evaluate", "--data", str(tiny), "--alarms", str(path)])
    assert "2 recordings in test" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["evaluate", "--alarms", str(path)])
    assert "--alarms goes with --data" in capsys.readouterr().err
