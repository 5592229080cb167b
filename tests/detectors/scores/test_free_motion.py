"""The free-motion detector on a synthetic arm: quiet in free motion, finds what is added."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel, CollisionAlarm, load_model, save_model
from tauguard.detectors._observer import HIDES_BY_MOTION, HIDES_BY_PLACE, REGIME_SETTLES
from tauguard.detectors.alarms.log_detection import detect_in_log
from tauguard.detectors.alarms.training import carrying
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.evaluation.card_page import text
from tauguard.detectors.evaluation.cross_validation import CrossValidation, judge_logs
from tauguard.detectors.evaluation.threshold_card import replayed, threshold_card
from tauguard.detectors.events import find_alarms
from tauguard.detectors.features.free_bound import CREEP, friction_levels
from tauguard.detectors.features.motion_regimes import exceeded
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
from tests.detectors.synthetic_arm import GAIN, held_joint, nominal, record
from tests.oracles.added_contact import Added, add_contact


@pytest.fixture(scope="module")
def fitted():
    return FreeMotion().fit([record(seed) for seed in range(3)], ArmModel(nominal(), GAIN))


@pytest.fixture(scope="module")
def alarm(fitted):
    return carrying(CollisionAlarm(fitted, 1.0, CONFIRMATION), Load())


def test_no_alarm_in_free_motion_that_training_has_not_seen(alarm):
    for seed in (7, 8):
        assert alarm.detect(record(seed)).alarms == ()


def test_pushes_in_motion_and_at_rest_are_found(alarm):
    trace = record(7)
    for start in (4.0, 9.5, 15.0):  # the dwell is from 8 to 10 s
        struck = add_contact(trace, GAIN, Added(start, 0.5, (12.0, 12.0, 6.0), "push"))
        first = alarm.detect(struck).alarms[0].start
        assert start < first < start + 0.3


def test_speeds_that_training_exceeds_for_half_a_second_count_as_shown(fitted):
    speed = np.concatenate([np.abs(record(seed).qd) for seed in range(3)])
    seconds = 0.01 * (speed > fitted.bound.fast).sum(axis=0)
    assert (seconds > 0.3).all()
    assert (seconds < 0.7).all()
    assert (fitted.bound.hard > 0.3).all()
    assert (fitted.bound.hard < 10).all()


def ramp(dt, seconds=10.0):
    """Speeds that rise by 1 and 2 rad/s a second."""
    t = dt * np.arange(round(seconds / dt))
    return t, np.column_stack([t, 2 * t])


@pytest.mark.parametrize("dt", [1e-3, 2e-3, 8e-3, 0.01, 0.02, 0.03, 0.05, 0.1])
def test_half_a_second_is_meant_at_every_rate(dt):
    assert exceeded([ramp(dt)]) == pytest.approx([9.5, 19], abs=0.12)
    assert exceeded([ramp(dt), ramp(0.01)])[0] == pytest.approx(9.75, abs=0.08)
    if dt in (1e-3, 8e-3, 0.01):  # twelve rows of 40 ms
        assert (exceeded([ramp(dt)]) == ramp(dt)[1][:: round(0.04 / dt)][-12]).all()


def test_motion_beyond_the_logs_is_told_with_the_torque_that_it_hides(fitted):
    trace = record(7)
    assert fitted.beyond(fitted.judge(trace)) == (0.0, {})
    slow = replace(fitted, bound=replace(fitted.bound, fast=fitted.bound.fast * [0.4, 1.0, 1.0]))
    judged = slow.judge(trace)
    seconds, levels = slow.beyond(judged)
    over = (np.abs(trace.qd[:, 0]) > 1.25 * slow.bound.fast[0]) & (trace.t > 0.5)
    assert list(levels) == [0]
    assert seconds == pytest.approx(0.01 * over.sum(), rel=0.2)
    assert (judged.bound[over, 0] < levels[0]).mean() > 0.85
    assert levels[0] > 1.2 * np.quantile(fitted.judge(trace).bound[over, 0], 0.9)


def test_what_the_card_says_at_twice_the_speed_is_found_there(fitted):
    """Trained on slow motion, judged on motion that is up to twice as fast."""
    arm, load = ArmModel(nominal(), GAIN), Load()
    slow = FreeMotion().fit([record(1, seconds=30.0)], arm).carrying(load)
    bound = replace(slow.bound, fast=0.6 * slow.bound.fast, hard=0.6 * slow.bound.hard)
    slow = replace(slow, bound=bound)
    card = threshold_card(slow, [record(1, seconds=30.0)], CrossValidation((), (), ()))
    assert (card.twice > card.moving + 1.5 * bound.friction).all()
    trace = record(7)
    beyond = (np.abs(trace.qd) > bound.fast) & (np.abs(trace.qd) < 2 * bound.fast)
    for joint in range(3):
        places = [k for k in range(200, len(trace.t) - 60, 20) if beyond[k : k + 30, joint].all()]
        assert len(places) > 2
        torque = np.zeros(3)
        torque[joint] = card.twice[joint]
        found = 0
        for k in places:
            struck = add_contact(trace, GAIN, Added(trace.t[k], 0.3, tuple(torque), "impact"))
            found += (slow.scores(struck)[k : k + 35] > 1).any()
        assert found >= 0.9 * len(places)


@pytest.mark.parametrize(("field", "part"), [("fast", 1.0), ("hard", 0.5)])
def test_the_bound_grows_beyond_what_training_shows(fitted, field, part):
    """By a friction level for each multiple of the speed, half of one for accelerations."""
    known = {"fast": np.full(3, 1e6), "hard": np.full(3, 1e6)}
    wide, narrow = (
        replace(fitted, bound=replace(fitted.bound, **(known | own))).judge(record(7))
        for own in ({}, {field: getattr(fitted.bound, field) / 4})
    )
    size = {"fast": np.abs(record(7).qd[:-1]), "hard": narrow.qdd[1:]}[field]  # a sample later
    times = np.clip(4 * size / getattr(fitted.bound, field) - 1, 0.0, None)
    for k in range(1, len(times) if field == "hard" else 0):  # as the observer shows it
        times[k] = np.maximum(times[k], np.exp(-0.3) * times[k - 1]) * ~narrow.rest[k + 1]
    grown = fitted.bound.friction * np.minimum(part * times, 3.0)
    moving = ~narrow.rest[1:]
    assert grown[moving].max() > fitted.bound.friction.min()
    np.testing.assert_allclose((narrow.bound - wide.bound)[1:][moving], grown[moving], atol=1e-9)


def test_each_push_of_a_series_on_a_standing_arm_is_an_alarm_and_ends(alarm):
    trace = record(7, dwell=(6.0, 24.0))
    for start in (12.0, 14.0, 16.0):
        trace = add_contact(trace, GAIN, Added(start, 0.4, (8.0, 8.0, 4.0), "push"))
    starts = [one.start for one in alarm.detect(trace).alarms]
    assert all(any(s < x < s + 0.3 for x in starts) for s in (12.0, 14.0, 16.0))
    assert max(one.end for one in alarm.detect(trace).alarms) < 18.0


@pytest.mark.parametrize("size", [3.0, 10.0, 30.0])
def test_touches_in_a_standing_log_are_alarms_in_it(size):
    """Touches for 5 of 8 tenths of a second, all along; without them there is no alarm."""
    free = record(3, dwell=(-1.0, 99.0), noise=0.03)
    touched = free
    for start in np.arange(1.0, 24.0, 0.8):
        touched = add_contact(
            touched, GAIN, Added(start, 0.5, (1.8 * size, -1.8 * size, 0.6), "push")
        )
    arm = ArmModel(nominal(), GAIN)
    for trace, least, most in ((free, 0, 0), (touched, 21, 99)):
        (log,) = judge_logs({"log": Recording(trace)}, arm)
        assert least <= len(log.alarms) <= most


def test_what_a_push_leaves_is_taken_up(alarm):
    """Static friction holds another torque afterwards: a step that stays is one alarm."""
    trace = record(7, dwell=(6.0, 30.0))
    step = np.where(trace.t[:, None] > 12.0, 4.0, 0.0) * np.array([1.0, 1.0, 0.5]) / GAIN
    found = alarm.detect(replace(trace, current=trace.current - step))
    assert len(found.alarms) == 1
    assert found.alarms[0].end < 13.5


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_push_that_grows_slowly_is_found(alarm, joint):
    """In 0.3 s to twice the bound at rest; a baseline of 0.15 s alone would take it up."""
    torque = np.where(np.arange(3) == joint, 2.0 * alarm.detector.bound.rest, 0.0)
    push = Added(16.0, 1.5, tuple(torque), "push")
    found = alarm.detect(add_contact(record(7, dwell=(6.0, 24.0)), GAIN, push)).alarms
    assert any(16.0 < one.start < 16.6 for one in found)


@pytest.mark.parametrize("size", [0.6, 2.0])
def test_a_push_beside_a_biased_current_is_found(fitted, size):
    alarm = CollisionAlarm(fitted, 1.0, CONFIRMATION)  # of a load that is not told
    trace = record(9, seconds=32.0)
    current = trace.current.copy()
    current[trace.t >= 14.0, 1] += size * fitted.bound.least[1] / GAIN[1]
    biased = replace(trace, current=current)
    for start in (20.0, 25.0):
        biased = add_contact(biased, GAIN, Added(start, 0.4, (14.0, -18.0, 9.0), "push"))
    starts = [one.start for one in alarm.detect(biased).alarms]
    assert [any(s < x < s + 0.3 for x in starts) for s in (20.0, 25.0)] == [True, True]
    assert any(14.0 < x < 14.5 for x in starts) == (size > 1)  # below the bound it is not seen


def test_bounds_follow_motion_and_what_the_logs_taught(alarm):
    """The native bounds against their formula, from the trace's own speeds."""
    trace = record(7, dwell=(8.0, 14.0))
    seen, bound = alarm.detector.judge(trace), alarm.detector.bound
    # What is judged is one sample late.
    speed = np.vstack([np.abs(trace.qd[:1]), np.abs(trace.qd[:-1])])
    slow, t = speed < 0.02, trace.t
    still = np.flatnonzero(slow.all(axis=1) & (t > 8))
    stopped = t[still[0]]
    rows = (t > stopped + 0.3) & (t < 13.5)
    assert seen.rest[rows].all()
    # A time constant after the last motion e times less, the rest as it was learned.
    first, later = seen.bound[t > stopped + 1.0][0], seen.bound[t > stopped + 3.0][0]
    assert (first - bound.rest) / (later - bound.rest) == pytest.approx(
        np.full(3, np.exp(2 / REGIME_SETTLES)), 0.05
    )
    assert (first - bound.rest <= bound.stop * np.exp(-0.95 / REGIME_SETTLES)).all()
    went = (t > 2) & (speed > 0.02).all(axis=1)
    linear = np.stack(
        [
            np.ones_like(speed),
            speed,
            seen.shaken,
            seen.around,
            np.exp(-speed / CREEP),
        ]
    )
    least = np.maximum(np.einsum("ktj,jk->tj", linear, bound.moving), bound.least)
    above = (seen.bound - least)[went]
    assert above.min() > -1e-9
    both = ~seen.rest[1:] & ~seen.rest[:-1]
    decayed = np.maximum(seen.qdd[1:], np.exp(-0.3) * seen.shaken[:-1])  # 10 ms of 33 ms
    np.testing.assert_allclose(seen.shaken[1:][both], decayed[both], atol=1e-9)
    assert (np.median(above, axis=0) < 0.2 * bound.friction).all()  # what slow errors leave


