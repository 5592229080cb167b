"""The studies of trust on a few samples: judges see what is wrong, rows can be drawn."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from studies.small_detector import trained
from studies.trust import endurance, generated, judges, readers
from studies.trust.originals import WRITERS
from tauguard.datasets.plans import free_episodes
from tauguard.envs import simulate
from tauguard.live import rtde


def test_a_stream_with_a_short_data_packet_ends_there_and_other_samples_are_wrong(tmp_path):
    path = tmp_path / "a.rtde"
    WRITERS["rtde"](path)
    data = path.read_bytes()
    size = 3 + 1 + 8 * 19
    begin = len(data) - 10 * size  # of the 51st of its 60 packets
    path.write_bytes(data[:begin] + rtde.packet(rtde.DATA_PACKAGE, b"\x01short") + data[begin:])
    found = readers.rtde(path)
    assert len(found) == 50
    assert judges.as_rtde(path, found, None) == ""
    assert judges.as_rtde(path, found[:-1], None) == "other samples"
    assert judges.as_rtde(path, [*found[:-1], [0.5, *found[-1][1:]]], None) == "other samples"


def test_generate_is_killed_and_goes_on_to_the_same_bytes(monkeypatch):
    less = (("episodes = 6", "episodes = 2"), ('"cura6", "cura6-long"', '"cura6"'))
    small = generated.SMALL
    for old, new in (*less, ("residual = true", "residual = false")):
        assert old in small
        small = small.replace(old, new)
    monkeypatch.setattr(generated, "SMALL", small)
    row = generated.killed(1, 1, 3)
    assert (row["workers"], row["kills"], row["same bytes"]) == (1, 1, 1)


@pytest.fixture(scope="module")
def alarm():
    free = [simulate(e) for e in free_episodes(9, 3, 6.0, (40.0,), (0.0,), None)]
    return trained(free, endurance.SAMPLES, 5.0, "residual-thresholds")


def test_an_endurance_of_a_few_resets_and_actions(alarm, monkeypatch):
    monkeypatch.setattr(endurance, "PARTS", (4, 2))
    monkeypatch.setattr(endurance, "RESETS", (8, 4))
    monkeypatch.setattr(endurance, "HOURS", (1.0, 20 / endurance.RATE / 3600))
    rows = [*endurance.resets(True, 0, alarm), *endurance.online(True, 0, alarm)]
    assert [row["study"] for row in rows] == [*["resets"] * 2, "growth", *["online"] * 2, "growth"]
    assert [row["resets"] for row in rows[:2]] == [2, 4]
    assert rows[4]["hours"] == pytest.approx(20 / 50 / 3600)
    assert all(row["memory [MiB]"] > 10 for row in rows if row["study"] != "growth")
    assert np.isfinite(rows[-1]["drift"])
    endurance.draw(rows, Figure())
