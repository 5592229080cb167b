"""Damaged files of every format that tauguard reads: each ends in an answer or in one line.

``python -m tauguard.benchmarks.mutants --count 10000`` prints a row a format; the tests try a few.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

#: No small file may take longer to read [s], nor grow the process by more [bytes].
MOST_SECONDS, MOST_GROWTH = 10.0, 1 << 30
COLUMNS = {"t": 0, "q": [1, 2], "qd": [3, 4], "current": [5, 6], "repair": ["nan"]}
ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="j" range="-1 1"/>
<geom size="0.1 0.2" type="capsule" mass="1"/><body name="b" pos="0 0 0.4"><joint name="k"
axis="1 0 0"/><geom size="0.1" mass="2"/></body></body></worldbody></mujoco>"""
URDF = """<robot name="two"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia
ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j"
type="continuous"><parent link="base"/><child link="l"/><axis xyz="0 0 1"/></joint></robot>"""


@dataclass(frozen=True)
class Outcome:
    """What became of one damaged file."""

    said: str  #: "read", "refused", or what was wrong
    message: str
    seconds: float

    @property
    def ok(self) -> bool:
        """An answer or one line, in time and in memory."""
        return self.said in ("read", "refused")


def _read_csv(path: Path) -> object:
    from tauguard.datasets import ColumnMap, read_log

    return read_log(path, ColumnMap(t=0, q=(1, 2), qd=(3, 4), current=(5, 6)))


def _read_mcap(path: Path) -> object:
    from tauguard.datasets import read_log

    return read_log(path)


def _read_columns(path: Path) -> object:
    from tauguard.strangers import read_json

    return read_json(path)


def _read_robot(path: Path) -> object:
    from tauguard.models.nominal import pin_model

    return pin_model(path)


def _read_toml(path: Path) -> object:
    from tauguard.datasets.configuration import load

    return load(path)


def _read_model(path: Path) -> object:
    from tauguard.detectors import load_model

    return load_model(path)


#: Ending of a format's file, and what reads it.
FORMATS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "csv": ("csv", _read_csv),
    "mcap": ("mcap", _read_mcap),
    "json": ("json", _read_columns),
    "mjcf": ("xml", _read_robot),
    "urdf": ("urdf", _read_robot),
    "toml": ("toml", _read_toml),
    "model": ("skops", _read_model),
}


def originals(folder: Path) -> dict[str, Path]:
    """A small intact file of every format."""
    from importlib.resources import files

    from tauguard.datasets import free_episodes
    from tauguard.detectors import ArmModel, CollisionAlarm, RobotNumbers, save_model
    from tauguard.detectors.methods.current_threshold import CurrentThreshold
    from tauguard.envs import simulate
    from tauguard.models import cura6, cura6_drive, pin_model
    from tauguard.traces import write_mcap

    found = {kind: folder / f"original-{kind}.{ending}" for kind, (ending, _) in FORMATS.items()}
    t = np.arange(300) * 0.01
    q = np.stack([np.sin(t), np.cos(t)], axis=1)
    qd = np.stack([np.cos(t), -np.sin(t)], axis=1)
    np.savetxt(found["csv"], np.c_[t, q, qd, q], delimiter=",")
    trace = simulate(free_episodes(0, 1, 4.0, (30.0,), (0.0,), None)[0])
    write_mcap(found["mcap"], trace)
    found["json"].write_text(json.dumps(COLUMNS))
    found["mjcf"].write_text(ARM)
    found["urdf"].write_text(URDF)
    named = files("tauguard.datasets").joinpath("named/tauguard-collisions-v1.toml")
    found["toml"].write_text(named.read_text())
    arm = ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), np.array(cura6_drive().gain))
    save_model(CollisionAlarm(CurrentThreshold().fit([trace], arm), 1.0), found["model"])
    return found


def mutant(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to three damages."""
    for _ in range(int(rng.integers(1, 4))):
        at, end = sorted(int(x) for x in rng.integers(0, len(data) + 1, 2))
        blocks = (
            bytes(rng.integers(0, 256, 8).astype(np.uint8)),
            *(b"9" * 400, b"[" * 5000, b"{" * 5000, b"<a>" * 5000, b'"', b"nan", b"-1e999"),
            *(b"\x00", b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"null", b"../", b"1e160"),
        )
        block = blocks[int(rng.integers(len(blocks)))]
        kind = int(rng.integers(5))
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            data = data[:at] + block + data[at:]
        elif kind == 2:
            data = data[:at] + block + data[at + len(block) :]
        elif kind == 3:
            data = data[:at] + data[end:]
        else:
            data = data[:end] + data[at:end] + data[end:]
    return data


def tried(kind: str, original: Path, folder: Path, rng: np.random.Generator) -> Outcome:
    """Reads one mutant of ``original`` in this process."""
    ending, read = FORMATS[kind]
    path = folder / f"mutant.{ending}"
    path.write_bytes(mutant(original.read_bytes(), rng))
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    said, message = "read", ""
    try:
        read(path)
    except (ValueError, OSError) as error:
        said, message = "refused", str(error)
    except Exception as error:
        said, message = type(error).__name__, str(error)[:300]
    seconds = time.monotonic() - start
    growth = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if seconds > MOST_SECONDS:
        said = f"took {seconds:.0f} s"
    elif growth > MOST_GROWTH:
        said = f"took {growth >> 20} MiB"
    return Outcome(said, message, seconds)


def main() -> None:
    """Prints what became of the mutants, a row a format."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--formats", nargs="*", default=list(FORMATS))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        files = originals(Path(name))
        for number, kind in enumerate(args.formats):
            rng = np.random.default_rng((args.seed, number))
            count = args.count // len(args.formats)
            outcomes = [tried(kind, files[kind], Path(name), rng) for _ in range(count)]
            slowest = max(outcome.seconds for outcome in outcomes)
            found = dict(Counter(outcome.said for outcome in outcomes))
            print(f"{kind:8} {count:6} mutants, slowest {slowest:.2f} s: {found}", flush=True)
            for bad in {outcome.said: outcome for outcome in outcomes if not outcome.ok}.values():
                print(f"         {bad.said}: {bad.message}")


if __name__ == "__main__":
    main()
