"""The force study: a blow by the default contact is within 2 % of paper, and parameters matter."""

from studies.simulation import impact


def test_limp_arm_follows_its_reflected_mass():
    row = impact.arm(("chest",), links=(5,))[0]
    assert row["error"] < 0.02
    assert row["driven_peak_n"] > 1.05 * row["inertial_peak_n"]  # what the drive adds


def test_the_rails_error_falls_with_the_time_step():
    rows = impact.rail(("hand",))
    plain = [r for r in rows if r["integrator"] == "implicitfast" and r["contact"] == "direct"]
    errors = [row["peak_force_error"] for row in plain]
    assert errors == sorted(errors)
    assert next(r for r in plain if r["timestep_ms"] == 1)["peak_force_error"] < 0.02
    assert rows[-1]["peak_force_error"] > 0.2  # MuJoCo's default contact is no body region
