"""Read logs as the flags of commands say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard import Detector, Log, Logs
    from tauguard.datasets import Reading


def read_free(
    logs: Sequence[Path],
    robot: Path,
    columns: str | None,
    payload: Sequence[str],
    torque: bool,
    reading: Reading,
) -> Logs:
    """The logs of a real arm."""
    import tauguard as tg
    from tauguard.cli.payload import loads

    return tg.read_logs(
        logs,
        columns,
        robot=robot,
        payload=loads(payload),
        torque=torque,
        mend=reading.mend,
        resample=reading.resample,
    )


def read_one(
    log: Path, robot: Path | Detector | None, columns: str | None, torque: bool, reading: Reading
) -> Log:
    """One log of a real arm."""
    import tauguard as tg

    return tg.read_log(
        log, columns, robot=robot, torque=torque, mend=reading.mend, resample=reading.resample
    )