def test_a_push_of_seconds_is_one_event_until_it_is_let_go(alarm):
    trace = record(7, dwell=(6.0, 30.0))
    held = add_contact(trace, GAIN, Added(12.0, 5.0, (20.0, 12.0, 6.0), "push"))
    events = find_alarms(trace.t, alarm.detect(held).alarm)
    assert len(events) == 1
    assert 12.0 < events[0].start < 12.4
    assert 16.2 < events[0].end < 17.0  # its force falls from 16 to 17 s


def test_touches_that_follow_each_other_by_0_3_s_are_each_an_event(alarm):
    trace = record(7, dwell=(6.0, 24.0))
    onsets = np.arange(13.0, 19.0, 0.8)
    for onset in onsets:
        trace = add_contact(trace, GAIN, Added(float(onset), 0.5, (16.0, 12.0, 8.0), "push"))
    events = find_alarms(trace.t, alarm.detect(trace).alarm)
    assert len(events) == len(onsets)
    assert all(o < e.start < o + 0.2 for o, e in zip(onsets, events, strict=True))
    assert all(e.end < o + 0.6 for o, e in zip(onsets, events, strict=True))


def test_a_joint_that_hunts_hides_no_push_on_another(alarm):
    """A controller's integral ramps joint 2 until it slips, over and over."""
    trace = record(7, dwell=(6.0, 30.0))
    level = alarm.detector.bound.friction
    phase = (trace.t - 12.0) / 1.5
    swings = np.where(trace.t > 12.0, np.abs(2 * (phase % 1.0) - 1.0) - 1.0, 0.0)
    hunting = np.outer(swings, [0.0, level[1], 0.0]) / GAIN
    trace = replace(trace, current=trace.current + hunting)

    def starts(t):
        return [one.start for one in find_alarms(t.t, alarm.detect(t).alarm)]

    assert sum(start > 12.0 for start in starts(trace)) < 10  # of 24 ramps
    onsets = np.arange(13.3, 28.0)
    own = 0
    for onset in onsets:
        push = Added(float(onset), 0.5, (0.6 * level[0], 0.0, 0.0), "push")
        found = starts(add_contact(trace, GAIN, push))
        own += any(onset < start < onset + 0.3 for start in found)
    # The others begin while an alarm of joint 2 is up.
    assert own > len(onsets) / 2


