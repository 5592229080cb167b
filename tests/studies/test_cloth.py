"""The smallest part of the cloth study, run as a user runs it."""


def test_volumes_and_growth_are_measured(bench):
    found, printed = bench("cloth-volumes", "--tables")
    rows = [row for row in found["rows"] if row["study"] == "volume"]
    assert len({row["scene"] for row in rows}) == 5
    boxes, kdops = (
        sum(row["vf_candidates"] for row in rows if row["volume"] == name)
        for name in ("k_dop6", "k_dop26")
    )
    assert boxes > kdops > 0
    sizes = [row for row in found["rows"] if row["study"] == "size"]
    assert len({row["triangles"] for row in sizes}) > 5
    assert "exponent" in printed
