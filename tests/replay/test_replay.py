"""Recordings: rerun's own reader and checker say what is in them."""

import dataclasses
import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tauguard.cli import main
from tauguard.detectors import Evaluation, match_detection
from tauguard.findings import ArgumentError
from tauguard.replay import plot, write_rrd
from tauguard.replay.robot import bodies, load_model, motion
from tauguard.replay.rrd import extremes, thin
from tauguard.replay.story import cut, first_moment, page
from tauguard.traces import Alarm, Log, write_mcap

spec = spec_from_file_location("arm", Path(__file__).with_name("arm.py"))
arm = module_from_spec(spec)
spec.loader.exec_module(arm)

URDF = """
<robot name="two">
  <link name="base"/>
  <link name="upper"><visual><geometry><mesh filename="package://lost/upper.dae"/></geometry></visual>
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="lower">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit effort="1" velocity="1" lower="-3" upper="3"/>
  </joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 1 0"/><limit effort="1" velocity="1" lower="-3" upper="3"/>
  </joint>
</robot>
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "play.rrd"
    trace, detection = arm.make()
    write_rrd(path, trace, detection, whole=True)
    return path, trace, detection


def columns(path):
    """Times [s] and chunks by entity, through rerun's reader."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        if "time" in batch.schema.names:
            times = np.array(batch.column("time").cast("int64")) / 1e9
            found[str(chunk.entity_path)] = (times, batch)
    return found


def test_the_layout_comes_before_the_data(recording):
    """A viewer plays until it has read the layout, which says that it is to wait."""
    printed = subprocess.run(
        [Path(sys.executable).with_name("rerun"), "rrd", "print", recording[0]],
        capture_output=True,
        text=True,
        env=os.environ | {"RERUN_ANALYTICS": "0"},
    ).stdout
    assert 0 < printed.index("BlueprintActivationCommand") < printed.index("- /scene/")


def test_rerun_verifies_it(recording):
    done = subprocess.run(
        [Path(sys.executable).with_name("rerun"), "rrd", "verify", recording[0]],
        capture_output=True,
        text=True,
        env=os.environ | {"RERUN_ANALYTICS": "0"},
    )
    assert done.returncode == 0, done.stderr


def test_bodies_are_where_mujoco_puts_them(recording):
    path, trace, _ = recording
    times, batch = columns(path)["/scene/link3"]
    found = np.array(batch.column("Transform3D:translation").to_pylist())[:, 0]
    model = mujoco.MjModel.from_xml_string(arm.ARM)
    data = mujoco.MjData(model)
    for k in (0, 50, -1):
        data.qpos[:3] = trace.q[np.argmin(np.abs(trace.t - times[k]))]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(found[k], data.body("link3").xpos, atol=1e-6)


def test_peaks_survive_the_thinning(recording):
    path, trace, detection = recording
    force = np.array(columns(path)["/force"][1].column("Scalars:scalars").to_pylist())
    assert force.max() == trace.truth.contact_force.max()
    residual = np.array(columns(path)["/residual"][1].column("Scalars:scalars").to_pylist())
    np.testing.assert_array_equal(
        np.abs(residual).max(axis=0), np.abs(detection.residual).max(axis=0)
    )


def test_arrows_only_while_there_is_contact(recording):
    path, trace, _ = recording
    times, batch = columns(path)["/scene/contact_force"]
    there = np.array([bool(v) for v in batch.column("Arrows3D:vectors").to_pylist()])
    touching = times[there]
    for collision in trace.truth.collisions:
        inside = (times > collision.onset) & (times < collision.end)
        assert there[inside].all()
        touching = touching[
            (touching < collision.onset - 1 / 60) | (touching > collision.end + 1 / 60)
        ]
    assert touching.size == 0


def test_it_begins_at_the_first_detection(tmp_path):
    trace, detection = arm.make()  # two collisions, the first is missed
    start = detection.alarms[0].start
    assert start > trace.truth.collisions[1].onset
    assert first_moment(trace, detection) == start
    write_rrd(tmp_path / "a.rrd", trace, detection)
    assert min(times[0] for times, _ in columns(tmp_path / "a.rrd").values()) == start
    rest, said = cut(trace, detection, start)
    assert rest.t[0] == start
    assert rest.truth.collisions == trace.truth.collisions[1:]
    assert len(said.score) == len(rest.t) == len(rest.truth.obstacle_poses)
    missed = dataclasses.replace(detection, alarms=())
    assert first_moment(trace, missed) == trace.t[0]


def test_the_page_tells_what_was_detected():
    trace, detection = arm.make()
    text = page(trace, detection, about="Strike on link 3: missed")
    assert text.startswith("## Strike on link 3: missed")
    assert "2 collisions, 1 detected" in text
    alarms = (*detection.alarms, Alarm(0.2, 0.3))
    more = page(trace, dataclasses.replace(detection, alarms=alarms))
    assert "2 collisions, 1 detected, 1 false alarm\n" in more
    assert "1 collision, 0 detected" in page(*arm.make(hits=1))
    assert "| 3.000 | strike | 3 | 20.0 | 12 ms |" in text
    assert "| 1.000 | strike | 3 | 20.0 | - |" in text


@dataclasses.dataclass(frozen=True)
class Said:
    alarm: Alarm
    kind: str = "clamp"
    summary: str = "clamp, link 3, 100 N"
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.array([0.0, 60.0, 80.0]))
    point: np.ndarray = dataclasses.field(default_factory=lambda: np.array([0.5, 0.1, 0.4]))


