"""A log played by RTDE in real time, and a detector that receives it: losses, alarms, latency.

Server and receiver of each rate are separate processes, as with ``tauguard play-ur`` and ``tauguard
listen``; all rates run at once. The alarms are compared with those that the detector gives on the
file.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.faults.arms import thinned, trained
from tauguard.datasets import read_log
from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import load_model, save_model
from tauguard.detectors.alarms.monitor import Monitor, detect_with_faults
from tauguard.envs import simulate
from tauguard.live import UrServer, UrStream
from tauguard.live.packets import Packets
from tauguard.live.session import listen
from tauguard.models import Mismatch
from tauguard.report import Row
from tauguard.report import rate as share
from tauguard.traces import write_mcap

if TYPE_CHECKING:
    from tauguard.detectors import CollisionAlarm
    from tauguard.detectors.alarms.monitor import Answer
    from tauguard.live import Sample
    from tauguard.traces import Trace


RATES = (125.0, 500.0)  #: sample rates of UR's CB and e-Series [Hz]
COLLISIONS = (195, 3)  #: number of collisions in the log of a full run and of a quick run
SECONDS, EPISODES = 20.0, 8  #: length [s] and number of the collision-free training episodes
SPEEDS = (20.0, 40.0, 60.0)  #: speeds of the training episodes [%]
PER_HOUR = 5.0  #: requested false alarms per hour
#: The serving process must answer within this time [s].
ANSWERS = 120.0

NOTES = {
    "listen": "a simulated arm with collisions, played in real time at all rates at once. "
    "events: lines about the connection. alike: fraction of the alarms of `detect` on the file "
    "that begin at the same sample. silent or late: faults with these reasons, because other "
    "programs were running. Times in us from the packet's arrival to the answer.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Return a row for each sample rate."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder, quick, seed)
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(len(RATES), context) as workers:
            return list(workers.map(heard, [folder] * len(RATES), RATES))


def write_inputs(folder: Path, quick: bool, seed: int) -> None:
    """Write a log and a detector for each rate; the seed decides the arm and its motions."""
    drawn = Mismatch(seed=2000 + seed)
    free = free_episodes(seed, EPISODES, SECONDS, SPEEDS, (0.0,), drawn)
    training = [simulate(episode) for episode in free]
    (struck,) = struck_episodes(700 + seed, 1, COLLISIONS[quick], (40.0,), (0.0,), drawn)
    log = simulate(struck)
    for rate in RATES:
        write_mcap(folder / f"{rate:g}.mcap", thinned(log, rate))
        save_model(trained(training, rate, PER_HOUR), folder / f"{rate:g}.tauguard")


def read_inputs(folder: Path, rate: float) -> tuple[CollisionAlarm, Trace]:
    """The detector and the log of a rate."""
    return load_model(folder / f"{rate:g}.tauguard"), read_log(folder / f"{rate:g}.mcap").trace


def serve(folder: Path, rate: float, pipe: Connection) -> None:
    """Play the log; send the port through the pipe, and at the end the number of packets."""
    with UrServer(Packets.of(read_log(folder / f"{rate:g}.mcap").trace), 0) as server:
        pipe.send(server.port)
        server.wait()
        pipe.send(server.sent)


@contextlib.contextmanager
def served(folder: Path, rate: float) -> Iterator[Connection]:
    """The pipe of a process that serves the log; the process ends with the block."""
    context = multiprocessing.get_context("spawn")
    mine, theirs = context.Pipe()
    process = context.Process(target=serve, args=(folder, rate, theirs), daemon=True)
    process.start()
    theirs.close()  # so that the pipe ends if the process dies
    try:
        yield mine
    finally:
        process.terminate()
        process.join()
        mine.close()


def received(pipe: Connection) -> int:
    """The next number from the serving process; ``RuntimeError`` if none comes."""
    with contextlib.suppress(EOFError, OSError):
        if pipe.poll(ANSWERS):
            return int(pipe.recv())
    raise RuntimeError("the process that plays the log does not answer")


def heard(folder: Path, rate: float) -> Row:
    """Receive the played log, and return its row."""
    alarm, trace = read_inputs(folder, rate)
    assert alarm.inputs is not None
    truth = detect_with_faults(alarm, trace).detection.alarm
    answers: list[tuple[float, bool]] = []

    def report(sample: Sample, answer: Answer) -> None:
        answers.append((sample.t, answer.alarm))

    with (
        served(folder, rate) as pipe,
        UrStream("127.0.0.1", received(pipe), rate, reconnect=0) as source,
    ):
        busy = time.process_time()
        found = listen(source, Monitor(alarm, alarm.inputs), report=report)
        busy = time.process_time() - busy
        sent, events = received(pipe), len(source.events)
    late = [s for s in found.faults() if s.reason.startswith(("late", "no samples"))]
    return {
        "study": "listen",
        "rate [Hz]": rate,
        "seconds": float(trace.t[-1] - trace.t[0]),
        "sent": sent,
        "heard": found.samples,
        "lost": sent - found.samples,
        "events": events,
        "alarms": int(np.sum(np.diff([int(up) for _, up in answers], prepend=0) > 0)),
        "alike": alike(trace.t.tolist(), truth, dict(answers)),
        "silent or late": len(late),
        **{f"{name} [us]": value for name, value in found.quantiles().items()},
        "cpu [us]": 1e6 * busy / max(1, found.samples),
    }


def alike(times: list[float], truth: NDArray[np.bool_], said: dict[float, bool]) -> dict[str, Any]:
    """The fraction of the file's alarms that begin at the same sample in the received stream.

    ``truth``: whether the file's alarm is on at each of the ``times`` [s], shape (T,). ``said``:
    whether the received stream's alarm is on, by time. An alarm is left out if its first sample, or
    the sample before, was not received.
    """
    begins = [
        k
        for k in np.flatnonzero(np.diff(truth.astype(int), prepend=0) > 0).tolist()
        if times[k] in said and (k == 0 or times[k - 1] in said)
    ]
    same = [said[times[k]] and not (k and said[times[k - 1]]) for k in begins]
    return share(sum(same), len(begins))
