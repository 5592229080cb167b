"""Studies of speed against error, run from a checkout.

Each package is one study; :mod:`studies.framework` runs it.

A study's ``__init__.py`` defines ``STUDY``, the list of the parts that a user can run.
The other files of the package measure the parts.
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
