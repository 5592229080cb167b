"""Score a checker in one run against the ground truth and MuJoCo."""

import itertools
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.checker import KINDS, Contacts, geom_kinds
from tauguard.contacts.ground_truth import TOLERANCE, Event, Pair, Touches, events, pair_of
from tauguard.contacts.report import Disagreement, Outcome, Score, pair_names
from tauguard.contacts.run import TOUCHING, Run

Covers = frozenset[tuple[str, str]]
#: Depth [m] of each contact, half the thickness of its thinner geom [m] and its normal, by the ids
#: of its geoms, flexes and features.
_Rows = dict[tuple[int, ...], tuple[float, float, NDArray[np.float64]]]


def score(model: Any, name: str, covers: Covers, judged: Covers | None, run: Run) -> Score:
    """Precision, recall, lead, differences and cost of one checker.

    Recall counts events. An event is a contact of two partners from the first touch to separation;
    events that stay within the tolerance are not counted. Precision counts reports. A report is a
    step and two partners whose surfaces touch in it; contacts within a margin are not counted.
    Precision and recall count only kinds of pairs that both the checker and the ground truth cover.
    All other metrics count every kind that the checker covers.
    """
    kinds = geom_kinds(model)
    given = run.contacts[name]
    mine = [one.where(_mask(one.geom, kinds, covers)) for one in given]
    reports = _reports(model, run.times, mine)
    counted: dict[str, Any] = {}
    wrong: list[Disagreement] = []
    if judged is not None:
        both = covers & judged
        touches = [_covered(v, kinds, both) for v in run.touches]
        truth = [e for e in events(model, run.times, touches) if e.counts]
        step = float(model.opt.timestep)
        seen = [e.seen(reports.get(e.pair, []), step) for e in truth]
        asked = [one.where(_mask(one.geom, kinds, both)) for one in mine]
        right, total, false = _precision(model, run, asked, touches)
        positive, found = _steps(model, mine, touches)
        counted = {
            "events": len(truth),
            "recalled": sum(seen),
            "reports": total,
            "correct": right,
            "steps": positive,
            "steps_found": found,
            "delay_ms": _delay(truth, reports, step),
        }
        wrong = [
            Disagreement(name, "missed", e.onset, pair_names(model, e.pair), e.depth)
            for e, ok in zip(truth, seen, strict=True)
            if not ok
        ] + [Disagreement(name, "false", t, pair_names(model, p), d) for t, p, d in false]
    theirs = run.contacts["mujoco"]
    depth, angle = _differences(mine, theirs) if given is not theirs else ([], [])
    low, middle, high = 1e6 * np.quantile(run.seconds[name], [0.1, 0.5, 0.9])
    return Score(
        checker=name,
        **counted,
        first=min((times[0] for times in reports.values()), default=None),
        lead_ms=_lead(reports, _reports(model, run.times, theirs)),
        depth_mm=1e3 * float(np.median(depth)) if depth else None,
        normal_deg=float(np.degrees(np.median(angle))) if angle else None,
        normals=len(angle),
        opposite=sum(one > np.pi / 2 for one in angle),
        us_per_step=float(middle),
        us_low=float(low),
        us_high=float(high),
        over_mj_step=float(np.median(run.seconds[name]) / np.median(run.step_seconds)),
        not_covered=sum(map(len, given)) - sum(map(len, mine)),
        disagreements=tuple(sorted(wrong, key=lambda d: d.time)),
    )


def judge(
    model: Any, times: Sequence[float], touches: Sequence[Touches], mine: Sequence[Contacts]
) -> tuple[Outcome, ...]:
    """Whether MuJoCo listed each event, and whether the contact held.

    A contact held if MuJoCo listed it, its depth stayed below half the thickness of the thinner
    partner (planes and cloth have no limit), and no normal reversed from one step to the next.
    """
    if not touches:
        return ()
    step = float(model.opt.timestep)
    reports = _reports(model, times, mine)
    tracks = _tracks(model, times, mine)
    out = []
    for event in events(model, times, touches):
        if not event.counts:
            continue
        generated = event.seen(reports.get(event.pair, []), step)
        track = [
            rows
            for time, rows in tracks.get(event.pair, [])
            if event.onset - step <= time <= event.end + step
        ]
        held = generated and not any(_passed(*two) for two in itertools.pairwise([{}, *track]))
        out.append(Outcome(pair_names(model, event.pair), event.onset, event.end, generated, held))
    return tuple(out)


