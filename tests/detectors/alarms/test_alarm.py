"""A trained alarm as a whole: what it finds, online as in batch, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from tauguard.datasets.plans import free_episodes
from tauguard.detectors import ArmModel, SrqSvr, detection_metrics, match_detection
from tauguard.detectors.alarms.training import held_out, left_out, train, train_and_score, with_rate
from tauguard.detectors.features.front_end import FrontEndSettings
from tauguard.detectors.samples import plain_rate
from tauguard.detectors.scores.baselines import MovingThresholds
from tauguard.detectors.scores.windowed import PlainSrqSvr
from tauguard.detectors.thresholds.free_scores import recent_speed
from tauguard.detectors.thresholds.tail_model import threshold_for_rate
from tauguard.envs import simulate
from tauguard.models import Mismatch
from tauguard.traces import resampled
from tests.oracles.added_contact import Added, add_contact


def test_it_finds_collisions_on_unseen_motions_with_unknown_payloads(alarm, unseen):
    matchings = [match_detection(alarm.detect(trace), trace, skip=3.0) for trace in unseen]
    out = detection_metrics(matchings)
    assert out["headline"]["sensitivity"]["n"] >= 6
    assert out["headline"]["sensitivity"]["value"] >= 0.85
    assert out["specificity"]["value"] >= 0.6
    assert out["headline"]["delay_ms"]["median"] < 20


def test_online_equals_batch(alarm, unseen):
    trace = unseen[0]
    batch, stream, rows = alarm.detect(trace), alarm.stream(), 12_000
    score, up = np.empty(rows), np.empty(rows, bool)
    for k in range(rows):
        dt = trace.t[k] - trace.t[k - 1] if k else None
        up[k] = stream.step(trace.q[k], trace.qd[k], trace.current[k], dt)
        score[k] = stream.score
    assert score.tobytes() == batch.score[:rows].tobytes()
    np.testing.assert_array_equal(up, batch.alarm[:rows])
    assert up.any()


def test_a_blow_unlike_any_of_the_training_is_found_by_the_floor(alarm, training, arm):
    """Blows of 90 N m on joints 2 and 3 alone, for 5 ms: to some the regressor hardly answers."""
    trace = simulate(free_episodes(78, 1, 9.0, (30.0,), (2000.0,), Mismatch(seed=11))[0])
    starts = 4.0 + 0.4 * np.arange(12)
    for start, angle in zip(starts, np.linspace(0, 2 * np.pi, 12), strict=True):
        torque = np.array([np.cos(angle), np.sin(angle)])
        blow = Added(start, 0.005, (0, *(90 * torque / np.abs(torque).max()), 0, 0, 0))
        trace = add_contact(trace, arm.drive_gain, blow)
    rare = with_rate(alarm.detector, training[:9], 0.25)
    scores = np.array([one.scores(trace) for one in (rare, replace(rare, floor=None))])
    rows = [(trace.t >= start) & (trace.t < start + 0.05) for start in starts]
    both, alone = np.array([scores[:, own].max(axis=1) for own in rows]).T
    assert (both > 2 * rare.threshold).all()
    assert (alone < 0.6 * both).any()


def test_the_floor_is_that_of_moving_thresholds(alarm, training, unseen, arm):
    own = alarm.detector
    plain = MovingThresholds(FrontEndSettings()).fit(held_out(training)[0], arm)
    assert own.floor.scores(unseen[0]).tobytes() == plain.scores(unseen[0]).tobytes()
    speed = recent_speed(unseen[0].qd, unseen[0].dt)
    beneath = alarm.floor(own.floor.scores(unseen[0]), speed)
    assert (alarm.scores(unseen[0]) >= beneath).all()


@pytest.mark.parametrize("hz", [None, 25.0])
def test_what_moving_thresholds_find_is_found_no_later(training, unseen, arm, hz):
    """Trained alike for one rate: at each sample at which their alarm is up, this one is, too."""
    own, fresh = (
        [t if hz is None else resampled(t, hz) for t in traces] for traces in (training, unseen)
    )
    methods = SrqSvr(windows=300, mined=0), MovingThresholds()
    ours, plain = (train(method, own, arm, 10.0, folds=1) for method in methods)
    assert ours.threshold == plain.threshold
    for trace in fresh:
        theirs = plain.detect(trace).alarm
        assert theirs.any()
        assert ours.detect(trace).alarm[theirs].all()


def test_the_plain_form_is_the_dissertations(training, arm):
    plain = PlainSrqSvr(windows=600).fit(training, arm)
    raw = PlainSrqSvr(windows=600, distance=0.0).fit(training, arm)
    for one in (plain, raw):
        assert one.scaling.noise_model is None
        assert one.arm.friction is None
        assert one.regressor.vectors.shape[1] == 44
    assert raw.scaling.factor == 1.0
    # In N m nearly every window stands alone in the kernel's length of 3; one factor mends that.
    vectors, factor = raw.regressor.vectors, plain.scaling.factor
    assert len(vectors) > 0.6 * 600
    gaps = pdist(vectors * factor)
    assert 0.5 * 3.0 < np.median(gaps) < 2 * 3.0
    assert np.median(gaps) / factor > 5 * 3.0


def test_same_seed_same_detector(training, arm, unseen):
    settings, some = SrqSvr(windows=300, mined=0), [*training[:3], *training[9:11]]
    two = [train(settings, list(some), arm, 10.0, folds=1) for _ in range(2)]
    assert two[0].threshold == two[1].threshold
    assert two[0].detect(unseen[0]).score.tobytes() == two[1].detect(unseen[0]).score.tobytes()


def test_fewer_vectors_say_nearly_the_same(alarm, unseen):
    machine = alarm.detector.regressor
    few = machine.reduced(len(machine.vectors) // 2)
    windows = alarm.detector.shape.of(
        alarm.detector.front.scaled(unseen[0], alarm.detector.scaling), np.arange(0, 9000, 3)
    )
    error = few(windows) - machine(windows)
    assert np.sqrt(np.mean(error**2)) < 0.006
    assert np.abs(error).max() < 0.06


def test_held_out_traces_are_collision_free_and_not_trained_on(training):
    own, rest = held_out(training)
    assert len(own) + len(rest) == len(training)
    assert len(rest) == 3
    assert not any(t.truth.collisions for t in rest)
    assert not {id(t) for t in own} & {id(t) for t in rest}
    struck = [t for t in training if t.truth.collisions]
    assert held_out(struck) == (struck, struck)


def test_folds_score_every_free_trace_by_a_detector_that_has_not_seen_its_load(training, arm):
    free = [t for t in training if not t.truth.collisions]
    seen: list[list] = []

    class Noted(SrqSvr):
        def fit(self, traces, arm):
            seen.append(traces)
            return super().fit(traces, arm)

    alarm, scores = train_and_score(Noted(windows=300, mined=0), training, arm, 10.0)
    assert len(scores) == len(free)
    assert alarm.threshold == threshold_for_rate(scores, 10.0)
    loads = [{float(t.truth.payload.max()) for t in traces} for traces in seen]
    assert loads[-1] == {0.0, 2.0, 2.5, 4.0}
    # 2.5 kg is carried in collisions only; 0 kg and it hold all collisions.
    assert loads[:-1] == [{2.0, 2.5, 4.0}, {0.0, 2.5, 4.0}, {0.0, 2.0, 2.5}]
    assert all(any(t.truth.collisions for t in traces) for traces in seen)


def test_with_fewer_loads_than_folds_traces_are_left_out_one_by_one(training):
    free = [i for i, t in enumerate(training) if not t.truth.collisions]
    alike = [i for i in free if training[i].truth.payload.max() == 2.0]
    struck = [t for t in training if t.truth.collisions]
    parts = left_out([*struck, *(training[i] for i in alike)], 3)
    assert parts == [{len(struck) + k} for k in range(3)]


def test_collisions_of_the_only_load_that_has_some_stay(training):
    empty = [t for t in training if t.truth.payload.max() == 0.0]
    heavy = [t for t in training if t.truth.payload.max() == 4.0]
    parts = left_out([*empty, *heavy], 2)
    assert parts[0] == {i for i, t in enumerate(empty) if not t.truth.collisions}
    assert parts[1] == set(range(len(empty), len(empty) + len(heavy)))


def test_bad_input(alarm, training, robot, arm, unseen):
    with pytest.raises(ValueError, match="no traces"):
        SrqSvr().fit([], arm)
    front = FrontEndSettings(joints=(7,))
    with pytest.raises(ValueError, match=r"joints \(7,\): expected some of 1 to 6"):
        SrqSvr(front=front).fit(training, arm)
    free = [t for t in training if not t.truth.collisions]
    with pytest.raises(ValueError, match="contain no collision"):
        SrqSvr().fit(free[:3], arm)
    with pytest.raises(ValueError, match=r"drive_gain: shape \(2,\)"):
        ArmModel(robot, arm.drive_gain[:2])
    with pytest.raises(ValueError, match="float64 arrays"):
        alarm.stream().step(unseen[0].q[:1], unseen[0].qd[0], unseen[0].current[0])
    with pytest.raises(ValueError, match="per_hour 0, folds 3"):
        train(SrqSvr(windows=300, mined=0), training, arm, 0)
    with pytest.raises(ValueError, match="folds 0: expected"):
        train(SrqSvr(), training, arm, 1.0, folds=0)


def test_absurd_samples_are_named_and_not_taken_for_silence(alarm, unseen):
    from dataclasses import replace

    trace = unseen[0]
    qd = trace.qd.copy()
    qd[4000] = 1e200
    with pytest.raises(ValueError, match=r"score is not a number.*first at 4 s"):
        alarm.detect(replace(trace, qd=qd))
    stream = alarm.stream()
    stream.step(trace.q[0], trace.qd[0], trace.current[0])
    with pytest.raises(ValueError, match="score is not a number"):
        [stream.step(trace.q[k], qd[4000], trace.current[k]) for k in range(1, 20)]


@pytest.mark.parametrize(
    ("milliseconds", "hz"),
    [
        (8.2, 125),
        (8.0, 125),
        (2.0, 500),
        (1000 / 60, 60),
        (20.3, 50),
        (1000 / 240.1, 240),
        (70, 14),
    ],
)
def test_a_rate_is_proposed_in_few_digits(milliseconds, hz):
    assert plain_rate(milliseconds / 1e3) == hz


def test_another_rate_is_refused_in_batch_and_online(alarm, unseen):
    from dataclasses import replace

    slow = replace(unseen[0], t=unseen[0].t * 10, truth=None)
    with pytest.raises(ValueError, match="works at 1 ms: train a detector on"):
        alarm.detect(slow)
    stream, sample = alarm.stream(), (unseen[0].q[0], unseen[0].qd[0], unseen[0].current[0])
    stream.step(*sample, None)
    with pytest.raises(ValueError, match="dt 5 ms: this detector works at 1 ms"):
        stream.step(*sample, 5e-3)
