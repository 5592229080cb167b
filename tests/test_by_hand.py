"""What one types by hand: completion, a residual, a figure, values that print in a line."""

import ast
import importlib
import inspect
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import tauguard
from tauguard import cloth, contacts, rigid
from tauguard.detectors import make_detector
from tauguard.detectors.alarms.training import train
from tauguard.envs import CollisionPlan, Episode, simulate
from tauguard.models import (
    SceneObject,
    SceneSpec,
    compose,
    cura6_drive,
    drive_text,
    link_surface,
    load_arm,
)
from tests.models.arms import random_arm


@pytest.fixture(scope="module")
def trace():
    plan = CollisionPlan("pulse", 1.0, 3, strength=60.0)
    return simulate(Episode(4, seconds=2.0, collisions=(plan,), ideal_drive=True))


#: Packages that load names at their first use come first: the others load what they would.
PACKAGES = "traces datasets detectors replay live twin benchmark rigid cloth models envs contacts"


def test_dir_lists_every_public_name_and_loads_none():
    code = f"""
import importlib, sys
for name in {PACKAGES.split()}:
    package = importlib.import_module(f"tauguard.{{name}}")
    before, names = set(sys.modules), set(dir(package))
    assert set(package.__all__) <= names, (name, set(package.__all__) - names)
    assert set(sys.modules) == before, name
    assert not {{"Any", "TYPE_CHECKING", "importlib", "on_demand"}} & names, name
"""
    subprocess.run([sys.executable, "-c", code], check=True)


PLACE = Path(tauguard.__file__).parent
STUBS = sorted(PLACE.glob("*/__init__.pyi"))


@pytest.mark.parametrize("stub", [PLACE / "__init__.pyi", *STUBS], ids=lambda p: p.parent.name)
def test_type_checkers_see_the_names_that_there_are(stub):
    lines = [node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom)]
    modules = {alias.name: line.module for line in lines for alias in line.names}
    folder = stub.parent.relative_to(PLACE.parent)
    package = importlib.import_module(".".join(folder.parts))
    packages = {name for name, module in modules.items() if module == "tauguard"}
    assert set(modules) - packages == set(package.__all__)
    assert packages <= set(dir(package))
    for name, module in modules.items():
        assert getattr(package, name) is getattr(importlib.import_module(module), name), name


