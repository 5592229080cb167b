"""Named hard cases with exact answers, for tauguard's kernels and for other libraries.

A library takes part through an adapter: an object with a ``name`` and a method for each kind of
case that it supports (:class:`~tauguard.hard_cases.adapter.Adapter` lists them). A kind without
a method is skipped.
"""

from tauguard.hard_cases.adapter import Adapter, adapters
from tauguard.hard_cases.case import Case, load_cases
from tauguard.hard_cases.verdicts import run, verdicts

__all__ = ["Adapter", "Case", "adapters", "load_cases", "run", "verdicts"]
