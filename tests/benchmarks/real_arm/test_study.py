"""The study of a real arm judges only what it did not train on."""

import numpy as np
import pytest

from tauguard.benchmarks.real_arm import study as real_arm
from tauguard.detectors.calibration.recording import Load, Recording


def test_says_so_where_there_are_no_logs(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))
    (row,) = real_arm.run(quick=True, seed=0)
    assert "TAUGUARD_DATA" in row["log"]


def test_every_deal_judges_each_log_once():
    names = [f"log {k}" for k in range(9)] + ["joint 1", "joint 2"]
    moving = {name: Recording(None, Load()) for name in names}
    data = real_arm.Data(None, moving, {})
    dealt = list(real_arm.splits(data, 4, seed=3))
    assert dealt[0] == ("free only", ["joint 1", "joint 2"])
    for deal in range(1, 5):
        own = [logs for name, logs in dealt if name.startswith(f"{deal}.")]
        assert len(own) == 4
        assert sorted(name for logs in own for name in logs) == sorted(moving)
    assert len({tuple(logs) for _, logs in dealt}) == len(dealt)


def test_totals_are_bounded_by_the_exact_interval():
    def row(split, seconds, alarms):
        zero = {"joint-seconds at rest": 0.0, "peer seconds": 10.0, "peer alarms": 1}
        return {"split": split, "seconds": seconds, "alarms": alarms} | zero

    rows = [row("1.1 of 2", 1800.0, 0), row("1.2 of 2", 1800.0, 0), row("2.1 of 1", 3600.0, 2)]
    none, two = real_arm._totals(rows)
    # Exact Poisson interval: no alarm in an hour bounds the rate at -ln(0.025), two at 7.22.
    assert none["per hour at most"] == pytest.approx(-np.log(0.025))
    assert two["per hour at most"] == pytest.approx(7.2247, abs=1e-3)


@pytest.mark.data
def test_residuals_on_logs_left_out(data_dir, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(data_dir))
    folder = real_arm.available()
    if folder is None:
        pytest.skip("no ur10e folder in the real data")
    data = real_arm.load(folder)
    logs = dict(list(data.excitation.items())[-3:])
    data = real_arm.Data(data.arm, logs, {})
    rows = {row["parameters"]: row for row in real_arm.residual_rows(data) if "all" in row["log"]}
    ours, book = (
        [rows[k][f"j{j} N m"] for j in range(1, 7)] for k in ("from the other logs", "published")
    )
    assert (np.array(ours) < [1.6, 1.9, 0.8, 0.3, 0.3, 0.25]).all()
    assert (np.array(ours) < 0.5 * np.array(book)).all()