def test_estimated_forces_are_drawn_from_the_alarm_on_and_told(tmp_path):
    trace, detection = arm.make()
    alarm = detection.alarms[0]
    load = Said(Alarm(0.2, 0.3), "payload")
    write_rrd(tmp_path / "a.rrd", trace, detection, whole=True, explained=[load, Said(alarm)])
    times, batch = columns(tmp_path / "a.rrd")["/scene/estimated_force"]
    vectors = batch.column("Arrows3D:vectors").to_pylist()
    there = np.array([bool(v) for v in vectors])
    np.testing.assert_array_equal(there, (times >= alarm.start) & (times <= alarm.start + 0.5))
    first = int(np.argmax(there))
    vector = np.array(vectors[first][0])
    np.testing.assert_allclose(vector, 0.2 * np.array([0, 0.6, 0.8]), atol=1e-6)
    origin = np.array(batch.column("Arrows3D:origins").to_pylist()[first][0])
    np.testing.assert_allclose(origin + vector, [0.5, 0.1, 0.4], atol=1e-6)
    text = page(trace, detection, [load, Said(alarm)])
    assert "| 3.000 | strike | 3 | 20.0 | 12 ms | clamp, link 3, 100 N |" in text
    assert "| 1.000 | strike | 3 | 20.0 | - | - |" in text
    bare = dataclasses.replace(trace, truth=None)
    assert ": clamp, link 3, 100 N" in page(bare, detection, [Said(alarm)])


def test_collision_geometry_is_hidden_and_every_kind_drawn():
    shown = {body.name: body for body in bodies(load_model(arm.ARM))}
    kinds = {name: [type(s).__name__ for s in body.shapes] for name, body in shown.items()}
    assert kinds["link1"] == ["Cylinders3D"]
    assert kinds["link3"] == ["Boxes3D", "Mesh3D", "Ellipsoids3D"]
    assert not shown["base"].moves
    mesh = shown["link3"].shapes[1]
    assert len(mesh.vertex_positions.as_arrow_array()) == 12
    normals = np.array(mesh.vertex_normals.as_arrow_array().to_pylist())
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)


def test_a_urdf_without_its_meshes_becomes_sticks(tmp_path):
    (tmp_path / "two.urdf").write_text(URDF)
    model = load_model(tmp_path / "two.urdf")
    sticks = [shape for body in bodies(model) for shape in body.shapes]
    assert {type(shape).__name__ for shape in sticks} == {"Capsules3D"}
    assert [0.5] in [shape.lengths.as_arrow_array().to_pylist() for shape in sticks]
    trace, detection = arm.make(seconds=0.5, joints=("a", "b"))
    write_rrd(tmp_path / "a.rrd", trace, detection, model)
    assert (tmp_path / "a.rrd").stat().st_size > 10_000


@pytest.mark.data
def test_the_real_urdf_moves(data_dir):
    model = load_model(data_dir / "ur10e" / "ur10e.urdf")
    names = [model.joint(i).name for i in range(model.njnt)]
    assert len(names) == 6
    moved = motion(model, names, np.stack([np.zeros(6), np.full(6, 0.5)]))
    assert (np.abs(moved.positions[1] - moved.positions[0]).max(axis=1) > 0.01).sum() >= 4


def test_thinning_keeps_every_row_in_one_bin():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.0005, 0.0015, 1000))
    starts = thin(t, 60.0, 30_000)
    assert starts[0] == 0
    assert abs(len(starts) - 60 * (t[-1] - t[0])) <= 2
    values = rng.standard_normal(1000)
    kept = extremes(values, starts)
    bins = np.split(values, starts[1:])
    assert [abs(v) for v in kept] == [np.abs(b).max() for b in bins]
    assert len(thin(t, 60.0, 10)) <= 11


def test_bad_input_is_one_line(tmp_path):
    trace, _ = arm.make(seconds=0.1, hits=0)
    renamed = dataclasses.replace(trace, joint_names=("j1", "elbow", "j3"))
    with pytest.raises(ValueError, match="'elbow' is not in the model; its joints: j1, j2, j3"):
        write_rrd(tmp_path / "a.rrd", renamed)
    with pytest.raises(ValueError, match="no attached MJCF"):
        write_rrd(tmp_path / "a.rrd", dataclasses.replace(trace, attachments={}))
    with pytest.raises(FileNotFoundError, match="missing"):
        write_rrd(tmp_path / "a.rrd", trace, None, tmp_path / "missing.urdf")
    with pytest.raises(ValueError, match="no MJCF or URDF"):
        write_rrd(tmp_path / "a.rrd", trace, None, "<mujoco><nonsense/></mujoco>")
    assert list(tmp_path.iterdir()) == []


def test_command_line(tmp_path, capsys):
    trace, detection = arm.make(seconds=0.5)
    write_mcap(tmp_path / "a.mcap", trace, detection)
    main(["replay", str(tmp_path / "a.mcap")])
    assert "a.rrd" in capsys.readouterr().out
    assert (tmp_path / "a.rrd").exists()
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-20])
    with pytest.raises(SystemExit) as stop:
        main(["replay", str(tmp_path / "b.mcap")])
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "b.mcap" in error
    assert not (tmp_path / "b.rrd").exists()


def test_results_have_figures_of_their_own(recording):
    _, trace, detection = recording
    log = Log(trace, labels=((1.0, 1.5),))
    marked = plot(log, detection)
    assert len(marked.axes) == len(plot(trace, detection).axes)
    shaded = [len(panel.patches) for panel in marked.axes]
    plain = [len(panel.patches) for panel in plot(trace, detection).axes]
    assert [a - b for a, b in zip(shaded, plain, strict=True)] == [1] * len(plain)
    evaluation = Evaluation.of(["a"], [match_detection(detection, trace, 0.5)])
    assert len(plot(evaluation).axes) == 3
    with pytest.raises(ArgumentError, match="plot: a int has no figure"):
        plot(3)