def _touching(contacts: Contacts) -> Contacts:
    return contacts.where(contacts.distance <= TOUCHING)


def _reports(
    model: Any, times: Sequence[float], steps: Sequence[Contacts]
) -> dict[Pair, list[float]]:
    """Times of all reports of each pair, in rising order [s]."""
    out: dict[Pair, list[float]] = defaultdict(list)
    for k, contacts in enumerate(steps):
        first: dict[Pair, float] = {}
        touching = _touching(contacts)
        for geom, flex, t in zip(touching.geom, touching.flex, touching.time, strict=True):
            pair = pair_of(model, geom, flex)
            first[pair] = min(first.get(pair, np.inf), float(t))
        for pair, t in first.items():
            out[pair].append(times[k] + t * (times[k + 1] - times[k]))
    return dict(out)


def _covered(touches: Touches, kinds: Sequence[str], covers: Covers) -> Touches:
    keep = _mask(touches.geom, kinds, covers)
    fields = ("geom", "flex", "time", "depth", "counts")
    return Touches(*(getattr(touches, name)[keep] for name in fields))


def _mask(geom: Any, kinds: Sequence[str], covers: Covers) -> NDArray[np.bool_]:
    """Mask of the rows whose pairs are in ``covers``; a partner without a geom (-1) is a flex."""
    codes = np.array([KINDS.index(kind) for kind in (*kinds, "flex")])  # -1 finds the last
    table = np.zeros((len(KINDS), len(KINDS)), dtype=bool)
    for a, b in covers:
        i, j = KINDS.index(a), KINDS.index(b)
        table[i, j] = table[j, i] = True
    rows = np.asarray(geom, dtype=np.intp).reshape(-1, 2)
    return np.asarray(table[codes[rows[:, 0]], codes[rows[:, 1]]], dtype=bool)


def _pairs(model: Any, geom: Any, flex: Any) -> list[Pair]:
    return [pair_of(model, g, f) for g, f in zip(geom, flex, strict=True)]


def _precision(
    model: Any, run: Run, mine: Sequence[Contacts], touches: Sequence[Touches]
) -> tuple[int, int, list[tuple[float, Pair, float]]]:
    """Numbers of correct and of all reports, and the false ones as (time, pair, depth)."""
    right = total = 0
    false = []
    for k, (contacts, touch) in enumerate(zip(mine, touches, strict=True)):
        touching = _touching(contacts)
        said: dict[Pair, float] = {}
        rows = zip(_pairs(model, touching.geom, touching.flex), touching.distance, strict=True)
        for pair, distance in rows:
            said[pair] = min(said.get(pair, np.inf), float(distance))
        true = set(_pairs(model, touch.geom, touch.flex))
        for pair, distance in said.items():
            total += 1
            if pair in true or distance > -TOLERANCE:
                right += 1  # a report no deeper than the tolerance counts as correct
            else:
                false.append((run.times[k], pair, -distance))
    return right, total, false


def _steps(model: Any, mine: Sequence[Contacts], touches: Sequence[Touches]) -> tuple[int, int]:
    """Number of touches (a step and a pair) beyond the tolerance, and how many were reported."""
    positive = found = 0
    for contacts, touch in zip(mine, touches, strict=True):
        true = {
            pair
            for pair, counts in zip(
                _pairs(model, touch.geom, touch.flex), touch.counts, strict=True
            )
            if counts
        }
        if true:
            touching = _touching(contacts)
            positive += len(true)
            found += len(true & set(_pairs(model, touching.geom, touching.flex)))
    return positive, found


def _delay(truth: Sequence[Event], reports: dict[Pair, list[float]], step: float) -> float | None:
    """Median time from the onset of an event to its first report [ms]."""
    delays = []
    for event in truth:
        times = [
            t for t in reports.get(event.pair, []) if event.onset - step <= t <= event.end + step
        ]
        if times:
            delays.append(1e3 * (times[0] - event.onset))
    return float(np.median(delays)) if delays else None


