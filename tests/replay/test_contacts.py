"""A run with contacts as a recording: written whole, read back by rerun itself."""

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from tauguard.contacts import compare
from tauguard.contacts.scenes import ball_cloth
from tauguard.replay.contacts import write_contacts_rrd

TEXT = """<mujoco><worldbody><geom type="box" size="1 1 .1"/>
  <body name="ball"><freejoint/><geom size=".1"/></body>
  <flexcomp name="sheet" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" pos="0 0 2"
    radius=".001" mass=".1"><edge equality="true"/></flexcomp></worldbody></mujoco>"""


@pytest.fixture
def run():
    model = mujoco.MjModel.from_xml_string(TEXT)
    data = mujoco.MjData(model)
    states = []
    for _ in range(5):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        states.append((data.time, data.xpos.copy(), data.xmat.copy(), data.flexvert_xpos.copy()))
    t, positions, rotations, vertices = (np.array(column) for column in zip(*states, strict=True))
    return {
        "model": model,
        "t": t,
        "positions": positions,
        "rotations": rotations.reshape(len(t), -1, 3, 3),
        "vertices": vertices,
    }


def test_it_holds_bodies_cloth_contacts_and_notes(run, tmp_path):
    points = np.array([[0, 0, 0.1], [0, 0.1, 0.1], [np.nan] * 3])
    marks = {"rigid": (run["t"][[1, 1, 2]] - 1e-3, points, np.full((3, 3), np.nan))}
    path = tmp_path / "run.rrd"
    write_contacts_rrd(path, **run, marks=marks, notes=[(0.004, "mujoco missed: ball")])
    found = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        if "time" in batch.schema.names:
            when = np.array(batch.column("time").cast("int64")) / 1e9
            found.setdefault(str(chunk.entity_path), []).extend(when.tolist())
    np.testing.assert_allclose(found["/scene/ball"], run["t"])
    np.testing.assert_allclose(sorted(found["/scene/flex\\ 0"]), run["t"])
    np.testing.assert_allclose(found["/notes"], [0.004])
    points = [
        chunk.to_record_batch().column("Points3D:positions").to_pylist()
        for chunk in RrdReader(str(path)).stream()
        if str(chunk.entity_path) == "/contacts/rigid/point"
        and "time" in chunk.to_record_batch().schema.names
    ]
    assert [len(row) for row in points[0]] == [0, 2, 0, 0, 0]
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]


def test_a_comparison_is_drawn(tmp_path):
    report = compare(ball_cloth(speed=40.0), ["mujoco", "cloth"], timestep=5e-3, keep=True)
    write_contacts_rrd(tmp_path / "a.rrd", **report.recording())
    assert (tmp_path / "a.rrd").stat().st_size > 10_000
    with pytest.raises(ValueError, match="keep=True"):
        compare(ball_cloth(), ["cloth"], seconds=0.002, ground_truth=False).recording()


def test_what_does_not_fit_is_named(run, tmp_path):
    with pytest.raises(ValueError, match=r"positions: shape \(4, "):
        write_contacts_rrd(tmp_path / "x.rrd", **{**run, "positions": run["positions"][:4]})
    with pytest.raises(ValueError, match=r"vertices: shape \(0,\), expected \(5, 9, 3\)"):
        write_contacts_rrd(tmp_path / "x.rrd", **{**run, "vertices": None})
    assert not list(tmp_path.iterdir())
