"""Identity of the code that computes a dataset: versions, sources and a short episode's bits."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
from importlib.resources import files
from importlib.resources.abc import Traversable

import numpy as np

#: Sources that decide an episode's bytes. :func:`computed_bits` covers the native code.
_PACKAGES = ("models", "envs")
_FILES = {
    "traces": ("trace.py", "severity.py"),
    "datasets": (
        "configuration.py",
        "configuration_checks.py",
        "plans.py",
        "robots.py",
        "schedule.py",
        "shard.py",
        "columns_of_shards.py",
    ),
}
_LIBRARIES = ("mujoco", "numpy", "pin", "pyarrow")


@functools.cache
def versions() -> dict[str, str]:
    """Versions of tauguard and of the libraries that can change an episode's bytes."""
    return {name: importlib.metadata.version(name) for name in ("tauguard", *_LIBRARIES)}


@functools.cache
def sources() -> str:
    """SHA-256 of the sources that decide an episode's bytes."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        _add_tree(digest, files(f"tauguard.{package}"), package)
    for package, names in _FILES.items():
        for name in names:
            _add(digest, f"{package}/{name}", files(f"tauguard.{package}").joinpath(name))
    return digest.hexdigest()


def detection_sources() -> tuple[str, str]:
    """SHA-256 of the simulation's sources, and of the detectors' sources."""
    return sources(), tree_digest("detectors")


@functools.cache
def tree_digest(package: str) -> str:
    """SHA-256 over the Python, TOML and XML sources of one folder of the package."""
    digest = hashlib.sha256()
    _add_tree(digest, files(f"tauguard.{package}"), package)
    return digest.hexdigest()


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


def _add_tree(digest: hashlib._Hash, folder: Traversable, name: str) -> None:
    for entry in sorted(folder.iterdir(), key=lambda e: e.name):
        if entry.is_dir() and entry.name not in ("__pycache__", "src", "dm"):
            _add_tree(digest, entry, f"{name}/{entry.name}")
        elif entry.name.endswith((".py", ".toml", ".xml")):
            _add(digest, f"{name}/{entry.name}", entry)


def _add(digest: hashlib._Hash, name: str, entry: Traversable) -> None:
    text = entry.read_bytes()
    digest.update(f"{name} {len(text)}\n".encode() + text)
