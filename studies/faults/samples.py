"""Every kind of fault in the samples of every arm: detection, delay and cost.

A fault of one second is put into logs that training has not seen. The answers are compared with
those on the same samples without the fault. A fault is ``seen`` if a reason is given while it lasts
or within 0.15 s after it. ``false alarms`` are collisions in or after the fault that the intact
samples do not give. ``found after`` counts the alarms of the intact samples after the recovery that
are also raised with the fault. ``silent`` is the time, from 20 ms after the fault begins, in which
the answer is "free". A collision within a fault is ``missed`` if the intact samples give it and the
answer stays "free".

The results of the real arms are optimistic: two settings were chosen on these logs, the
allowances of the position check (a velocity or time stamp one sample late) and the bounds on
torque ratios. On simulated arms only one rule was chosen: that a training load is no fault.
"""

from dataclasses import dataclass, field

import numpy as np
from tqdm import tqdm

from studies.faults.arms import ArmLogs, arms
from tauguard.detectors.alarms.monitor import COLLISION, FREE, Monitor, Spans
from tauguard.live.lateness import Lateness
from tauguard.live.packets import FAULTS, Fault, Packets
from tauguard.report import Row, rate
from tauguard.traces.trace import Trace

#: Trials of a fault per arm at random moments, and as many at collisions: full run, quick run.
MOMENTS = (8, 3)
#: A collision in a fault is missed if the answer stays "free" for this time after its alarm [s].
MISSED = 0.15
LASTS = 1.0  #: length of a fault [s]
AFTER = 2.5  #: observed time after the detector has settled again [s]
#: Faults that a sample and its neighbours show; the others need the arm's model.
PLAIN = ("frozen", "stale", "encoder", "missing", "repeated", "rate", "jump", "nan", "late")
NOTES = {
    "clean": "unchanged logs: seconds in the state fault, all of them wrong, and alarms that "
    "`detect` does not give.",
    "faults": "a fault of 1 s at random moments and at collisions; delays [ms] from its first "
    "sample. silent_s: time in the state free. missed: collisions within a fault during which "
    "the state stayed free; of_struck: collisions that the same samples show without the fault. "
    "found_after: fraction of later collisions that are found after the recovery.",
}


@dataclass
class Heard:
    """The monitor's answers to a sequence of packets."""

    spans: Spans = field(default_factory=Spans)
    reasons: list[float] = field(default_factory=list)  #: times at which a reason was given [s]
    free: list[float] = field(default_factory=list)  #: times at which the answer was "free"
    other: list[float] = field(default_factory=list)  #: times at which the answer was another one
    starts: list[float] = field(default_factory=list)  #: times at which alarms began


def heard(tested: ArmLogs, packets: Packets) -> Heard:
    """Answers of the monitor to packets, as ``listen`` counts them."""
    assert tested.alarm.inputs is not None
    monitor, out = Monitor(tested.alarm, tested.alarm.inputs), Heard()
    lateness = Lateness(tested.alarm.inputs.dt)
    up, last = False, float(packets.due[0])
    rows = zip(packets.due, packets.t, packets.q, packets.qd, packets.current, strict=True)
    for due, t, q, qd, current in rows:
        if due - last > lateness.most:
            out.reasons.append(last + lateness.most)
            out.other += np.arange(last + lateness.most, due, lateness.most).tolist()
        last = float(due)
        answer = lateness.judge(monitor.step(float(t), q, qd, current), float(t), last)
        out.spans.add(float(due), answer)
        if answer.reason:
            out.reasons.append(last)
        (out.free if answer.state == FREE else out.other).append(last)
        if answer.alarm and not up:
            out.starts.append(last)
        up = answer.alarm
    return out


