"""The library's calls on logs of a real arm (synthetic) and of a simulated one."""

import dataclasses
import json
import os
import subprocess
import sys

import numpy as np
import pytest

import tauguard as tg
from tauguard.detectors import DETECTORS, make_detector
from tauguard.findings import RefusedError, TauguardError
from tests.detectors.synthetic_arm import GAIN, XML, record
from tests.oracles.added_contact import Added, add_contact

COLUMNS = tg.datasets.ColumnMap(
    t="t",
    q=("q1", "q2", "q3"),
    qd=("v1", "v2", "v3"),
    current=("i1", "i2", "i3"),
)
GROUPS = ("q", "qd", "current")


def written(path, trace):
    """A CSV file with all digits, so that the file has the samples' bits."""
    header = ",".join(["t", *COLUMNS.q, *COLUMNS.qd, *COLUMNS.current])
    table = np.column_stack([trace.t, trace.q, trace.qd, trace.current])
    np.savetxt(path, table, delimiter=",", fmt="%.17g", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    (folder / "arm.xml").write_text(XML)
    (folder / "free").mkdir()
    for seed in range(3):
        written(folder / "free" / f"log{seed}.csv", record(seed))
    touch = add_contact(record(8), GAIN, Added(14.0, 0.4, (28.0, 20.0, 10.0), "push"))
    written(folder / "pushed.csv", touch)
    return folder


@pytest.fixture(scope="module")
def free(folder):
    return tg.read_logs(folder / "free", COLUMNS, robot=folder / "arm.xml")


@pytest.fixture(scope="module")
def arm(free):
    return tg.calibrate(free, gains=GAIN)


@pytest.fixture(scope="module")
def detector(free, arm):
    return tg.train(free, arm)


@pytest.fixture(scope="module")
def log(folder):
    return tg.read_log(folder / "pushed.csv", COLUMNS, robot=folder / "arm.xml")


def same(one, two):
    """Both detections, sample by sample and alarm by alarm."""
    for a, b in zip(one.signals, two.signals, strict=True):
        np.testing.assert_array_equal(a, b)
    assert one.alarms == two.alarms
    assert str(one) == str(two)


def test_the_arm_in_memory_and_in_its_file_make_the_same_detector(
    folder, tmp_path, arm, detector, log
):
    robot = arm.save(tmp_path / "calibrated.xml")
    again = tg.train(tg.read_logs(folder / "free", COLUMNS, robot=robot))
    assert again.threshold == detector.threshold
    found = detector.detect(log)
    same(found, again.detect(dataclasses.replace(log, robot=None, numbers=None)))
    loaded = tg.load_detector(detector.save(tmp_path / "arm.tauguard"), folder / "arm.xml")
    same(found, loaded.detect(log))
    with pytest.raises(TauguardError, match="needs the logs of the training"):
        loaded.card()


def test_the_stream_gives_what_the_log_gives(detector, log):
    found, stream, trace = detector.detect(log), detector.stream(), log.trace
    rows = zip(trace.t.tolist(), trace.q, trace.qd, trace.current, strict=True)
    answers = [stream.step(*row) for row in rows]
    np.testing.assert_array_equal([one.score for one in answers], found.signals.score)
    np.testing.assert_array_equal([one.alarm for one in answers], found.detection.alarm)
    assert {one.state for one in answers} == {"free", "collision"}


def test_a_push_is_found_and_every_result_prints_and_has_its_table(
    free, arm, detector, log, monkeypatch
):
    found = detector.detect(log, payload=0.0)
    (alarm,) = found.alarms
    assert 14.0 < alarm.start < 14.3
    (cause,) = found.diagnose()
    assert cause.collision
    (row,) = found.rows()
    assert row["link"] == (cause.link if cause.link_identifiable else None)
    monkeypatch.setitem(sys.modules, "pandas", None)  # only to_frame needs it
    for result in (free, log, arm, detector, detector.card(), found):
        assert "\n" not in repr(result)
        assert str(result)
        assert "<table>" in result._repr_html_()
        json.dumps(result.to_dict())
        assert [f.code for f in result.findings] == [f.code for f in result.findings]
        with pytest.raises(dataclasses.FrozenInstanceError):
            result.findings = ()
        with pytest.raises(ImportError):
            result.to_frame()
    monkeypatch.undo()
    pytest.importorskip("pandas")
    assert len(found.to_frame()) == 1
    assert list(arm.to_frame()["joint"]) == ["a", "b", "c"]


def test_the_beginning_of_a_log_trains_as_a_log_of_its_own(arm, log, tmp_path, folder):
    robot = arm.save(tmp_path / "calibrated.xml")
    log = tg.read_log(folder / "pushed.csv", COLUMNS, robot=robot)
    found = tg.detect_after_quiet(log, quiet=12.0, payload=0.0)
    by_hand = tg.train(log.until(12.0), validate=False).detect(log, payload=0.0)
    late = log.trace.t - log.trace.t[0] > 13.0
    np.testing.assert_array_equal(found.signals.score[late], by_hand.signals.score[late])
    assert len(found.alarms) == 1
    assert [f.text for f in found.findings.of("gains")] == [
        "trained on the first 12 s; gains: those of the calibration in calibrated.xml"
    ]


def changed(trace, order=(0, 1, 2), signs=(1, 1, 1), fields=("current",)):
    columns = {key: getattr(trace, key)[:, order] * signs for key in fields}
    return dataclasses.replace(trace, **columns)


def strange(folder, **how):
    traces = {f"log{k}.csv": changed(record(k), **how) for k in range(3)}
    return tg.read_logs(traces, robot=folder / "arm.xml")


def test_all_that_is_wrong_is_told_at_once(folder):
    logs = strange(folder, order=(1, 0, 2), signs=(1, 1, -1))
    for call in (tg.calibrate, tg.train):
        with pytest.raises(RefusedError) as stop:
            call(logs, gains=GAIN)
        where = {finding.where for finding in stop.value.findings.of("order")}
        assert where == {("a", "b"), ("c",)}
        assert "signs" in {finding.code for finding in stop.value.findings}
        assert stop.value.accept == ()  # friction that pushes cannot be accepted


def test_one_log_of_exchanged_currents_among_others_is_named(folder, free):
    traces = {name: log.trace for name, log in free.items()}
    traces["mixed"] = changed(record(7), order=(1, 0, 2))
    logs = tg.read_logs(traces, robot=folder / "arm.xml")
    with pytest.raises(RefusedError) as stop:
        tg.calibrate(logs, gains=GAIN)
    assert ("mixed", "a", "b") in {finding.where for finding in stop.value.findings.of("order")}


def test_an_accepted_error_is_a_warning_of_the_result(folder, free):
    light = folder / "light.xml"
    light.write_text(XML.replace('mass="4"', 'mass="1"').replace('mass="2"', 'mass=".5"'))
    logs = tg.read_logs(folder / "free", COLUMNS, robot=light)
    with pytest.raises(RefusedError) as stop:
        tg.calibrate(logs, gains=GAIN)
    assert stop.value.accept == ("gravity",)
    accepted = tg.calibrate(logs, gains=GAIN, accept=stop.value.accept)
    (warning,) = accepted.findings.of("gravity")
    assert warning.severity == "warning"


@pytest.mark.parametrize("mass", [3.0, 9.0])
def test_a_load_that_fixes_the_scale_has_to_fit_the_robot_file(folder, free, mass):
    traces = {name: log.trace for name, log in free.items()} | {"heavy": record(20, load=3.0)}
    load = (mass, (0.3, 0.0, 0.05))
    logs = tg.read_logs(traces, robot=folder / "arm.xml", payload={"heavy": load})
    if mass == 3.0:
        assert tg.calibrate(logs).scale == "payload"
        return
    with pytest.raises(RefusedError) as stop:
        tg.calibrate(logs)
    assert "gravity" in {finding.code for finding in stop.value.findings}


def test_arguments_that_do_not_go_together(free, arm, detector):
    for call, text in (
        (lambda: tg.train(free, arm, gains=GAIN), "the arm has gains"),
        (lambda: tg.calibrate(free, gains=GAIN, scale="masses"), "cannot be combined"),
        (lambda: tg.train(free, arm, calibration=free), "takes neither `calibration=`"),
        (lambda: tg.train(free, method="srq-svr", accept="order"), "takes neither `accept=`"),
        (lambda: tg.train(free, gains=GAIN, accept="log9"), "no log 'log9'"),
        (lambda: detector.detect(record(8), payload=-1.0), "expected 0 or more"),
    ):
        with pytest.raises(TauguardError, match=text):
            call()


# -- simulated arms --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def motion():
    from tauguard.datasets import free_episodes, struck_episodes
    from tauguard.envs import simulate

    speeds = (30.0,)
    episodes = [*struck_episodes(1, 1, 4, speeds), *free_episodes(1, 3, 9.0, speeds)]
    return tg.simulated(simulate(episode) for episode in episodes)


@dataclasses.dataclass(frozen=True)
class Deaf:
    """A method whose score never changes."""

    name: str = "deaf"

    def fit(self, traces, arm):
        return FittedDeaf(arm, traces[0].dt)


@dataclasses.dataclass(frozen=True)
class FittedDeaf:
    arm: object
    dt: float
    name: str = "deaf"
    settle: float = 0.1

    def scores(self, trace):
        return np.zeros(len(trace.t))


@pytest.mark.parametrize("method", ["moving-thresholds", "residual-thresholds", "free-motion"])
def test_the_same_calls_train_and_judge_on_simulated_arms(motion, method):
    assert method in DETECTORS
    accept = ("alarms", "error", "gravity", "order") if method == "free-motion" else ()
    detector = tg.train(motion, method=method, folds=1, accept=accept)
    settings = tg.train(motion, method=make_detector(method), folds=1, accept=accept)
    assert detector.threshold == settings.threshold
    result = tg.evaluate(detector, motion)
    counts = result.metrics["confusion"]
    assert counts["tp"] + counts["fn"] == 4
    assert sum(row["detected"] for row in result.rows()) == counts["tp"]
    assert counts["tp"] >= (1 if method == "free-motion" else 3)
    json.dumps(result.to_dict())
    struck = motion.traces[0]
    found, stream = detector.detect(struck), detector.stream()
    rows = zip(struck.t.tolist(), struck.q, struck.qd, struck.current, strict=True)
    scores = [stream.step(*row).score for row in rows]
    np.testing.assert_array_equal(scores, found.signals.score)


def test_a_detector_that_never_alarms_is_an_error_of_its_training(motion):
    with pytest.raises(TauguardError, match="cannot be used: it raises no alarm at any impact"):
        tg.train(motion, method=Deaf(), folds=1)


BITS = """
import hashlib, sys
import numpy as np
import tauguard as tg
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.envs import simulate
speeds = (30.0,)
episodes = [*struck_episodes(1, 1, 3, speeds), *free_episodes(1, 2, 8.0, speeds)]
motion = tg.simulated(simulate(episode) for episode in episodes)
detector = tg.train(motion, method="moving-thresholds", folds=1)
score = detector.detect(motion.traces[0]).signals.score
print(hashlib.sha256(score.tobytes() + np.float64(detector.threshold).tobytes()).hexdigest())
"""


def test_the_number_of_threads_changes_no_bit():
    bits = {
        subprocess.run(
            [sys.executable, "-c", BITS],
            env={**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "4")
    }
    assert len(bits) == 1
