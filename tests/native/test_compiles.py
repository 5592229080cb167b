"""The native tests, which `.ci/sanitize` and `.ci/fuzz` run by hand, compile."""

import os
import shutil
import subprocess
from pathlib import Path

import mujoco
import pytest

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
INCLUDED = [
    HERE,
    ROOT / "geometry/include",
    ROOT / "rigid/include",
    *(ROOT / room / "src" for room in ("cloth", "rigid", "envs", "contacts", "detectors")),
    Path(mujoco.__path__[0]) / "include",
]


@pytest.mark.parametrize("source", sorted(HERE.rglob("*.cpp")), ids=lambda path: path.stem)
def test_compiles(source: Path) -> None:
    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    flags = ["-std=c++17", "-fsyntax-only", *(f"-I{folder}" for folder in INCLUDED)]
    done = subprocess.run([compiler, *flags, str(source)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
