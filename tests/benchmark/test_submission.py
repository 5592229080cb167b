"""Submissions: what a stranger may hand in, and what is refused."""

import pytest

from tauguard.benchmark.submission import ranking, submitted
from tauguard.findings import FileError

CARD = """\
name = "mine"
source = "A. Author 2026"
inputs = "currents"
training = "free logs of the UR5"
knob = "a threshold, from other logs"
"""


@pytest.fixture
def folder(tmp_path, data_dir, monkeypatch):
    """A submission for one arm without an alarm, on two of its logs."""
    data = tmp_path / "data"
    for name in ("ur5.urdf", "free/no5.csv", "contact/no5_pushed.csv"):
        (data / "ur5" / name).parent.mkdir(parents=True, exist_ok=True)
        (data / "ur5" / name).symlink_to(data_dir / "ur5" / name)
    monkeypatch.setenv("TAUGUARD_DATA", str(data))
    own = tmp_path / "mine"
    (own / "ur5").mkdir(parents=True)
    (own / "card.toml").write_text(CARD)
    for log in ("no5", "no5_pushed"):
        (own / "ur5" / f"{log}.csv").write_text("start,end\n")
    return own


@pytest.mark.data
def test_alarms_at_the_onsets_find_every_contact(folder):
    onsets = (12.54, 18.9, 20.42, 21.14, 21.82, 24.78, 25.51, 26.17, 27.3, 27.82)
    lines = "".join(f"{t + 0.02},{t + 0.1}\n" for t in onsets)
    (folder / "ur5" / "no5_pushed.csv").write_text("start,end\n" + lines)
    card, rows = submitted(folder)
    assert card.name == "mine"
    assert {r["state"]: (r["found"], r["contacts"], r["within 100 ms"]) for r in rows} == {
        "moving": ("9", "9", "9"),
        "standing": ("1", "1", "1"),
    }
    assert {r["false alarms"] for r in rows} == {"0"}


@pytest.mark.data
@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("card.toml", None, "no card.toml; it has the fields name, source"),
        ("card.toml", "name = 'x'\nextra = 1", "missing: source, inputs.*unknown: extra"),
        ("card.toml", "name = ", "not TOML"),
        ("ur5/no5.csv", None, "no file for no5"),
        ("ur5/no6.csv", "start,end\n", "ur5 has no log no6"),
        ("ur5/no5.csv", "begin,end\n", "columns begin, end; expected start, end"),
        ("ur5/no5.csv", "start,end\n1,2\n3,x\n", "line 3: '3,x'; expected two times"),
        ("ur5/no5.csv", "start,end\n2,1\n", "line 2: 2.0 to 1.0 s; expected first <= start"),
        ("ur5/no5.csv", "start,end\n1,9999\n", "the log lasting from"),
        ("ur6/a.csv", "start,end\n", "folders of arms: ur6"),
        ("panda_touch/a4.csv", "start,end\n", "run `tauguard data fetch panda_touch`"),
    ],
)
def test_a_wrong_submission_is_named(folder, file, text, message):
    path = folder / file
    path.parent.mkdir(exist_ok=True)
    if text is None:
        path.unlink()
    else:
        path.write_text(text)
    with pytest.raises(FileError, match=message):
        submitted(folder)


def row(method, point, found, chance, false):
    return {"method": method, "operating point": point, "arm": "ur5", "truth": "sensor",
            "state": "standing", "contacts": "8", "found": found, "by chance": chance,
            "false alarms": false, "free min": "60.00"}  # fmt: skip


def test_methods_are_ranked_by_what_they_find_beyond_chance():
    rows = [
        row("a", "60 an hour", "8", "0.900", "500"),
        row("b", "60 an hour", "4", "0.100", "10"),
        row("b", "as it is", "8", "0.000", "0"),
        row("c", "as submitted", "5", "0.100", "3"),
    ]
    ranked = ranking(rows, "60 an hour")
    assert [(r["method"], r["beyond chance"]) for r in ranked] == [
        ("c", "0.525"),
        ("b", "0.400"),
        ("a", "0.100"),
    ]
    assert ranked[1]["false per hour"] == "5 to 18"  # exact Poisson limits of 10 in an hour
