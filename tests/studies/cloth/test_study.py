"""The cloth study around its parts: recorded data, printed counts, figure."""

import pytest

from studies.cloth import study as cloth
from tauguard.report import rate


def test_recorded_data_are_named_by_the_variable(monkeypatch, tmp_path):
    monkeypatch.delenv("TAUGUARD_DATA", raising=False)
    assert cloth.recorded() is None
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))
    with pytest.raises(
        ValueError, match=r"TAUGUARD_DATA: .*ccd lacks files in cloth-fun.* 15 more"
    ):
        cloth.recorded()
    for name in ("cloth-funnel", "cloth-ball"):
        for part in ("frames", "boxes", "mma_bool"):
            (tmp_path / "ccd" / name / part).mkdir(parents=True)
            (tmp_path / "ccd" / name / part / "1.json").touch()
    with pytest.raises(ValueError, match="ccd lacks files in unit-tests/vertex-face, unit-tests/e"):
        cloth.recorded()


@pytest.mark.data
def test_recorded_data_are_found(monkeypatch, data_dir):
    monkeypatch.setenv("TAUGUARD_DATA", str(data_dir))
    assert cloth.recorded() == data_dir


def test_rates_are_printed_as_counts():
    spent = {"median": 1.0, "low": 1.0, "high": 2.0}
    row = {"misses": rate(3, 70_001), "false_hits": rate(0, 0), "ns": spent, "set": "a"}
    assert cloth.shown([row]) == [
        {"misses": "3 of 70001", "false_hits": "0 of 0", "ns": spent, "set": "a"}
    ]
