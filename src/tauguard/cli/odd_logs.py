"""Logs that are not like the others: named, and left out of training."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tauguard.detectors import ArmModel
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.detectors.methods.free_logs import JudgedLog, Sifted
    from tauguard.traces import Trace


def sifted_logs(
    traces: dict[str, Trace], recordings: Sequence[Recording], arm: ArmModel, accept: Sequence[str]
) -> tuple[dict[str, Trace], list[Recording], Sifted]:
    """The logs to learn from; prints a note on each other one, and on what differs in these.

    Args:
        traces: by file name.
        recordings: the same with their loads.
        arm: nominal numbers and drive gains.
        accept: names of logs to keep in any case.

    Raises:
        ValueError: a name of no log.
    """
    from tauguard.cli.real_logs import log_named
    from tauguard.detectors.methods.free_logs import sift

    names = list(traces)
    accepted = [log_named(name, f"--accept {name}", names) for name in accept]
    own = dict(zip(names, recordings, strict=True))
    sifted = sift(own, arm, accepted)
    for note in odd_notes(sifted):
        print(f"note: {note}")
    out = {log.name for log in sifted.left_out}
    kept = [name for name in names if name not in out]
    return {name: traces[name] for name in kept}, [own[name] for name in kept], sifted


def odd_notes(sifted: Sifted) -> list[str]:
    """A line on each log that stands out, and on each whose torques differ all along."""
    from tauguard.cli.threshold_card import times

    notes = []
    for log in sifted.left_out:
        cause = (
            f"a load (tell it with --payload {log.name}=KG or =unknown), another temperature"
            if log.throughout
            else "something touched the arm"
        )
        notes.append(
            f"{log.name} stands out: {times(log)}, judged by the other logs, which have "
            f"{_others(sifted.kept)}: {cause}, or a motion that they do not show. It is left out; "
            f"if nothing touched the arm, keep it with --accept {log.name}"
        )
    notes += [
        f"{log.name} stands out ({times(log)}) and is kept as --accept says: a contact in it "
        "raises the bounds, and others like it are then missed"
        for log in sifted.accepted
    ]
    notes += [
        f"{log.name}: its torques differ from the other logs' all along: did the arm carry "
        f"something (tell it with --payload {log.name}=KG or =unknown)?"
        for log in sifted.kept
        if log.throughout
    ]
    return notes


def _others(logs: Sequence[JudgedLog]) -> str:
    count = sum(len(log.alarms) for log in logs)
    return f"{count or 'none'} in {sum(log.seconds for log in logs) / 60:.1f} min"
