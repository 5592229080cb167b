"""Speed against error: one file a study, one table and one figure each.

A study is a module ``tauguard.benchmarks.<name>`` with two functions::

    def run(quick: bool, seed: int) -> list[dict[str, object]]   # flat rows
    def draw(rows: list[dict[str, object]], figure: matplotlib.figure.Figure) -> None

and, where the rows are too many to print, ``shown(rows) -> rows``: what is printed instead. Its
``NOTES: dict[str, str]`` say above each table (by the rows' ``study``) what the columns mean.
"""

#: Every study and its one-line description, in the order of ``tauguard bench list``.
STUDIES: dict[str, str] = {
    "simulation": "what each part of a scene costs, and what the time step costs in accuracy",
    "impact": "blows against body regions beside the two-mass model: error against cost",
    "detection_conformal": "false alarms per hour: what calibration promises, and what is counted",
    "detection_online": "observer and SVR a sample: microseconds, and fewer support vectors",
    "environments": "what an environment costs beside its physics, many at once, and reactions",
    "rigid": "convex overlap by elimination (ABFME) and axes, meshes, time of impact, beside coal",
    "contacts": "contact checkers beside MuJoCo and a referee: what each sees, when, at what cost",
    "guard": "fast things against thin ones: fixed steps, MuJoCo's modes, guarded steps",
    "cloth": "whole frames of deforming meshes: methods, volumes, front, growth, beside ipctk",
    "diagnosis": "after the alarm: link, force, point and kind of event against the truth",
    "real_arm": "logs of a real UR10e: residuals, false alarms, smallest contacts, beside a peer",
    "detection": "the dissertation's experiment: detectors, speeds, operating points, false alarms",
}