def test_a_blow_counts_once_it_lasts_and_a_gap_confirms_nothing(alarm):
    """Long at rest: the third sample of 10 ms is confirmed, a second one after a gap is not."""
    trace, level = record(7, dwell=(6.0, 24.0)), alarm.detector.bound.friction
    blow = add_contact(trace, GAIN, Added(16.0, 0.1, tuple(1.5 * level), "push"))
    score = alarm.detector.scores(blow)
    first = np.flatnonzero((score >= 1.0) & (trace.t > 16.0))[0]
    assert (score[first : first + 2] == 1.0).all()
    assert score[first + 2] > 1.0
    late = np.where(np.arange(len(trace.t)) > first, 0.05, 0.0)
    stretched = alarm.detector.scores(replace(blow, t=blow.t + late))
    assert (stretched[first : first + 2] == 1.0).all()


def test_a_stop_confirms_the_short_contact_before_it_and_is_none(fitted):
    """80 ms against the fastest joint, 1.35 times its bound, then a stop within 0.15 s."""
    detector, through = fitted.carrying(Load()), record(8, dwell=(99.0, 100.0))
    bound, found = detector.judge(through).bound, []
    for stop in np.arange(5.0, 20.0, 1.0):
        stopping, k = record(8, dwell=(stop, stop + 3.0), ramp=0.15), round(100 * (stop - 0.1))
        speed = stopping.qd[k] * (np.abs(stopping.qd[k]) == np.abs(stopping.qd[k]).max())
        if np.abs(speed).max() > 0.3:
            against = tuple(-1.35 * np.sign(speed) * bound[k])
            contact = Added(stop - 0.14, 0.08, against, "push")
            logs = stopping, *(add_contact(log, GAIN, contact) for log in (through, stopping))
            found.append([(detector.scores(log)[k - 8 : k + 60] > 1).any() for log in logs])
    assert len(found) > 8
    assert np.mean(found, axis=0)[:2].tolist() == [0, 0]
    assert np.mean(found, axis=0)[2] >= 0.9