def test_the_package_itself_completes_without_loading_a_package():
    code = (
        "import sys, tauguard; names = dir(tauguard);"
        "assert {'cloth', 'envs', 'plot', 'residual'} <= set(names);"
        "assert not {'Any', 'TYPE_CHECKING', 'importlib', 'version'} & set(names);"
        "assert 'mujoco' not in sys.modules and 'tauguard.envs' not in sys.modules;"
        "assert tauguard.rigid.__name__ == 'tauguard.rigid'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(AttributeError, match="'tauguard' has no attribute 'wings'"):
        tauguard.wings  # noqa: B018


def test_the_residual_of_an_ideal_arm_is_the_true_external_torque(trace):
    """A lossless arm without sensor errors: the observer lags by its gain and errs in nothing."""
    lossless = drive_text(replace(cura6_drive(), friction=None))
    ideal = replace(trace, attachments={**trace.attachments, "drive.json": lossless})
    found = tauguard.residual(ideal, gain=500.0)
    truth = trace.truth.tau_ext
    lagged = np.zeros_like(truth)
    for k in range(1, len(truth)):  # first order, 500 rad/s
        lagged[k] = lagged[k - 1] + (1 - np.exp(-0.5)) * (truth[k - 1] - lagged[k - 1])
    assert np.abs(truth).max() > 5
    assert np.abs(found - lagged).max() < 0.05 * np.abs(truth).max()
    named = tauguard.residual(trace, robot="cura6", gain=500.0)
    # The named arm has friction, which this trace has not: at rest both agree.
    still = np.abs(trace.qd).max(axis=1) < 1e-6
    assert still.sum() > 50
    assert np.abs(named - found)[still].max() < 1.0


def test_a_robot_of_other_joints_and_a_trace_without_one_are_named(trace, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(random_arm(1, "none"))
    bare = replace(trace, attachments={})
    with pytest.raises(ValueError, match="name its robot, robot='ur5e'"):
        tauguard.residual(bare)
    joints = random_arm(1, "none").count("<joint ")
    if joints != 6:
        with pytest.raises(ValueError, match=r"the trace has 6: joint1"):
            tauguard.residual(trace, robot=str(path))


def test_a_figure_has_a_panel_for_everything_and_shades_the_collisions(trace, tmp_path):
    figure = tauguard.plot(trace)
    assert [axes.get_ylabel() for axes in figure.axes][-1] == "external torque, truth [N m]"
    assert all(axes.patches for axes in figure.axes)
    figure.savefig(tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_values_print_in_a_line(trace):
    assert repr(trace) == "Trace(6 joints, 2000 samples every 1 ms, 2.00 s, 1 collisions)"
    assert repr(trace.truth).startswith("Truth(2000 samples, 1 collisions, largest contact force 6")


def test_bodies_and_meshes_print_in_a_line():
    many = np.zeros((60, 3))
    boxes = rigid.Boxes(many, many, np.tile(np.eye(3), (60, 1, 1)))
    assert repr(boxes) == (
        "Boxes(center=array(60, 3), half_extents=array(60, 3), rotation=array(60, 3, 3))"
    )
    assert repr(rigid.Rounded(boxes, 0.1)) == "Rounded(core=<Boxes>, radius=array(60,))"
    assert repr(rigid.Hulls(many, [0, 60])) == "Hulls(vertices=array(60, 3), offsets=[0, 60])"
    hit = rigid.overlap(boxes, boxes).hit[:2]
    assert repr(rigid.Overlap(hit, lambda: None)) == "Overlap(hit=[True, True])"
    faces = [[0, 1, 2], [1, 2, 3]]
    ccd = cloth.MeshCCD(faces, points=[7])
    assert repr(ccd) == "MeshCCD(2 faces, 5 edges, 1 points, method='ab2pf')"
    tree = rigid.MeshTree(np.eye(4, 3), faces)
    assert repr(tree) == "MeshTree(4 vertices, 2 faces, volume='obb')"


def test_help_of_a_guards_report_explains_every_field():
    said = inspect.getdoc(contacts.StepReport) + inspect.getdoc(contacts.Cut)
    names = [field.name for kind in (contacts.StepReport, contacts.Cut) for field in fields(kind)]
    for name in names:
        assert name.startswith("_") or f"\n    {name}: " in said, name


def test_every_value_that_one_meets_prints_in_a_few_lines(trace):
    scene = compose(SceneSpec())
    env = gymnasium.make("tauguard:tauguard/Reach-v0").unwrapped
    values = [
        *(scene, scene.facts, scene.drive, scene.drive.friction, scene.drive.ripple, scene.spec),
        *(load_arm("cura6"), link_surface(scene.arm_xml, points=20), env.compiled, env.regions[0]),
        *(trace, trace.truth, trace.truth.collisions[0], SceneObject("a", mjcf=scene.xml)),
    ]
    for value in values:
        said = repr(value)
        assert said.startswith(f"{type(value).__name__}(")
        assert len(said) < 900, said
        assert "\n" not in said
    env = gymnasium.make("tauguard/TwoArms-v1").unwrapped
    assert repr(env) == "TwoArmsEnv(cura6, 1 at once, 12 actions, 48 observations, 0 regions)"
    assert repr(env.task) == f"TwoArms({env.batch!r})"
    assert "gain=[10, 10.7, 8.5, 9, 9.5, 10.1]" in repr(scene.drive)
    assert "point=array(120, 3)" in repr(link_surface(scene.arm_xml, points=20))


def test_a_detector_of_simulated_traces_needs_no_arm_model():
    motion = [simulate(Episode(seed=k, seconds=6.0)) for k in range(3)]
    alarm = train(make_detector("residual-thresholds"), motion)
    assert alarm.detect(motion[0]).alarms == ()


def test_a_plain_model_can_be_compared():
    text = (
        '<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 .2"><freejoint/>'
        '<geom size=".05"/></body></worldbody></mujoco>'
    )
    report = contacts.compare(mujoco.MjModel.from_xml_string(text), ["mujoco"], seconds=0.3)
    assert report.scores[0].checker == "mujoco"
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(ValueError, match="expected a list of names"):
        contacts.compare(model, mujoco.MjData(model))


def test_modules_of_envs_are_completed_and_load():
    assert {"controllers", "policies", "wrappers"} <= set(dir(tauguard.envs))
    assert tauguard.envs.wrappers.Reaction


def test_results_of_collision_queries_print_as_shapes():
    apart = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    solid = rigid.Tetrahedra([apart])
    frame = cloth.MeshCCD([[0, 1, 2]]).find(apart[:3], apart[1:])
    for value in (frame, frame.vf_impacts, rigid.distance(solid, solid)):
        assert len(repr(value)) < 400
        assert "array(" in repr(value)
    assert "ArrayLike" in str(inspect.signature(rigid.Boxes))
    assert len(str(inspect.signature(rigid.overlap))) < 200
