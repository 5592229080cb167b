"""The smallest part of the study simulation, through the command line."""


def test_impacts_keep_within_two_percent_of_the_two_mass_model(bench):
    rows = bench("simulation-impact")[0]["rows"]
    asked = [row for row in rows if row["study"] == "summary"]
    assert len(asked) == 2
    assert all(row["met"] for row in asked)
    assert {row["link"] for row in rows if row["study"] == "arm"} == {4, 5, 6}
