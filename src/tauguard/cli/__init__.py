"""The command line: one file a command, heavy imports inside the command."""

from __future__ import annotations


def main() -> None:
    """Entry point of ``tauguard``."""
    raise SystemExit("tauguard: no command is built yet")
