"""``python -m tauguard``: the command line."""

from tauguard.cli import main

main()
