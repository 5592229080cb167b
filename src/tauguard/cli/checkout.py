"""``tauguard bench`` and ``tauguard report``: run the package ``studies`` of a checkout."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import tauguard
from tauguard.findings import ArgumentError

#: Commands that `python -m studies` runs.
STUDY_COMMANDS = ("bench", "report")


def run_studies(name: str, args: Sequence[str]) -> int:
    """Run a command of ``studies`` in a separate process and return its exit code.

    Raises:
        ArgumentError: there is no checkout, because tauguard is installed without its sources.
    """
    root = checkout()
    if root is None:
        raise ArgumentError(
            "the studies are in the source distribution, not in an installed package: "
            "unpack `pip download --no-binary tauguard --no-deps tauguard` and run this there"
        )
    # The checkout must be on the path for -m, although its folder names may hide packages.
    path = os.pathsep.join(
        [str(root), str(root / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    command = [sys.executable, "-m", "studies", name, *args]
    return subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, check=False).returncode


def checkout() -> Path | None:
    """The folder that contains ``studies``: the package's source tree or the working folder."""
    for root in (Path(tauguard.__file__).resolve().parents[2], Path.cwd()):
        if (root / "studies" / "__main__.py").is_file():
            return root
    return None