def _lead(mine: dict[Pair, list[float]], theirs: dict[Pair, list[float]]) -> float | None:
    """Median time by which a pair's first report is earlier than MuJoCo's [ms]."""
    leads = [1e3 * (theirs[pair][0] - mine[pair][0]) for pair in mine if pair in theirs]
    return float(np.median(leads)) if leads else None


def _differences(
    mine: Sequence[Contacts], theirs: Sequence[Contacts]
) -> tuple[list[float], list[float]]:
    """Differences of depth [m] from MuJoCo, and angles between both normals [rad].

    For each pair (and element) the deepest contact that MuJoCo lists at the end of a step is
    compared with the checker's deepest contact at the same state: at the end of this step or at the
    start of the next one.
    """
    depth, angle = [], []
    for k, there in enumerate(theirs):
        late = mine[k].where(mine[k].time == 1)
        early = [one.where(one.time == 0) for one in mine[k + 1 : k + 2]]
        both = Contacts.concatenate([late, *early])
        ours = _deepest(both.where(both.distance < 0))
        for key, (distance, normal) in _deepest(there.where(there.distance < 0)).items():
            if key in ours:
                depth.append(abs(distance - ours[key][0]))
                angle.append(float(np.arccos(np.clip(normal @ ours[key][1], -1, 1))))
    return depth, [one for one in angle if not np.isnan(one)]


def _deepest(contacts: Contacts) -> dict[tuple[Any, ...], tuple[float, NDArray[np.float64]]]:
    """Distance and normal of each pair's deepest contact, with the lower ids as first partner."""
    out: dict[tuple[Any, ...], tuple[float, NDArray[np.float64]]] = {}
    element = np.where(contacts.flex >= 0, contacts.feature, -1)
    partners = np.stack([contacts.geom, contacts.flex, element], axis=2).tolist()
    for k in np.argsort(-contacts.distance):
        first, second = map(tuple, partners[k])
        sign = 1 if first <= second else -1
        key = (first, second)[::sign]
        out[key] = (float(contacts.distance[k]), sign * contacts.normal[k])
    return out


def _passed(before: _Rows, rows: _Rows) -> bool:
    """Whether partners passed through: a contact is too deep, or its normal has reversed."""
    if any(depth >= inner for depth, inner, _ in rows.values()):
        return True
    return any(before[key][2] @ rows[key][2] < 0 for key in before.keys() & rows.keys())


def _tracks(
    model: Any, times: Sequence[float], steps: Sequence[Contacts]
) -> dict[Pair, list[tuple[float, _Rows]]]:
    """For each pair, the end time of each step in which it touches, and the rows of this step."""
    inner = _inner_radius(model)
    out: dict[Pair, list[tuple[float, _Rows]]] = defaultdict(list)
    for k, contacts in enumerate(steps):
        touching = contacts.where(contacts.distance <= 0)
        found: dict[Pair, _Rows] = defaultdict(dict)
        for i in np.argsort(-touching.distance):
            geom, flex = touching.geom[i], touching.flex[i]
            thin = min((inner[g] for g in geom if g >= 0), default=np.inf)
            key = (*geom.tolist(), *flex.tolist(), *touching.feature[i].tolist())
            row = (-float(touching.distance[i]), thin, touching.normal[i])
            found[pair_of(model, geom, flex)][key] = row
        for pair, rows in found.items():
            out[pair].append((times[k + 1], rows))
    return dict(out)


def _inner_radius(model: Any) -> NDArray[np.float64]:
    """Half the smallest thickness of each geom [m]; inf for a plane."""
    kinds = geom_kinds(model)
    out = np.full(model.ngeom, np.inf)
    for g, kind in enumerate(kinds):
        size = model.geom_size[g]
        if kind in ("sphere", "capsule"):
            out[g] = size[0]
        elif kind == "cylinder":
            out[g] = size[:2].min()
        elif kind in ("box", "ellipsoid"):
            out[g] = size.min()
        elif kind == "mesh":
            out[g] = model.geom_aabb[g, 3:].min()
    return out
