"""``python -m studies bench`` and ``report``: behind tauguard's commands of these names."""

import sys

from tauguard.cli import run_command

if __name__ == "__main__":
    name, *args = sys.argv[1:]
    debug = "--debug" in args
    run_command(f"studies.{name}", name, [arg for arg in args if arg != "--debug"], debug)
