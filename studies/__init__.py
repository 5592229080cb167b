"""Studies of speed against error, run from a checkout.

Each package is one study; :mod:`studies.framework` runs it.

A study's ``__init__.py`` says what is asked: its ``STUDY`` names the parts that a user can ask for.
The other files of the package say how each part is measured.
"""

#: The packages, in the order of ``tauguard bench list``.
STUDIES = (
    "simulation",
    "detection",
    "real_arms",
    "contacts",
    "cloth",
    "rigid",
    "datasets",
    "faults",
)

_SLOW = "is a slow test now: run `pytest -m slow -k {}` in a checkout"
_NOTE = "has ended; its result is docs/notes/2026-11-23-{}.md"
#: Studies that have ended, and what to do instead.
FORMER = {
    "mutants": _SLOW.format("damaged_file"),
    "kills": _SLOW.format("'interrupted or generate'"),
    "endurance": _SLOW.format("endurance"),
    "detection_ladder": _NOTE.format("from-the-dissertation"),
    "arms": _NOTE.format("arms") + "; `tauguard robot NAME --try` tries an arm",
    "detection_parts": _NOTE.format("thresholds"),
    "detection_conformal": "is a row of false_alarms now: `tauguard bench false_alarms`",
}
