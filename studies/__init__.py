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
