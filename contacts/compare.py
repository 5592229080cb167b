"""Compare checkers, in one run of a scene, with MuJoCo's contacts and the ground truth."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from tauguard.contacts.checker import (
    Checker,
    Contacts,
    State,
    checker,
    geom_kinds,
    pair_kind,
    reported,
)
from tauguard.contacts.ground_truth import GroundTruth
from tauguard.contacts.mujoco_checker import MujocoChecker
from tauguard.contacts.report import Report, Score
from tauguard.contacts.run import Run
from tauguard.contacts.scenes import SCENES, ContactScene
from tauguard.contacts.scoring import judge, score
from tauguard.findings import ArgumentError

#: Largest allowed difference of a normal's length from 1.
UNIT = 1e-6


def compare(
    scene: ContactScene | mujoco.MjModel | str,
    checkers: Sequence[str] = ("mujoco", "cloth", "rigid"),
    timestep: float | None = None,
    seconds: float | None = None,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    ground_truth: bool = True,
    fine: int | None = None,
    keep: bool = False,
) -> Report:
    """Run a scene in MuJoCo and call every checker for every step.

    Checkers do not influence the run. All checkers and the ground truth get the same path, which
    :class:`tauguard.contacts.State` defines.

    Args:
        scene: A :class:`ContactScene`, a model (which starts at rest in ``qpos0``), or the name of
            one of ``SCENES``.
        checkers: Names of registered checkers.
        timestep: MuJoCo's time step [s]; ``None``: the time step of the scene.
        seconds: Duration [s]; ``None``: the duration of the scene.
        options: Keyword arguments of each checker, by the checker's name.
        ground_truth: Whether to compute true contacts, which is slow. Without them there is no
            precision or recall.
        fine: If given, MuJoCo runs the scene once more, in steps that are ``fine`` times shorter,
            until the first contact. :attr:`Score.first_error_ms` is relative to its time.
        keep: Whether the report keeps the states for a recording.

    Raises:
        ArgumentError: an unknown scene or checker; a geom that a checker or the ground truth cannot
            handle; a reported contact with an unknown geom or flex, a time outside the step, a
            distance that is not finite or a normal without unit length; options for a checker that
            is not used; a timestep or duration that is not above 0; a ``fine`` below 1.
    """
    scene = _scene(scene)
    duration = scene.seconds if seconds is None else seconds
    if not 0 < duration < np.inf:
        raise ArgumentError(f"seconds {duration}: expected a time above 0")
    if fine is not None and fine < 1:
        raise ArgumentError(f"fine {fine}: expected 1 or more fine steps per step")
    if isinstance(checkers, str | mujoco.MjData):
        raise ArgumentError(f"checkers {checkers!r}: expected a list of names, as [{checkers!r}]")
    for name in options or {}:
        if name not in checkers:
            raise ArgumentError(
                f"options of {name!r}: expected one of the checkers {', '.join(checkers)}"
            )
    model, data = scene.start(timestep)
    chosen = {
        name: checker(name, model, **dict((options or {}).get(name, {}))) for name in checkers
    }
    # Leads and depths are measured against MuJoCo's own contacts, so these are always computed.
    yardstick = chosen.get("mujoco") or MujocoChecker(model)
    truth = GroundTruth(model) if ground_truth else None
    judged = truth.covers if truth is not None else None
    run = _simulate(model, data, scene, duration, {**chosen, "mujoco": yardstick}, truth, keep)
    scores = tuple(score(model, name, one.covers, judged, run) for name, one in chosen.items())
    first = _first_contact(scene, model.opt.timestep / fine, duration) if fine else None
    if first is not None:
        scores = tuple(_beside(s, first, chosen[s.checker].covers) for s in scores)
    return _report(scene, run, scores, first[0] if first is not None else None, keep)


def _scene(scene: ContactScene | mujoco.MjModel | str) -> ContactScene:
    """The scene for a name or a model."""
    if isinstance(scene, str):
        if scene not in SCENES:
            raise ArgumentError(f"scene {scene!r}: expected one of {', '.join(SCENES)}")
        return SCENES[scene]()
    if isinstance(scene, mujoco.MjModel):
        return ContactScene("model", scene, scene.qpos0.copy(), np.zeros(scene.nv))
    return scene


def _report(
    scene: ContactScene, run: Run, scores: tuple[Score, ...], first: float | None, keep: bool
) -> Report:
    return Report(
        scene=scene.name,
        timestep=float(run.model.opt.timestep),
        steps=len(run.step_seconds),
        scores=scores,
        outcomes=judge(run.model, run.times, run.touches, run.contacts["mujoco"]),
        first_contact=first,
        disagreements=tuple(d for s in scores for d in s.disagreements),
        step_us=1e6 * float(np.median(run.step_seconds)),
        state_us=1e6 * float(np.median(run.state_seconds)),
        run=run if keep else None,
    )


def _simulate(
    model: Any,
    data: Any,
    scene: ContactScene,
    duration: float,
    checkers: Mapping[str, Checker],
    truth: GroundTruth | None,
    keep: bool,
) -> Run:
    scratch = mujoco.MjData(model)
    before = State.of(model, data, scratch)
    run = Run(model, [before.time], {name: [] for name in checkers}, states=[before])
    run.seconds = {name: [] for name in checkers}
    for _ in range(max(1, round(duration / model.opt.timestep))):
        if scene.control is not None:
            scene.control(model, data)
        clock = time.process_time()
        mujoco.mj_step(model, data)
        stepped = time.process_time()
        after = State.of(model, data, scratch)
        run.state_seconds.append(time.process_time() - stepped)
        run.step_seconds.append(stepped - clock)
        for name, one in checkers.items():
            clock = time.process_time()
            found = reported(one, before, after)
            run.seconds[name].append(time.process_time() - clock)
            run.contacts[name].append(_fitting(name, model, found))
        if truth is not None:
            run.touches.append(truth.touches(before, after))
        run.times.append(after.time)
        if keep:
            run.states.append(after)
        before = after
    return run


def _fitting(name: str, model: Any, found: Contacts) -> Contacts:
    """Return the contacts ``found`` by checker ``name`` if they are valid for the model.

    Raises:
        ArgumentError: a geom or flex that does not exist, a time outside the step, a distance that
            is not finite, or a normal that is neither NaN nor of length 1.
    """
    limits = (("geom", found.geom, -1, model.ngeom - 1), ("flex", found.flex, -1, model.nflex - 1))
    for field, value, low, high in (*limits, ("time", found.time, 0, 1)):
        good = (value >= low) & (value <= high)
        if not good.all():
            said = value[~good][0]
            raise ArgumentError(f"checker {name!r}: {field} {said}, expected {low} to {high}")
    if not np.isfinite(found.distance).all():
        said = found.distance[~np.isfinite(found.distance)][0]
        raise ArgumentError(f"checker {name!r}: distance {said}, expected a finite number [m]")
    length = np.linalg.norm(found.normal, axis=1)
    bad = ~(np.abs(length - 1) <= UNIT) & ~np.isnan(found.normal).all(axis=1)
    if bad.any():
        raise ArgumentError(
            f"checker {name!r}: normal {found.normal[bad][0].tolist()}, expected length 1, or NaN "
            "in all entries if it is unknown"
        )
    if ((found.geom < 0) == (found.flex < 0)).any():
        raise ArgumentError(
            f"checker {name!r}: a partner with a geom and a flex, or neither; expected exactly one"
        )
    return found


def _first_contact(
    scene: ContactScene, timestep: float, seconds: float
) -> tuple[float, set[tuple[str, str]]] | None:
    """Time [s] and kinds of pairs of MuJoCo's first touching contacts, at ``timestep`` [s]."""
    model, data = scene.start(timestep)
    kinds = geom_kinds(model)
    for _ in range(max(1, round(seconds / timestep))):
        if scene.control is not None:
            scene.control(model, data)
        now = float(data.time)
        mujoco.mj_step(model, data)  # it lists the contacts at the start of the step
        touching = np.flatnonzero(data.contact.dist <= 0)
        if len(touching):
            both = (
                [kinds[g] if g >= 0 else "flex" for g in data.contact.geom[k]] for k in touching
            )
            return now, {pair_kind(*names) for names in both}
    return None


def _beside(
    score: Score, first: tuple[float, set[tuple[str, str]]], covers: frozenset[tuple[str, str]]
) -> Score:
    """Add MuJoCo's first contact to the score, if the checker covers the pair."""
    if score.first is None or not first[1] & covers:
        return score
    return replace(score, first_error_ms=1e3 * (score.first - first[0]))