def test_a_stop_confirms_the_joint_that_was_nearest_to_its_bound(fitted):
    """80 ms on all joints, 1.35 times the bound of one of them, 1.05 times those of the others."""
    detector = fitted.carrying(Load())
    bound, right = detector.judge(record(8, dwell=(99.0, 100.0))).bound, []
    for stop in np.arange(5.0, 20.0, 2.5):
        stopping, k = record(8, dwell=(stop, stop + 3.0), ramp=0.15), round(100 * (stop - 0.1))
        for strong in range(3):
            part = np.where(np.arange(3) == strong, 1.35, 1.05)
            torque = tuple(-part * np.sign(stopping.qd[k]) * bound[k])
            struck = add_contact(stopping, GAIN, Added(stop - 0.14, 0.08, torque, "push"))
            confirmed = detector.judge(struck).ratio[k - 8 : k + 60] > 1
            first = confirmed[confirmed.any(axis=1)][:1]
            right += [np.flatnonzero(row).tolist() == [strong] for row in first]
    assert len(right) > 12
    assert np.mean(right) >= 0.9


def test_each_sample_says_which_joint_hides_contacts():
    """Joint c stands in all logs; it turns from 14 to 15 s, and then stands elsewhere."""
    detector = FreeMotion().fit([held_joint(k) for k in range(3)], ArmModel(nominal(), GAIN))
    trace = held_joint(7)
    q, qd, t = trace.q.copy(), trace.qd.copy(), trace.t
    q[:, 2] += 0.6 * np.clip(t - 14.0, 0.0, 1.0)
    qd[:, 2] += np.where((t > 14.0) & (t < 15.0), 0.6, 0.0)
    judged = detector.judge(replace(trace, q=q, qd=qd))
    hides = judged.hides
    moving, later = (t > 14.02) & (t < 14.98 + REGIME_SETTLES), t > 15.03 + REGIME_SETTLES
    assert (hides[t < 14.0] == 0).all()
    assert (hides[moving] == [0, 0, HIDES_BY_MOTION]).all()
    assert (hides[later] == [0, 0, HIDES_BY_PLACE]).all()
    assert not (judged.ratio[moving] > 0).any()


