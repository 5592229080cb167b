"""The study contacts: its rows, and that the crossing's truth is the closed form."""

import matplotlib
import numpy as np
import pytest

from studies.contacts import study

matplotlib.use("Agg")


def test_a_crossing_is_timed_and_mujocos_share_counted():
    row = study._crossing(50.0, 5e-3, "plain", 2)
    assert row["cloth_recall"]["value"] == 1
    assert row["cloth_recall"]["n"] == 6
    assert row["cloth_time_error"] < 1e-6
    assert row["mujoco_generates"]["value"] < 1
    slow = study._crossing(2.0, 1e-3, "plain", 1)
    assert slow["mujoco_generates"]["value"] == 1
    assert slow["mujoco_holds"]["value"] == 1
    assert slow["cloth_time_error"] < 1e-6


def test_rows_of_a_scene_and_the_figure():
    rows = [*study._scene("sphere_plate", 5e-3, None, 20), study._crossing(50.0, 5e-3, "plain", 1)]
    assert [row.get("checker") for row in rows] == ["mujoco", "cloth", "rigid", None]
    rigid = rows[2]
    assert rigid["recall"]["value"] == rigid["precision"]["value"] == 1
    assert rows[1]["recall"]["n"] == 0
    assert rows[0]["not_generated"] == 1
    assert rigid["us_per_step"]["low"] <= rigid["us_per_step"]["median"]
    assert rigid["share"] == pytest.approx(
        rigid["us_per_step"]["median"] / rigid["mj_step_us"], rel=1e-6
    )
    import matplotlib.pyplot as plt

    figure = plt.figure()
    study.draw(rows, figure)
    assert len(figure.axes) == 3
    assert all(np.isfinite(axis.get_xlim()).all() for axis in figure.axes)
    plt.close(figure)
