"""Results of jobs that are kept: the same values come back, and nothing is done twice."""

from typing import NamedTuple

import numpy as np
import pytest

from studies import kept
from studies.detection.judge import Outcome, Tally
from studies.kept import Kept, read, write
from studies.workers import Workers
from tauguard.detectors import FreeScores
from tauguard.traces import Collision


def in_place(call, jobs):
    """A map that goes on after a job that raised, as that of a pool does."""
    return Each(call, iter(jobs))


class Pair(NamedTuple):
    low: int
    high: int


class Each:
    def __init__(self, call, jobs):
        self.call, self.jobs = call, jobs

    def __next__(self):
        return self.call(next(self.jobs))


def test_what_is_written_is_read(tmp_path):
    blow = Collision("strike", 1.0, 1.5, 3, np.zeros(3), np.ones(3), 5.0)
    value = {
        ("srq-svr", "1.6"): Tally([Outcome(4, 500.0, blow, None, -np.inf)], 3, 1, 1, 10.5),
        30.0: [FreeScores(np.arange(3.0), np.ones(3), 0.06), (1, "a", None, True)],
    }
    write(tmp_path / "a.npz", value)
    found = read(tmp_path / "a.npz")
    assert list(found) == list(value)
    tally = found["srq-svr", "1.6"]
    assert (tally.cases, tally.free_seconds) == (3, 10.5)
    assert tally.outcomes[0].delay is None
    assert tally.outcomes[0].peak == -np.inf
    np.testing.assert_array_equal(tally.outcomes[0].collision.force, np.ones(3))
    np.testing.assert_array_equal(found[30.0][0].peaks, np.arange(3.0))
    assert found[30.0][1] == (1, "a", None, True)
    with pytest.raises(ValueError, match="a set cannot be kept"):
        write(tmp_path / "b.npz", {1, 2})
    assert not (tmp_path / "b.npz").exists()
    with pytest.raises(ValueError, match="a Pair cannot be kept"):  # it would come back as a tuple
        write(tmp_path / "b.npz", Pair(1, 2))


def test_no_job_is_done_twice_and_one_that_fails_leaves_the_others(tmp_path):
    done = []

    def call(job):
        done.append(job)
        if job == 2 and len(done) < 4:
            raise ZeroDivisionError("two")
        return 10 * job

    first = Kept.of(str(tmp_path), "study", 0, "size")
    results = first.over(in_place, "part")(call, [1, 2, 3])
    assert next(results) == 10
    with pytest.raises(ZeroDivisionError):
        next(results)
    assert next(results) == 30
    assert list(first.over(in_place, "part")(call, [1, 2, 3])) == [10, 20, 30]
    assert done == [1, 2, 3, 2]
    other = Kept.of(str(tmp_path), "study", 0, "another size")
    assert list(other.over(in_place, "part")(call, [3])) == [30]
    assert len(done) == 5


def test_workers_write_and_a_damaged_file_is_named(tmp_path):
    own = Kept.of(str(tmp_path), "study", 7, "size")
    with Workers(2) as each:
        assert list(own.over(each, "part")(abs, [-1, -2])) == [1, 2]
    files = sorted(own.folder.glob("*.npz"))
    assert [read(path) for path in files] == [1, 2]
    files[0].write_bytes(files[0].read_bytes()[:-40])
    with pytest.raises(ValueError, match=r"part-000\.npz: damaged, or of another build: delete"):
        list(own.over(map, "part")(abs, [-1, -2]))


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="cannot be written"):
        Kept.of(str(tmp_path / "file"), "study", 0, "size")


def test_results_of_other_builds_and_versions_are_not_used(tmp_path, monkeypatch):
    folders = [Kept.of(str(tmp_path), "study", 0, "size").folder]
    monkeypatch.setattr(kept, "versions", lambda: {"tauguard": "0.0"})
    folders.append(Kept.of(str(tmp_path), "study", 0, "size").folder)
    monkeypatch.setattr(kept, "detection_sources", lambda: ("other",))
    folders.append(Kept.of(str(tmp_path), "study", 0, "size").folder)
    assert len(set(folders)) == 3