def test_few_seconds_leave_the_friction_level_unsure(fitted):
    logs = [Recording(record(seed)) for seed in range(3)]
    short = [Recording(record(0, seconds=12.0))]
    for long, few in zip(
        friction_levels(fitted.arm, logs), friction_levels(fitted.arm, short), strict=True
    ):
        assert (few > 1.5 * long).all()


def test_letting_go_is_no_new_push(alarm):
    trace = record(7, dwell=(6.0, 24.0))
    for seconds in (0.4, 0.8):
        pushed = add_contact(trace, GAIN, Added(12.0, seconds, (8.0, 8.0, 4.0), "push"))
        found = alarm.detect(pushed).alarms
        assert len(found) == 1
        assert found[0].end < 12.0 + seconds + 0.1


def test_friction_counts_at_the_load_that_the_logs_show(fitted):
    bare = fitted.arm.friction.coulomb()
    assert (fitted.bound.friction >= 0.99 * bare).all()


def test_scores_do_not_depend_on_what_comes_after(alarm):
    trace = record(7)
    whole = alarm.detector.scores(trace)
    rows = slice(None, 900)
    part = replace(
        trace, t=trace.t[rows], q=trace.q[rows], qd=trace.qd[rows], current=trace.current[rows]
    )
    assert np.array_equal(alarm.detector.scores(part), whole[rows])


def test_the_stream_gives_the_same_bits(alarm):
    trace = record(7, seconds=4.0)
    stream, steps = alarm.detector.stream(), np.diff(trace.t, prepend=trace.t[0] - trace.dt)
    steps[0] = alarm.detector.dt
    online = [
        stream.step(*one) for one in zip(trace.q, trace.qd, trace.current, steps, strict=True)
    ]
    assert np.array_equal(online, alarm.detector.scores(trace))


def test_an_untold_load_is_found_from_motion_and_a_told_one_is_no_contact(fitted):
    trace = record(9, load=2.0)
    untold = CollisionAlarm(fitted, 1.0, CONFIRMATION)
    assert untold.detect(trace).alarms == ()
    told = carrying(untold, Load(2.0, (0.3, 0.0, 0.05)))
    assert told.detect(trace).alarms == ()
    # Told nothing, 2 kg on a light arm are a contact.
    assert carrying(untold, Load()).detect(trace).alarms


def test_a_faster_log_than_training_s_is_quiet_and_its_push_is_found(alarm):
    fast = record(7, dt=0.002, seconds=6.0)
    assert alarm.detect(fast).alarms == ()
    struck = add_contact(fast, GAIN, Added(4.0, 0.5, (12.0, 12.0, 6.0), "push"))
    assert 4.0 < alarm.detect(struck).alarms[0].start < 4.3


def test_the_file_gives_the_same_alarms(alarm, tmp_path):
    save_model(alarm, tmp_path / "model.tauguard")
    trace = record(7, seconds=10.0)
    again = load_model(tmp_path / "model.tauguard")
    assert np.array_equal(again.scores(trace), alarm.scores(trace))


def test_thirty_seconds_in_one_log_are_enough():
    one = FreeMotion().fit([Recording(record(1, seconds=30.0))], ArmModel(nominal(), GAIN))
    assert one.seconds == pytest.approx(30, abs=0.1)


