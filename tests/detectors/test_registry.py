"""Every detector of the table keeps the shared contract."""

import dataclasses
import json
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest
import skops.io

from tauguard.detectors import ArmModel, CollisionDetector, calibrate
from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.features import front_end
from tauguard.detectors.methods import pipeline
from tauguard.detectors.ranking_file import FORMAT, load_model, save_model
from tauguard.detectors.registry import DETECTORS, make_detector
from tauguard.detectors.thresholds.speed_levels import Levelled, SpeedLevels
from tauguard.detectors.thresholds.thresholded import Thresholded
from tauguard.traces import Trace


@pytest.fixture(scope="module")
def arm(robot, drive_gain):
    return ArmModel(robot, drive_gain)


SMALLER = {
    "windows": 2000,
    "mined": 200,
    "epochs": 15,
    "rows": 6000,
    "trees": 20,
}


def small(name):
    """The detector with less training, so that the tests are quick."""
    detector = make_detector(name)
    if name.startswith("srq-svr"):
        settings = detector.chain.settings
        less = dataclasses.replace(settings, windows=800, mined=min(settings.mined, 100))
        detector.chain = CollisionDetector(less)
    for field, value in SMALLER.items():
        if hasattr(detector, field):
            setattr(detector, field, value)
    return detector


@pytest.fixture(scope="module")
def some(training):
    """A free trace at each speed, and two with collisions."""
    return [*training[:3], *training[9:11]]


@pytest.fixture(scope="module")
def identified(some, arm):
    """One identification for all: what it finds is tested where it belongs."""
    return calibrate(arm, some)


@pytest.fixture(scope="module", params=list(DETECTORS))
def fitted(request, some, arm, identified):
    with pytest.MonkeyPatch.context() as patch:
        for module in (front_end, pipeline):
            patch.setattr(module, "calibrate", lambda *_, **__: identified)
        return small(request.param).fit(some, arm)


def first(trace, rows):
    tables = ("t", "q", "qd", "current", "q_des", "qd_des", "qdd_des")
    cut = {name: getattr(trace, name)[:rows] for name in tables}
    return dataclasses.replace(trace, **cut, truth=None)


def test_the_table_names_its_detectors():
    for name in DETECTORS:
        detector = make_detector(name)
        assert detector.name == name
    with pytest.raises(ValueError, match="did you mean 'srq-svr'"):
        make_detector("srq-svm")


def test_scores_are_finite_and_causal(fitted, unseen):
    trace = first(unseen[0], 6_000)
    score = fitted.scores(trace)
    assert score.shape == trace.t.shape
    assert np.isfinite(score).all()
    rows = 4_500
    np.testing.assert_allclose(fitted.scores(first(trace, rows)), score[:rows], rtol=0, atol=1e-9)


GOLDEN = json.loads((Path(__file__).parent / "golden_scores.json").read_text())


@pytest.mark.skipif(
    GOLDEN["mujoco"] != mujoco.__version__, reason="simulated traces are of another MuJoCo"
)
def test_golden_scores(fitted, unseen):
    score = fitted.scores(first(unseen[0], 6_000))
    # Training runs through BLAS, whose last bits depend on the processor.
    np.testing.assert_allclose(score[GOLDEN["rows"]], GOLDEN["scores"][fitted.name], 1e-6, 1e-9)


def test_hard_collisions_score_above_free_motion(fitted, unseen):
    if fitted.name == "srq-svr-plain":
        pytest.skip("its kernel is almost diagonal on raw residuals: it ranks nothing")
    free, inside = [], []
    for trace in unseen:
        score = fitted.scores(trace)
        quiet = free_rows(trace, fitted.settle)
        free.append(score[quiet])
        hard = [c for c in trace.truth.collisions if c.peak_tau > 16]
        inside += [score[(trace.t >= c.onset) & (trace.t < c.end + 0.1)].max() for c in hard]
    assert len(inside) >= 5
    # An untold payload is a residual for the form without past currents.
    least = 0.4 if fitted.name == "current-network-static" else 0.7
    assert np.mean(np.array(inside) > np.quantile(np.concatenate(free), 0.98)) >= least


def test_no_alarm_before_it_has_settled_and_levels_say_when(fitted, unseen):
    trace = first(unseen[0], 4_500)
    watched = Thresholded(fitted, -np.inf)
    found = watched.detect(trace)
    begin = fitted.settle + 0.002
    assert found.alarms[0].start == pytest.approx(begin, abs=1e-9)
    level = watched.levels(trace)
    np.testing.assert_array_equal(level > -np.inf, found.alarm)
    middle = float(np.median(level[found.alarm]))
    again = Thresholded(fitted, middle).detect(trace)
    np.testing.assert_array_equal(level > middle, again.alarm)


def test_foreign_traces_are_refused(fitted, unseen):
    trace = first(unseen[0], 4_000)
    with pytest.raises(ValueError, match="sample every 10 ms"):
        fitted.scores(dataclasses.replace(trace, t=trace.t * 10))
    tables = ("q", "qd", "current")
    fewer = {name: getattr(trace, name)[:, :3] for name in tables}
    other = Trace(trace.joint_names[:3], trace.t, **fewer)
    with pytest.raises(ValueError, match="3 joints"):
        fitted.scores(other)


