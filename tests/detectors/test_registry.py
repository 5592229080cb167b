"""Every method of the registry keeps the shared contract, and so does one of another's."""

import dataclasses
import json
import pickle
from copy import copy as shallow_copy
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import CollisionAlarm, load_model, model_file, save_model
from tauguard.detectors.alarms.training import held_out
from tauguard.detectors.calibration.calibrate import calibrate
from tauguard.detectors.events import free_rows
from tauguard.detectors.features import front_end
from tauguard.detectors.registry import DETECTORS, make_detector
from tauguard.detectors.thresholds.free_scores import SpeedNormalisation
from tauguard.traces import Trace

#: Less training, so that the tests are quick.
SMALLER = {"windows": 2000, "mined": 200, "epochs": 15, "rows": 6000}


def small(name):
    """The method with less training."""
    detector, less = make_detector(name), dict(SMALLER)
    if name.startswith("srq-svr"):
        less |= {"windows": 800, "mined": min(detector.mined, 100), "vectors": 0}
    return dataclasses.replace(detector, **{k: v for k, v in less.items() if hasattr(detector, k)})


@pytest.fixture(scope="module")
def some(training):
    """A free trace at each speed, and two with collisions."""
    return [*training[:3], *training[9:11]]


@pytest.fixture(scope="module")
def fitted(some, arm):
    """Every method; one identification for all: what it finds is tested where it belongs."""
    identified = calibrate(arm, some)
    fewer = held_out(some)[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(front_end, "calibrate", lambda *_, **__: identified)
        return {
            name: small(name).fit(fewer if name.startswith("srq-svr") else some, arm)
            for name in DETECTORS
        }


@pytest.fixture(params=list(DETECTORS))
def detector(request, fitted):
    return fitted[request.param]


def rows_of(trace, rows):
    tables = ("t", "q", "qd", "current", "q_des", "qd_des", "qdd_des")
    cut = {name: getattr(trace, name)[rows] for name in tables}
    return dataclasses.replace(trace, **cut, truth=None)


def first(trace, rows):
    return rows_of(trace, slice(rows))


def streamed(stream, trace):
    """The stream's answers to all samples of a trace."""
    dt = [None, *np.diff(trace.t)]
    return np.array(
        [stream.step(*row) for row in zip(trace.q, trace.qd, trace.current, dt, strict=True)]
    )


def test_the_registry_names_its_methods():
    for name in DETECTORS:
        assert make_detector(name).name == name
    with pytest.raises(ValueError, match="did you mean 'srq-svr'"):
        make_detector("srq-svm")


GOLDEN = json.loads((Path(__file__).parent / "golden_scores.json").read_text())


@pytest.mark.skipif(
    GOLDEN["mujoco"] != mujoco.__version__, reason="simulated traces are of another MuJoCo"
)
def test_golden_scores(detector, unseen):
    score = detector.scores(first(unseen[0], 6_000))
    # Training runs through BLAS, whose last bits depend on the processor.
    # The iterations that identify a real arm stop at 1e-7 of their cost: BLAS with one thread moves
    # the scores of free motion by 4e-6.
    relative = {"free-motion": 1e-4}.get(detector.name, 1e-6)
    found = score[GOLDEN["rows"]]
    golden = GOLDEN["scores"].get(detector.name)
    assert golden, f"add to golden_scores.json: {json.dumps({detector.name: found.tolist()})}"
    np.testing.assert_allclose(found, golden, relative, 1e-9)


def test_scores_are_finite_and_causal(detector, unseen):
    trace = first(unseen[0], 6_000)
    score = detector.scores(trace)
    assert score.shape == trace.t.shape
    assert np.isfinite(score).all()
    rows = 4_500
    assert detector.scores(first(trace, rows)).tobytes() == score[:rows].tobytes()


@settings(max_examples=6, deadline=None)
@given(
    name=st.sampled_from(list(DETECTORS)),
    begin=st.integers(0, 9_000),
    count=st.integers(1, 700),
    noise=st.floats(0, 3),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_stream_scores_as_the_batch_does(fitted, unseen, name, begin, count, noise, seed):
    rng = np.random.default_rng(seed)
    trace = rows_of(unseen[seed % 2], slice(begin, begin + count))
    jitter = np.cumsum(rng.uniform(0.9e-3, 1.1e-3, count))
    current = trace.current + rng.normal(scale=noise, size=trace.current.shape)
    trace = dataclasses.replace(trace, t=jitter, current=current)
    detector = dataclasses.replace(fitted[name])
    assert streamed(detector.stream(), trace).tobytes() == detector.scores(trace).tobytes()


def test_a_stream_scores_as_the_batch_does_while_it_settles(detector, unseen):
    trace = first(unseen[1], 3_300)
    assert streamed(detector.stream(), trace).tobytes() == detector.scores(trace).tobytes()


def test_a_shallow_copy_of_a_stream_with_native_state_is_refused(detector):
    stream = detector.stream()
    if hasattr(stream, "native"):
        with pytest.raises(ValueError, match="both copies would continue the same native state"):
            shallow_copy(stream)


def test_hard_collisions_score_above_free_motion(detector, unseen):
    if detector.name == "srq-svr-plain":
        pytest.skip("its kernel is almost diagonal on raw residuals: it ranks nothing")
    free, inside = [], []
    for trace in unseen:
        score = detector.scores(trace)
        free.append(score[free_rows(trace, detector.settle)])
        hard = [c for c in trace.truth.collisions if c.peak_tau > 16]
        inside += [score[(trace.t >= c.onset) & (trace.t < c.end + 0.1)].max() for c in hard]
    assert len(inside) >= 5
    assert np.mean(np.array(inside) > np.quantile(np.concatenate(free), 0.98)) >= 0.7


def test_no_alarm_before_it_has_settled_and_sustained_scores_say_when(detector, unseen):
    trace = first(unseen[0], 4_500)
    alarm = CollisionAlarm(detector, -1e300)
    found = alarm.detect(trace)
    begin = detector.settle + 0.002
    assert found.alarms[0].start == pytest.approx(begin, abs=1e-9)
    level = alarm.sustained(trace)
    np.testing.assert_array_equal(level > -np.inf, found.alarm)
    middle = float(np.median(level[found.alarm]))
    again = CollisionAlarm(detector, middle).detect(trace)
    np.testing.assert_array_equal(level > middle, again.alarm)


def test_foreign_traces_are_refused(detector, unseen):
    trace = first(unseen[0], 4_000)
    if detector.name != "free-motion":  # it averages to 4 ms and knows each sample's interval
        with pytest.raises(ValueError, match="sample every 10 ms"):
            detector.scores(dataclasses.replace(trace, t=trace.t * 10))
    tables = ("q", "qd", "current")
    fewer = {name: getattr(trace, name)[:, :3] for name in tables}
    other = Trace(trace.joint_names[:3], trace.t, **fewer)
    with pytest.raises(ValueError, match="3 joints"):
        detector.scores(other)


def test_a_method_needs_traces(arm):
    for name in DETECTORS:
        with pytest.raises(ValueError, match="no traces"):
            make_detector(name).fit([], arm)


def test_free_motion_learns_nothing_from_traces_with_collisions(some, arm):
    with pytest.raises(ValueError, match="no trace without collisions"):
        make_detector("free-motion").fit(some[3:], arm)


def test_a_file_gives_equal_scores(detector, unseen, tmp_path, monkeypatch):
    # The levels are any numbers here, so that an alarm may be up all the time.
    monkeypatch.setattr(model_file, "check_alarms", lambda alarm: None)
    path = tmp_path / "model.tauguard"
    trace = first(unseen[0], 4_000)
    levels = SpeedNormalisation(np.array([0.0, 2.0]), np.array([1.0, 3.0]), np.ones(2))
    own = CollisionAlarm(detector, 0.25, 0.005, levels)
    save_model(own, path)
    again = load_model(path)
    assert (again.threshold, again.confirmation) == (0.25, 0.005)
    assert (again.detector.name, again.settle) == (detector.name, detector.settle)
    assert again.detector.scores(trace).tobytes() == detector.scores(trace).tobytes()
    one, two = own.detect(trace), again.detect(trace)
    assert one.score.tobytes() == two.score.tobytes() != detector.scores(trace).tobytes()
    np.testing.assert_array_equal(one.residual, two.residual)


def test_methods_with_one_front_end_share_it_and_say_what_they_say_alone(some, arm):
    names = ("residual-thresholds", "moving-thresholds", "srq-svr")
    identified = calibrate(arm, some)
    with pytest.MonkeyPatch.context() as patch:
        calls = []
        patch.setattr(front_end, "calibrate", lambda *_, **__: calls.append(1) or identified)
        alone = [small(n).fit([*some], dataclasses.replace(arm)) for n in names]
        assert len(calls) == 3
        together = [small(n).fit(some, arm) for n in names]
        assert len(calls) == 5  # the first has another one: it does not track the payload
    assert together[1].front is together[2].front
    again = pickle.loads(pickle.dumps(together))
    assert again[1].front is again[2].front
    for one, detector, copy in zip(alone, together, again, strict=True):
        scores = one.scores(some[0]).tobytes()
        for other in (detector, copy, detector):
            assert other.scores(some[0]).tobytes() == scores
            other.scores(some[1])  # what was kept of a trace is not said of another