def test_the_card_counts_what_the_bounds_are(fitted):
    card = threshold_card(fitted, [record(0)], CrossValidation((), (), ()))
    assert (card.standing < card.moving).all()
    assert (card.moving < card.starting).all()
    assert card.tool["standing"][0] < card.tool["moving"][0]
    assert "standing for 2 s" in card.unseen
    assert set(card.unseen["moving alone"]) == {"a", "b", "c"}
    fast = np.array([0.51, np.nan, 2.0])
    assert (card.fast == fitted.bound.fast).all()
    said = " ".join(text(replace(card, fast=fast, twice=np.array([7.4, 8.0, 9.6]))).split())
    assert "of the logs (a 0.51, c 2 rad/s); at twice these from 7, 10 N m" in said
    assumed = "standing: if the torques in brackets hold" in said
    assert assumed == any(joint in card.unseen["standing for 2 s"] for joint in card.joints)
    still = text(replace(card, unseen={}))
    assert "in brackets" not in still
    assert card.franka == {} == card.ur  # libfranka speaks to arms of seven joints, UR builds six
    arms = {n: replace(card, joints=tuple("abcdefg"[:n]), moving=np.ones(n)) for n in (6, 7)}
    arms[7] = replace(arms[7], starting=np.ones(7))
    assert arms[6].ur["tool_force_limit_n"] > 0
    arms = {n: replace(arm, linear=("b",)) for n, arm in arms.items()} | {70: arms[7]}
    assert not arms[7].franka
    assert not arms[6].ur
    said = text(replace(card, linear=("c",), fast=fast, twice=np.array([7.4, 8.0, 9.6])))
    assert [line.split("  ")[0] for line in said.splitlines()[2:5]] == ["a", "b", "c [N]"]
    assert "(a 0.51 rad/s, c 2 m/s); at twice these from 7 N m, 10 N" in " ".join(said.split())
    once = text(replace(card, replay=(1, 0)))
    assert "raised 1 contact in these logs" in " ".join(once.split())
    seven = arms[70].franka
    assert {len(v) for k, v in seven.items() if "torque" in k} == {7}
    assert {len(v) for k, v in seven.items() if "force" in k} == {6}
    assert card.false_alarms_per_hour["high"] > 0


def test_the_card_s_thresholds_are_replayed_on_the_logs(fitted):
    trace, high = record(4), np.full(3, 1e3)
    assert replayed(fitted, [trace], high, high) == (0, 0)
    held = add_contact(trace, GAIN, Added(8.0, 1.0, (130.0, 0.0, 0.0), "push"))
    twice = add_contact(held, GAIN, Added(14.0, 1.0, (200.0, 0.0, 0.0), "push"))
    level = np.array([100.0, 1e3, np.nan])
    assert replayed(fitted, [held, twice], level, level) == (3, 1)


def test_other_joints_are_refused(alarm):
    trace = record(7, seconds=4.0)
    one = replace(
        trace,
        joint_names=("a",),
        q=trace.q[:, :1],
        qd=trace.qd[:, :1],
        current=trace.current[:, :1],
    )
    with pytest.raises(ValueError, match="the trace has 1 joints, this detector 3"):
        alarm.detector.scores(one)


def test_what_the_card_promises_in_motion_is_found(fitted, alarm):
    """Pushes of the promised size, added to logs that training has not seen."""
    traces = [record(seed) for seed in range(3)]
    moving = threshold_card(fitted, traces, CrossValidation((), (), ())).moving
    rng, found = np.random.default_rng(4), []
    for trace in (record(7), record(8)):
        for start in rng.uniform(2.0, 7.0, 12):
            for joint in range(3):
                torque = moving * np.eye(3)[joint] * rng.choice([-1, 1])
                push = Added(float(start), 0.4, tuple(torque), "push")
                alarms = alarm.detect(add_contact(trace, GAIN, push)).alarms
                found.append(any(start < one.start < start + 0.6 for one in alarms))
    assert np.mean(found) >= 0.9


def test_a_load_is_asked_for_only_if_it_was_not_given(alarm):
    """A load of 4 kg that is not there: most of the log is in alarm."""
    wrong, trace = carrying(alarm, Load(4.0)), record(9, seconds=10.0)
    for given, verb in ((False, "give"), (True, "check")):
        (note,) = detect_in_log(wrong, trace, given).findings.of("many-alarms")
        assert f"{verb} the load (`payload=`)" in note.text
