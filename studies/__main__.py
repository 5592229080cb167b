"""``python -m studies bench`` and ``report``, which `tauguard bench` and `tauguard report` call."""

import sys

from tauguard.cli import run_command

if __name__ == "__main__":
    name, *args = sys.argv[1:]
    debug = "--debug" in args
    run_command(f"studies.framework.{name}", name, [a for a in args if a != "--debug"], debug)