def test_an_unfitted_detector_says_so(unseen, training, arm):
    for name in DETECTORS:
        with pytest.raises(ValueError, match="not fitted"):
            make_detector(name).scores(unseen[0])
        with pytest.raises(ValueError, match="no traces"):
            make_detector(name).fit([], arm)


def test_a_file_gives_equal_scores_and_holds_nothing_to_distrust(fitted, unseen, tmp_path):
    path = tmp_path / "model.skops"
    save_model(Thresholded(fitted, 0.25, 0.005), path)
    assert skops.io.get_untrusted_types(file=path) == []
    again = load_model(path)
    assert (again.threshold, again.confirmation) == (0.25, 0.005)
    assert again.detector.name == fitted.name
    assert again.detector.settle == fitted.settle
    trace = first(unseen[0], 4_000)
    assert again.detector.scores(trace).tobytes() == fitted.scores(trace).tobytes()
    np.testing.assert_array_equal(
        again.detect(trace).residual, Thresholded(fitted, 0.25).detect(trace).residual
    )


def test_a_levelled_detector_comes_back_from_its_file(fitted, unseen, tmp_path):
    own = Levelled(fitted, SpeedLevels(np.array([0.0, 2.0]), np.array([1.0, 3.0]), np.ones(2)))
    save_model(Thresholded(own, 7.0), tmp_path / "model.skops")
    again = load_model(tmp_path / "model.skops")
    assert (again.threshold, again.detector.name) == (7.0, fitted.name)
    trace = first(unseen[0], 4_000)
    scores = again.detector.scores(trace)
    assert scores.tobytes() == own.scores(trace).tobytes() != fitted.scores(trace).tobytes()


def test_a_file_that_takes_no_single_samples_says_which_would(fitted, tmp_path):
    path = tmp_path / "model.skops"
    own = Levelled(fitted, SpeedLevels(np.array([0.0, 2.0]), np.array([1.0, 3.0]), np.ones(2)))
    remedy = "expected one that takes one sample at a time.*srq-svr.*without --levelled"
    save_model(Thresholded(own, 7.0), path)
    with pytest.raises(ValueError, match=rf"model\.skops: a levelled {fitted.name}, .*{remedy}"):
        CollisionDetector.load(path)
    save_model(Thresholded(fitted, 7.0), path)
    if fitted.name == "srq-svr":
        assert CollisionDetector.load(path).threshold == 7.0
        return
    with pytest.raises(ValueError, match=rf"model\.skops: a {fitted.name}, .*{remedy}"):
        CollisionDetector.load(path)


def test_damaged_and_foreign_files_are_named(tmp_path):
    bad = tmp_path / "bad.skops"
    for content, message in (
        (
            {"format": "other"},
            "not a detector file of this version .*anew by .tauguard train --traces",
        ),
        ({"format": FORMAT, "detector": "none"}, "with a part missing"),
        ({"format": FORMAT, "detector": "cusum", "parts": {}}, "with a part missing"),
        ([1], "not a detector file"),
    ):
        skops.io.dump(content, bad)
        with pytest.raises(ValueError, match=message):
            load_model(bad)
    bad.write_bytes(b"hello")
    with pytest.raises(ValueError, match=r"bad\.skops: not a detector file"):
        load_model(bad)


def test_the_chain_s_own_file_is_read_too(detector, unseen, tmp_path):
    path = tmp_path / "model.skops"
    detector.save(path)
    trace = first(unseen[0], 12_000)
    watched = load_model(path)
    np.testing.assert_array_equal(watched.detect(trace).alarm, detector.detect(trace).alarm)


def test_an_unfitted_detector_cannot_be_saved(tmp_path):
    for name in DETECTORS:
        with pytest.raises(ValueError, match="not fitted"):
            save_model(Thresholded(make_detector(name), 0.0), tmp_path / "model.skops")
    assert not list(tmp_path.iterdir())


def test_detectors_with_one_front_end_say_what_they_say_alone(some, arm, identified):
    names = ("residual-thresholds", "moving-thresholds", "cusum")
    with pytest.MonkeyPatch.context() as patch:
        calls = []
        patch.setattr(front_end, "calibrate", lambda *_, **__: calls.append(1) or identified)
        alone = [make_detector(name).fit(some, arm).scores(some[0]) for name in names]
        assert len(calls) == 3
        together = [make_detector(name) for name in names]
        fronts = front_end.shared_front_ends(together)
        assert len(fronts) == 2  # the first has another one: it does not track the payload
        for detector in together:
            detector.fit(some, arm)
        assert len(calls) == 5
    for front in fronts:
        front.forget()
    again = pickle.loads(pickle.dumps(together))
    assert again[1].front is again[2].front
    for trace_scores, detector, copy in zip(alone, together, again, strict=True):
        for one in (detector, copy, detector):
            assert one.scores(some[0]).tobytes() == trace_scores.tobytes()
            one.scores(some[1])  # what was kept of a trace is not said of another