@dataclass
class Tally:
    """One fault on one arm."""

    moments: int = 0
    delays: list[float] = field(default_factory=list)
    false: int = 0
    found: int = 0
    after: int = 0
    silent: float = 0.0
    struck: int = 0  #: collisions within faults
    missed: int = 0  #: collisions within faults for which the answer stayed "free"

    def add(self, tested: ArmLogs, log: str, name: str, start: float) -> None:
        """Add the answers with the fault at one moment, compared with those without the fault."""
        trace = tested.logs[log]
        settle = tested.alarm.settle
        whole = Packets.of(trace)
        inside = (whole.due >= start - settle - 1.5) & (whole.due < start + LASTS + settle + AFTER)
        intact = whole.rows(np.flatnonzero(inside))
        begin = float(intact.due[0])
        broken = Fault(name, start, LASTS).apply(whole)
        keep = (broken.due >= begin) & (broken.due <= intact.due[-1])
        a, b = heard(tested, intact), heard(tested, broken.rows(np.flatnonzero(keep)))
        self.moments += 1
        times = [t for t in b.reasons if start - 1e-9 <= t <= start + LASTS + 0.15]
        self.delays += [1e3 * (times[0] - start)] if times else []
        said = [s.start for s in b.spans.of(COLLISION)]
        true = [s.start for s in a.spans.of(COLLISION)]
        near = [(s.start, s.end) for s in a.spans.of(COLLISION)] + tested.contacts.get(log, [])
        self.false += sum(
            t >= start and not any(u - 0.3 <= t <= v + 0.3 for u, v in near) for t in said
        )
        late = [t for t in true if t > start + LASTS + settle + 0.2]
        self.after += len(late)
        self.found += sum(any(abs(t - u) < 0.1 for u in said) for t in late)
        gaps = {t for t in b.free if start + 0.02 < t < start + LASTS}  # one per arrival time
        self.silent += len(gaps) * trace.dt
        within = [t for t in true if start + 0.02 < t < start + LASTS]
        self.struck += len(within)
        self.missed += sum(not any(t <= u <= t + MISSED for u in b.other) for t in within)

    def row(self, arm: str, name: str) -> Row:
        """The fault's row of the table."""
        return {
            "study": "faults",
            "arm": arm,
            "fault": name,
            "shows in": "samples" if name in PLAIN else "torques",
            "seen": rate(len(self.delays), self.moments),
            "median_ms": float(np.median(self.delays)) if self.delays else None,
            "longest_ms": max(self.delays, default=None),
            "false_alarms": self.false,
            "found_after": rate(self.found, self.after),
            "silent_s": self.silent,
            "of_s": self.moments * (LASTS - 0.02),
            "missed": self.missed,
            "of_struck": self.struck,
        }


def measure(quick: bool, seed: int) -> list[Row]:
    """The rows of the tables ``clean`` and ``faults``."""
    rng = np.random.default_rng([seed, 15])
    rows: list[Row] = []
    for tested in arms(quick, seed):
        rows += [clean(tested, name, trace) for name, trace in tested.logs.items()]
        for name in tqdm(FAULTS, desc=tested.name, disable=None, leave=False):
            tally = Tally()
            for log, start in moments(tested, rng, MOMENTS[quick]):
                tally.add(tested, log, name, start)
            rows.append(tally.row(tested.name, name))
    rows.sort(key=lambda row: row["study"])
    return rows


def moments(tested: ArmLogs, rng: np.random.Generator, count: int) -> list[tuple[str, float]]:
    """Logs and start samples: ``count`` at random in motion, as many just before alarms."""
    margin = tested.alarm.settle
    starts, struck = {}, []
    for name, trace in tested.logs.items():
        since, whole = trace.t - trace.t[0], trace.t[-1] - trace.t[0]
        fits = (since > margin + 1.5) & (since < whole - margin - LASTS - AFTER)
        moving = fits & (np.abs(trace.qd).max(axis=1) > 0.1)  # some joint [rad/s]
        if moving.any():
            starts[name] = since[moving]
        for alarm in tested.alarms[name]:
            begin = alarm - float(trace.t[0]) - 0.5 * LASTS
            struck += [(name, begin)] if fits[np.searchsorted(since, begin)] else []
    if not starts:
        return []
    names = [str(name) for name in rng.choice(list(starts), count)]
    drawn = [(name, float(rng.choice(starts[name]))) for name in names]
    chosen = rng.permutation(len(struck))[:count]
    return drawn + [struck[k] for k in chosen]


def clean(tested: ArmLogs, name: str, trace: Trace) -> Row:
    """The row of a log without faults."""
    found = heard(tested, Packets.of(trace))
    batch = tested.alarm.detect(trace).alarm
    return {
        "study": "clean",
        "arm": tested.name,
        "log": name,
        "seconds": float(trace.t[-1] - trace.t[0]),
        "false_fault_s": len(found.reasons) * trace.dt,
        "alarms": len(found.starts),
        "alarms_of_detect": int(np.sum(np.diff(batch.astype(int), prepend=0) > 0)),
    }
