"""The detector as a whole: what it finds, online as in batch, its file."""

import zipfile

import numpy as np
import pytest
import skops.io
from scipy.spatial.distance import pdist

from tauguard.detectors import (
    CollisionDetector,
    DetectorSettings,
    figures,
    judge,
)


def test_it_finds_collisions_on_unseen_motions_with_unknown_payloads(detector, unseen):
    matchings = [judge(detector.detect(trace), trace, skip=3.0) for trace in unseen]
    out = figures(matchings)
    assert out["headline"]["sensitivity"]["n"] >= 6
    assert out["headline"]["sensitivity"]["value"] >= 0.85
    assert out["specificity"]["value"] >= 0.6
    assert out["headline"]["delay_ms"]["median"] < 20


def test_online_equals_batch(detector, unseen):
    trace = unseen[0]
    batch = detector.detect(trace)
    detector.reset()
    rows = 12_000
    score, alarm = np.empty(rows), np.empty(rows, bool)
    for k in range(rows):
        dt = trace.t[k] - trace.t[k - 1] if k else None
        alarm[k] = detector.step(trace.q[k], trace.qd[k], trace.current[k], dt)
        score[k] = detector.score
    np.testing.assert_allclose(score, batch.score[:rows], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(alarm, batch.alarm[:rows])
    assert alarm.any()


def test_the_file_holds_nothing_to_distrust_and_gives_equal_results(detector, unseen, tmp_path):
    path = tmp_path / "model.skops"
    detector.save(path)
    assert skops.io.get_untrusted_types(file=path) == []
    assert [p.name for p in tmp_path.iterdir()] == ["model.skops"]
    again = CollisionDetector.load(path)
    one, two = detector.detect(unseen[1]), again.detect(unseen[1])
    assert one.score.tobytes() == two.score.tobytes()
    assert one.alarms == two.alarms
    assert again.settings == detector.settings


def test_damaged_and_foreign_files_are_one_line(detector, tmp_path):
    whole = tmp_path / "model.skops"
    detector.save(whole)
    data = whole.read_bytes()
    bad = tmp_path / "bad.skops"
    for content in (b"", data[:100], data[: len(data) // 2], data[:-30], b"hello"):
        bad.write_bytes(content)
        with pytest.raises(ValueError, match=r"bad\.skops") as error:
            CollisionDetector.load(bad)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"none\.skops: cannot be read"):
        CollisionDetector.load(tmp_path / "none.skops")
    skops.io.dump({"a": np.zeros(3)}, bad)
    with pytest.raises(ValueError, match="not a detector file of this version"):
        CollisionDetector.load(bad)
    skops.io.dump({"format": "tauguard detector 1"}, bad)
    with pytest.raises(ValueError, match="with a part missing"):
        CollisionDetector.load(bad)
    with zipfile.ZipFile(bad, "w") as archive:
        archive.writestr("other.txt", "x")
    with pytest.raises(ValueError, match="not a detector file"):
        CollisionDetector.load(bad)


def test_an_unwritable_place_is_named(detector, tmp_path):
    with pytest.raises(ValueError, match="cannot be written"):
        detector.save(tmp_path / "no" / "model.skops")


def test_the_plain_form_is_the_dissertations(training, robot, drive_gain):
    settings = DetectorSettings.plain_form(windows=600)
    plain = CollisionDetector(settings).fit(training, robot, drive_gain)
    literal = DetectorSettings.plain_form(windows=600, distance=0.0)
    raw = CollisionDetector(literal).fit(training, robot, drive_gain)
    for one in (plain, raw):
        assert one.features.envelope is None
        assert one.arm.friction is None
        assert one.features.size == 44
    assert raw.features.factor == 1.0
    # In N m nearly every window stands alone in the kernel's length of 3; one factor mends that.
    assert len(raw.regressor.support_vectors_) > 0.6 * 600
    gaps = pdist(raw.regressor.support_vectors_ * plain.features.factor)
    assert 0.5 * settings.sigma < np.median(gaps) < 2 * settings.sigma
    assert np.median(gaps) / plain.features.factor > 5 * settings.sigma


def test_same_seed_same_detector(training, robot, drive_gain, unseen):
    settings = DetectorSettings(windows=300, mined=0)
    two = [CollisionDetector(settings).fit(training, robot, drive_gain) for _ in range(2)]
    assert two[0].threshold == two[1].threshold
    assert two[0].detect(unseen[0]).score.tobytes() == two[1].detect(unseen[0]).score.tobytes()


def test_bad_input(detector, training, robot, drive_gain, unseen):
    with pytest.raises(ValueError, match="not fitted"):
        CollisionDetector().detect(unseen[0])
    with pytest.raises(ValueError, match="no traces"):
        CollisionDetector().fit([], robot, drive_gain)
    with pytest.raises(ValueError, match=r"joints \(7,\): expected some of 1 to 6"):
        CollisionDetector(DetectorSettings(joints=(7,))).fit(training, robot, drive_gain)
    free = [t for t in training if not t.truth.collisions]
    with pytest.raises(ValueError, match="hold no collision"):
        CollisionDetector().fit(free[:3], robot, drive_gain)
    with pytest.raises(ValueError, match=r"drive_gain: shape \(2,\)"):
        CollisionDetector().fit(training, robot, drive_gain[:2])
    with pytest.raises(ValueError, match="float64 arrays"):
        detector.step(unseen[0].q[:1], unseen[0].qd[0], unseen[0].current[0])
    detector.reset()


def test_another_rate_is_refused(detector, unseen):
    from dataclasses import replace

    slow = replace(unseen[0], t=unseen[0].t * 10, truth=None)
    with pytest.raises(ValueError, match="trained at 1 ms: resample the recording"):
        detector.detect(slow)
