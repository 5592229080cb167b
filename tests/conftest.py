"""Shared fixtures."""

import gc
import os
import pickle
import sys
from pathlib import Path

import pytest

# Many tests start processes. Where nobody lets Python keep compiled modules, each of them would
# compile 1,500 again before it begins: 4 to 8 s.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Several workers run at once. With one thread each, linear algebra takes a quarter less processor
# time than with as many threads as there are processors.
os.environ.setdefault("OMP_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]


def pytest_addoption(parser):
    parser.addoption("--slow-seed", type=int, default=0, help="seed of the slow tests")


def pytest_collection_finish():
    """Keep what every test shares out of the garbage collector's search, 0.4 s each time."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter):
    """Print what the slow tests counted."""
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    for report in reports:
        for name, found in getattr(report, "user_properties", ()):
            if name == "counts":
                figures = ", ".join(f"{key} {value}" for key, value in found.items())
                terminalreporter.write_line(f"{report.nodeid.split('::')[-1]}: {figures}")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real data; a test that asks for it carries ``@pytest.mark.data``."""
    folder = Path(os.environ.get("TAUGUARD_DATA", ROOT / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real data at {folder.name}: set TAUGUARD_DATA")
    return folder


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """``made_once(name, make)``: what one process of a parallel run makes, the others read."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return lambda name, make: make()
    import fcntl

    folder = tmp_path_factory.getbasetemp().parent

    def found(name, make):
        path = folder / f"{name}.pickle"
        with open(folder / f"{name}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            try:
                if not path.exists():
                    path.write_bytes(pickle.dumps(make()))
            finally:  # a process that was forked meanwhile holds the file open
                fcntl.flock(lock, fcntl.LOCK_UN)
        return pickle.loads(path.read_bytes())

    return found
