"""Studies are tried as a user runs them: through the command, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(*command, cwd, **environment):
    """The finished process, its output as text."""
    return subprocess.run(
        [sys.executable, "-m", *map(str, command)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )


@pytest.fixture
def bench(tmp_path):
    """``bench("cloth-frames")``: a quick run's JSON and what it printed."""

    def quick(name, *flags):
        files = ["--json", tmp_path / "rows.json", "--figure", tmp_path / "figure.png"]
        done = run("tauguard", "bench", name, "--quick", *files, *flags, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
        return json.loads((tmp_path / "rows.json").read_text()), done.stdout

    return quick
