"""Identity of the code that computes a dataset: versions, sources and a short episode's bits."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable

import numpy as np

#: Folders and files whose sources decide an episode's bytes. :func:`computed_bits` covers the
#: native code.
_SOURCES = (
    "models", "envs", "traces/trace.py", "datasets/configuration.py",
    "datasets/configuration_checks.py", "datasets/plans.py", "datasets/robots.py",
    "datasets/schedule.py", "datasets/shard.py", "datasets/columns_of_shards.py",
)  # fmt: skip
_LIBRARIES = ("mujoco", "numpy", "pin", "pyarrow")


@functools.cache
def versions() -> dict[str, str]:
    """Versions of tauguard and of the libraries that can change an episode's bytes."""
    return {name: importlib.metadata.version(name) for name in ("tauguard", *_LIBRARIES)}


def sources() -> str:
    """SHA-256 of the sources that decide an episode's bytes."""
    return _digest(_SOURCES)


def detection_sources() -> tuple[str, str]:
    """SHA-256 of the simulation's sources, and of the detectors' sources."""
    return sources(), _digest(("detectors",))


@functools.cache
def _digest(places: tuple[str, ...]) -> str:
    """SHA-256 over files, and over the Python, TOML and XML files of folders."""
    digest = hashlib.sha256()
    for place in places:
        for name, entry in _files(files("tauguard").joinpath(place), place):
            content = entry.read_bytes()
            digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def _files(entry: Traversable, name: str) -> Iterator[tuple[str, Traversable]]:
    if entry.is_file():
        yield name, entry
        return
    for inner in sorted(entry.iterdir(), key=lambda e: e.name):
        folder = inner.is_dir() and inner.name not in ("__pycache__", "src", "dm")
        if folder or inner.name.endswith((".py", ".toml", ".xml")):
            yield from _files(inner, f"{name}/{inner.name}")


@functools.cache
def computed_bits() -> str:
    """SHA-256 of a short episode on this machine; another processor may round differently."""
    from tauguard.detectors import RobotNumbers, observe
    from tauguard.envs import Episode, Simulation
    from tauguard.models import Mismatch, pin_model

    episode = Episode(seed=1, seconds=0.5, speed=60, payload_g=1000, mismatch=Mismatch(seed=1))
    simulation = Simulation(episode)
    trace = simulation.run()
    robot = RobotNumbers.from_pin(pin_model(simulation.scene.arm_xml))
    tau = trace.current * simulation.nominal.gain
    residual = observe(robot, trace.t, trace.q, trace.qd, tau, 50.0, threads=1)
    parts = (trace.q, trace.qd, trace.current, residual)
    return hashlib.sha256(b"".join(np.ascontiguousarray(p).tobytes() for p in parts)).hexdigest()


@functools.cache
def code() -> str:
    """SHA-256 of :func:`versions`, :func:`sources` and :func:`computed_bits` together."""
    text = "\n".join([*(f"{k} {v}" for k, v in versions().items()), sources(), computed_bits()])
    return hashlib.sha256(text.encode()).hexdigest()
